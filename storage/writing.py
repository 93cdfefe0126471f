"""Atomic writing of files, plain values for JSON, and the folders of the package and the cache."""

from __future__ import annotations

import errno
import json
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from ..errors import OutputError
from ..lazy_modules import pandas as pd
from ..lazy_modules import psutil


@contextmanager
def output_errors(path: Path | str) -> Iterator[None]:
    """Turn an OSError within the block into an OutputError about `path`."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: {unwritable_reason(error)} another --out") from error


def unwritable_reason(error: OSError) -> str:
    """Return why a file cannot be written, ending in "choose": the caller names an alternative."""
    is_full = error.errno in (errno.ENOSPC, errno.EDQUOT)
    advice = "free space or choose" if is_full else "choose"
    return f"cannot be written: {error.strerror or error}; {advice}"


@contextmanager
def replacing(path: Path | str) -> Iterator[Path]:
    """Yield a temporary path to write, which replaces `path` when the block ends without error.

    Raises
    ------
    OutputError
        The file cannot be written or replaced.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    with output_errors(path):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            yield temporary
            os.replace(temporary, path)
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def write_text(path: Path | str, text: str) -> None:
    """Write a text file atomically in UTF-8 and flush it to the disk.

    Characters that stand for undecodable bytes (surrogate escapes) are written as replacements.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    text = text.encode("utf-8", "surrogateescape").decode("utf-8", "replace")
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())


def remove_unfinished(folder: Path | str) -> None:
    """Remove temporary files of `replacing` in a folder whose processes do not run any more."""
    for path in Path(folder).glob(".*"):
        temporary = re.fullmatch(r"\..*\.(\d+)(\.[^.]*)?", path.name)
        if temporary is None or not path.is_file():
            continue
        with suppress(OverflowError):  # no number of a process
            if psutil.pid_exists(int(temporary[1])):
                continue
        with suppress(OSError):
            path.unlink()


#: Folder of the package, and that of its templates for input decks and pages.
ROOT = Path(__file__).resolve().parent.parent
TEMPLATES = ROOT / "templates"
PLAIN_TYPES = {str, int, bool, type(None)}


def cache_folder() -> Path:
    """Return $BUBBLEFIT_CACHE, else the user's cache folder of this system; it may not be there."""
    from platformdirs import user_cache_path

    named = os.environ.get("BUBBLEFIT_CACHE")
    return Path(named) if named else user_cache_path("bubblefit", appauthor=False)


def write_csv(table: pd.DataFrame, path: Path, digits: int | None = 9) -> None:
    """Write a table as CSV, its numbers with so many digits; None writes all."""
    if digits is not None:
        # pandas asks of each number whether it is missing, which takes four times as long.
        numbers = table.select_dtypes(["float64", "float32"])
        table = table.assign(**{str(name): _texts(numbers[name], digits) for name in numbers})
    table.to_csv(path, index=False, lineterminator="\n")


def _texts(numbers: pd.Series, digits: int) -> list[str]:
    """Return numbers as text; that of a missing one is empty."""
    return ["" if math.isnan(number) else f"{number:.{digits}g}" for number in numbers.tolist()]


def json_text(content: Any) -> str:
    """Return the text of a JSON file with a value; numbers that are not finite become null."""
    return json.dumps(plain_values(content), indent=1, allow_nan=False) + "\n"


def plain_values(value: Any) -> Any:
    """Convert dataclasses, arrays and mappings to plain values; a number not finite is None."""
    if type(value) in PLAIN_TYPES:  # most are: all that follows takes longer
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if is_dataclass(value):
        return {f.name: plain_values(getattr(value, f.name)) for f in fields(value)}
    if hasattr(value, "tolist"):
        return plain_values(value.tolist())
    if isinstance(value, Mapping):
        return {key: plain_values(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain_values(item) for item in value]
    return value if isinstance(value, int) else str(value)
