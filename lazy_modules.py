"""Modules that are imported when something of them is first used."""

import gc
import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from .light_dataclasses import dataclass


def import_quickly(name: str) -> ModuleType:
    """Import a module as `import_module` does, with no search for garbage among what it makes."""
    if name in sys.modules:
        return import_module(name)
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        return import_module(name)
    finally:
        # What there is becomes old: the next quick search, of the young, does not look through it.
        if not gc.get_freeze_count():
            gc.freeze()
            gc.unfreeze()
        if was_enabled:
            gc.enable()


class LazyModule:
    """A heavy module that is imported when something of it is first used."""

    def __init__(self, name: str) -> None:
        self.module = name

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module(self.module), name)


@dataclass(frozen=True)
class LazyFunction:
    """A function whose module is imported when it is first called."""

    module: str
    name: str

    def __call__(self, *arguments: Any) -> Any:
        return getattr(import_module(self.module), self.name)(*arguments)


if TYPE_CHECKING:
    import filelock as filelock
    import pandas as pandas
    import psutil as psutil
    import rich.console as rich_console
    import rich.progress as rich_progress
    from PIL import Image as Image
else:
    filelock = LazyModule("filelock")
    pandas = LazyModule("pandas")
    psutil = LazyModule("psutil")
    rich_console = LazyModule("rich.console")
    rich_progress = LazyModule("rich.progress")
    Image = LazyModule("PIL.Image")
