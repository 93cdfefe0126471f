"""Loads and strains of a biaxial test, of a file or in memory."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .frames import Array, FrameSource


@dataclass(frozen=True, eq=False)
class BiaxialTable:
    """Readings of a cruciform loaded along both yarns.

    Attributes
    ----------
    path : Path or None
        File; None of arrays.
    load : (n, 2) array, N/mm
        Along warp and fill.
    strain : (n, 2) array
        Shares, along warp and fill.
    ratio : tuple of n str or None
        Ratio of loads of each reading.
    lines : (n,) array of int
        Lines of the file.
    source : FrameSource
        What was read.
    time : (n,) array, s, or None
    argument : str
        What errors name where there is no file.
    name : str
        Name in tables, that of the file.
    """

    path: Path | None
    load: Array
    strain: Array
    ratio: tuple[str, ...] | None
    lines: NDArray[np.intp]
    source: FrameSource
    time: Array | None = None
    argument: str = ""
    name: str = ""
