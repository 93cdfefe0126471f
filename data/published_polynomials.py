"""Load polynomials as published: Table 3.1 of the thesis and the 2017 paper's coefficients."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from .load_polynomials import LoadPolynomial
from .registry import read_file


@dataclass(frozen=True, eq=False)
class PublishedPolynomial:
    """One direction's load over gauge elongation.

    direction : warp, fill or bias. gauge_length, final_length : mm, of the virtual strain gauge
    before the test and at its end. polynomial : its end is final - gauge length; R^2, RMSE and
    points are not in the file. scatter : N, standard deviation of the specimens about it, NaN
    where the file has none.
    """

    direction: str
    gauge_length: float
    final_length: float
    polynomial: LoadPolynomial
    scatter: float


def read_published_polynomials(
    path: Path | str, format: str | None = None
) -> dict[str, PublishedPolynomial]:
    """Read load polynomials by direction: N, of the full strip, over mm.

    Parameters
    ----------
    format : name of the file's format; found by its content unless given.

    Raises
    ------
    InputError : naming file, line and column.
    """
    polynomials: dict[str, PublishedPolynomial] = read_file("load polynomials", path, format)
    return polynomials
