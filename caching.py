"""Caches of what bubblefit compiled: kernels here, material libraries and ccx elsewhere."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from platformdirs import user_cache_path

SETTINGS: Any = numba.config
ROOT = Path(__file__).parent
#: Everything that compiled functions call: an edit of one must reach the compiled code of all,
#: while numba's own cache looks only at the file a function stands in.
KERNELS = (
    "materials/point_law.py",
    "materials/wrinkles.py",
    "materials/law.py",
    "materials/responses.py",
    "meshes/mesh.py",
    "solvers/membrane/kernel.py",
    "solvers/membrane/sensitivity.py",
)


def cache_folder() -> Path:
    """Return $BUBBLEFIT_CACHE, else the user's cache folder of this system; it may not exist yet.

    On Linux that is bubblefit/ in $XDG_CACHE_HOME or ~/.cache.
    """
    named = os.environ.get("BUBBLEFIT_CACHE")
    return Path(named) if named else user_cache_path("bubblefit", appauthor=False)


@cache
def _kernel_folder() -> Path | None:
    """Folder of the compiled kernels of exactly these sources; None where none can be written."""
    digest = hashlib.sha256()
    for name in KERNELS:
        digest.update((ROOT / name).read_bytes())
    folder = cache_folder() / f"kernels-{digest.hexdigest()[:12]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK | os.X_OK) else None


def kernels_are_compiled() -> bool:
    """Return whether compiled kernels of these sources are kept; else a run compiles first.

    Where no folder can be written they are compiled every time.
    """
    folder = _kernel_folder()
    return folder is not None and next(folder.rglob("*.nbc"), None) is not None


def compiled(**options: Any) -> Callable[[Any], Any]:
    """`numba.njit(**options)`, cached where a folder can be written, else compiled every time."""

    def decorate(function: Any) -> Any:
        folder = _kernel_folder()
        if folder is None:
            return numba.njit(**options)(function)
        # numba reads this setting once, here; other packages' functions keep their own.
        before = SETTINGS.CACHE_DIR
        SETTINGS.CACHE_DIR = str(folder)
        try:
            return numba.njit(cache=True, **options)(function)
        finally:
            SETTINGS.CACHE_DIR = before

    return decorate
