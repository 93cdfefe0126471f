"""Readers of result files that meshio is given when somebody imports it.

`meshio.read("job.frd")` works in whoever imports us, who waits neither for meshio nor for a reader.
"""

import sys
from collections.abc import Callable
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..lazy_modules import LazyFunction


class _MeshioReader(MetaPathFinder):
    """Gives meshio a reader of a file's suffix, now or right after it is imported."""

    def __init__(self, suffix: str, read: Callable[..., Any]) -> None:
        self.suffix = suffix
        self.read = read
        if "meshio" in sys.modules:
            self._register(sys.modules["meshio"])
        else:
            sys.meta_path.insert(0, self)

    def _register(self, module: Any) -> None:
        module.register_format(self.suffix, [f".{self.suffix}"], self.read, {})

    def find_spec(self, name: str, *_: Any) -> ModuleSpec | None:
        """Return the module meshio, which registers the reader as soon as it is loaded."""
        if name != "meshio":
            return None
        sys.meta_path.remove(self)
        spec = find_spec(name)
        if spec is not None and spec.loader is not None:
            loader: Any = spec.loader
            load = loader.exec_module

            def exec_module(module: Any) -> None:
                load(module)
                self._register(module)

            loader.exec_module = exec_module
        return spec


def register_with_meshio(suffix: str, read: Callable[[Path | str], Any]) -> None:
    """Let `meshio.read` read files of this suffix."""
    _MeshioReader(suffix, read)


register_with_meshio("frd", LazyFunction("bubblefit.solvers.calculix.frd", "read_last_frame"))
register_with_meshio("t19", LazyFunction("bubblefit.solvers.marc.t19", "read_last_frame"))
