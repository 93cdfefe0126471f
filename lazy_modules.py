"""Heavy libraries that are imported when something of them is first used."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any


class LazyModule:
    """A heavy module that is imported when something of it is first used."""

    def __init__(self, name: str) -> None:
        self.module = name

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module(self.module), name)


if TYPE_CHECKING:
    import filelock as filelock
    import pandas as pandas
    import psutil as psutil
    from PIL import Image as Image
else:
    filelock = LazyModule("filelock")
    pandas = LazyModule("pandas")
    psutil = LazyModule("psutil")
    Image = LazyModule("PIL.Image")
