"""The table of loads and strains of a biaxial test, from a file or from arrays in memory."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..light_dataclasses import dataclass
from .frames import Array, FrameSource


@dataclass(frozen=True, eq=False)
class BiaxialTable:
    """Readings of a cruciform loaded along both yarns.

    Attributes
    ----------
    path : Path or None
        File of the readings; None if they were given as arrays.
    load : (n, 2) array, N/mm
        Loads per width along warp and fill.
    strain : (n, 2) array
        Strains along warp and fill (0.01 is 1 %).
    ratio : tuple of n str or None
        Load ratio warp:fill of each reading, such as "2:1", where it is stated.
    lines : (n,) array of int
        Line of the file of each reading.
    source : FrameSource
        Format, columns and units that were read.
    time : (n,) array, s, or None
        Time of each reading.
    argument : str
        Argument that error messages name where there is no file.
    name : str
        Name of the table in results: that of the file.
    partner : BiaxialTable or None
        Table of the readings along the fill, where they are in a file of their own.
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
    partner: BiaxialTable | None = None
