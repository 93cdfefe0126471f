"""Pictures within the page: a file of the folder as text."""

from __future__ import annotations

import base64
from io import BytesIO
from pathlib import Path

from PIL import Image, UnidentifiedImageError

#: Colours that a figure of curves and text keeps; enough for its shades, a third of the bytes.
COLOURS = 128
#: Pixels along which a figure is wide at most.
WIDEST = 1600


def data_uri(folder: Path, file: str) -> str:
    """A PNG of the folder, "" where there is no such picture in it.

    Names that lead out of the folder are of no picture in it.
    """
    path = (folder / file).resolve()
    if not path.is_relative_to(folder.resolve()):
        return ""
    try:
        with Image.open(path, formats=["PNG"]) as picture:
            small = picture.convert("RGB")
    except (OSError, UnidentifiedImageError, Image.DecompressionBombError):
        return ""
    if small.width > WIDEST:
        small = small.resize((WIDEST, round(small.height * WIDEST / small.width)))
    stream = BytesIO()
    small.quantize(COLOURS, dither=Image.Dither.NONE).save(stream, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()
