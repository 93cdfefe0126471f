"""Curves, bands and measured points as data: what a chart of the page is drawn from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

Numbers = Sequence[float | None]

#: Digits of what a chart is drawn from.
DIGITS = 6
#: Measured points that are drawn of one series; of more, every second, third ... is.
MOST_POINTS = 400


@dataclass(frozen=True)
class Series:
    """One curve, band or cloud of points of a chart.

    Parameters
    ----------
    name : in the legend, "" for none.
    x, y : (n,) in the units of the axes; None where there is no value.
    lower, upper : (n,) ends of a band about the curve; empty for none.
    look : line, dots, or nothing but the band.
    colour : number of the named colour; rank : 0 to 1 along the colours of rising loads instead.
    dashes : number of the pattern, 0 for none. ends : whether a dot ends the curve: nothing is
    known further on. faint : what stands behind the others. marks : whether every value of a line
    has a dot.
    """

    name: str
    x: Numbers
    y: Numbers = ()
    lower: Numbers = ()
    upper: Numbers = ()
    look: Literal["line", "dots", "band"] = "line"
    colour: int = 0
    rank: float | None = None
    dashes: int = 0
    ends: bool = False
    faint: bool = False
    marks: bool = False


@dataclass(frozen=True)
class Chart:
    """One pair of axes. Labels have their units; alt says in words what there is to see.

    from_zero : whether the y axis begins at zero. top : of the y axis, where a band may be as wide
    as it likes; None for that of everything drawn. level : a line across, at this y.
    x_names : what stands at x = 1, 2, ... instead of numbers.
    """

    title: str
    x_label: str
    y_label: str
    series: Sequence[Series]
    alt: str = ""
    log_y: bool = False
    from_zero: bool = False
    top: float | None = None
    level: float | None = None
    log_x: bool = False
    x_names: Sequence[str] = ()


@dataclass(frozen=True)
class Charts:
    """Charts that belong together, side by side where there is room, with one caption."""

    name: str
    charts: Sequence[Chart]
    caption: str
    part: Literal["charts"] = "charts"


def numbers(values: ArrayLike) -> list[float | None]:
    """(n,) as plain numbers of `DIGITS` digits; None for what is not finite."""
    flat = np.asarray(values, dtype=float).ravel().tolist()
    return [float(f"{v:.{DIGITS}g}") if isfinite(v) else None for v in flat]


def line(
    name: str,
    x: ArrayLike,
    y: ArrayLike,
    band: tuple[ArrayLike, ArrayLike] | None = None,
    colour: int = 0,
    rank: float | None = None,
    dashes: int = 0,
    ends: bool = False,
    faint: bool = False,
    marks: bool = False,
) -> Series:
    """A curve of arrays (n,), with its band where there is one."""
    lower, upper = ([], []) if band is None else (numbers(band[0]), numbers(band[1]))
    return Series(
        name, numbers(x), numbers(y), lower, upper, "line", colour, rank, dashes, ends, faint, marks
    )


def dots(
    name: str, x: ArrayLike, y: ArrayLike, colour: int = 0, rank: float | None = None
) -> Series:
    """Points of arrays (n,); where there are very many, every second, third ... of them."""
    count = max(1, -(-len(np.ravel(np.asarray(x))) // MOST_POINTS))
    return Series(
        name, numbers(x)[::count], numbers(y)[::count], look="dots", colour=colour, rank=rank
    )
