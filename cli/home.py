"""What libraries keep in a home, where there is none."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def place_matplotlib() -> None:
    """Let matplotlib keep its list of fonts in BUBBLEFIT_CACHE where the home cannot be written.

    It would say on stderr, of every process, that it keeps none.
    """
    cache = os.environ.get("BUBBLEFIT_CACHE")
    if not cache or "MPLCONFIGDIR" in os.environ or os.access(os.path.expanduser("~"), os.W_OK):
        return
    folder = Path(cache).absolute() / "matplotlib"
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        os.environ["MPLCONFIGDIR"] = str(folder)
