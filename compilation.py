"""Compilation of kernels by numba at their first call, and the cache of the compiled code."""

import hashlib
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from .storage.writing import ROOT, cache_folder
from .version import __version__

#: Every file with compiled functions. Their contents together name the folder of the cache: after
#: an edit of one file all kernels are compiled again, as they call each other.
KERNELS = (
    "materials/pieces.py",
    "materials/memory.py",
    "materials/point_law.py",
    "materials/wrinkles.py",
    "materials/law.py",
    "materials/biaxial_patch.py",
    "materials/admissibility.py",
    "meshes/closed_surfaces.py",
    "solvers/membrane/kernel.py",
    "solvers/membrane/nested_cholesky.py",
    "inference/noise.py",
    "inference/posterior.py",
)


@cache
def kernel_folder() -> Path | None:
    """Return the folder of the kernels compiled from exactly these sources; None if unwritable.

    A new one starts with the kernels that came with the installation, if any: numba takes those
    that were compiled by its own version for this processor, and compiles the others.
    """
    digest = hashlib.sha256(__version__.encode())
    for source in KERNELS:
        digest.update((ROOT / source).read_bytes())
    name = f"kernels-{digest.hexdigest()[:12]}"
    folder = cache_folder() / name
    if (ROOT / name).is_dir() and not folder.exists():
        import shutil

        # Another process may do the same: the folder appears under its name when it is complete.
        fresh = folder.with_name(f"{name}-{os.getpid()}")
        with suppress(OSError):
            shutil.copytree(ROOT / name, fresh)
            fresh.rename(folder)
        shutil.rmtree(fresh, ignore_errors=True)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK | os.X_OK) else None


def kernels_are_compiled() -> bool:
    """Return whether the cache has kernels of these sources; if not, a run compiles them first."""
    folder = kernel_folder()
    return folder is not None and next(folder.rglob("*.nbc"), None) is not None


class Compiled:
    """A function that numba compiles, or loads from the cache, at its first call.

    Compiled functions that it calls are compiled with it.
    """

    def __init__(self, function: Any, options: Mapping[str, Any]) -> None:
        self.function = function
        self.options = options

    def __call__(self, *arguments: Any) -> Any:
        return self.dispatcher(*arguments)

    @cached_property
    def dispatcher(self) -> Any:
        """Return numba's function, which takes its place in the module from now on."""
        import numba

        names = self.function.__globals__
        for name in self.function.__code__.co_names:
            callee = names.get(name)
            if isinstance(callee, Compiled):
                names[name] = callee.dispatcher
        dispatcher = numba.njit(**self.options)(self.function)
        if folder := kernel_folder():
            with suppress(AttributeError):  # another numba, without these classes: not cached
                dispatcher._cache = _kernel_cache(folder)(self.function)
        names[self.function.__name__] = dispatcher
        return dispatcher


@cache
def _kernel_cache(folder: Path) -> Any:
    """Return numba's cache of functions with its files in a folder, wherever the sources lie.

    Numba's own `cache=True` looks only at the file in which a function stands: after an edit of a
    function that it calls in another file, code compiled from the old one is still loaded.
    """
    from numba.core import caching

    class Locator(caching._CacheLocator):
        def __init__(self, function: Any, file: str) -> None:
            self.line = str(function.__code__.co_firstlineno)
            self._py_file = file

        def get_cache_path(self) -> str:
            return str(folder)

        def get_source_stamp(self) -> str:
            return folder.name

        def get_disambiguator(self) -> str:
            return self.line

        @classmethod
        def from_function(cls, function: Any, file: str) -> Any:
            return cls(function, file)

    # Attributes are given to `type`: numba has changed the types that it declares for them.
    results = type("Results", (caching.CompileResultCacheImpl,), {"_locator_classes": [Locator]})
    return type("Cache", (caching.FunctionCache,), {"_impl_class": results})


def compiled(internal: bool = False, **options: Any) -> Callable[[Any], Any]:
    """Return a decorator: `numba.njit`, cached where a folder can be written, loaded when called.

    Parameters
    ----------
    internal : bool
        For functions that make no array and are called from compiled ones only (as numba's own
        sorting): references to arrays of their arguments are not counted, which takes half of the
        time of an integration point, and no way from Python is compiled.
    **options
        Of `numba.njit`; _nrt=False for a function that makes no array and is called from compiled
        ones and from Python: references are not counted either.
    """
    # All options are given, as numba would otherwise take those of the function that calls it.
    # "_nrt": numba's run time, which counts references to arrays; no_cpython_wrapper: not callable
    # from Python.
    fixed = {"_nrt": not internal, "no_cpython_wrapper": internal, "no_cfunc_wrapper": True}
    options = fixed | options
    return lambda function: Compiled(function, options)
