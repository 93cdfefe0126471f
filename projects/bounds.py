"""The [bounds] section: boxes of coefficients (Table 4.2), or of the moduli themselves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..identification.parameters import ModuliParameters
from .schema import FORMS, CommonFile

#: Smallest modulus allowed anywhere on the strain range (MPa), unless the file says otherwise.
DEFAULT_MARGIN_E, DEFAULT_MARGIN_G = 5.0, 0.5


def read_bounds(
    path: Path, file: CommonFile, moduli: str, ends: Sequence[float], modulus: float
) -> dict[str, Any]:
    """lower, upper, least, largest, margin_E, margin_G of a `FitProject`, MPa.

    Raises
    ------
    InputError : bounds that are crossed, too few or too many, or of both kinds.
    """
    bounds, margin = file.bounds, file.fit.margin
    ranges = {name: getattr(bounds, name) for name in ("E1", "E2", "G12")}
    listed = {name: getattr(bounds, name) for name in ("lower", "upper")}
    of_moduli = any(v is not None for v in ranges.values())
    if of_moduli and any(v is not None for v in listed.values()):
        problem = "expected either 'lower' and 'upper' or E1, E2, G12, got some of both"
        raise InputError(path, "bounds", problem)
    if not of_moduli and all(v is None for v in listed.values()):
        problem = "give [least, largest] of E1, E2 and G12, or 'lower' and 'upper' coefficients"
        raise InputError(path, "bounds", problem)
    wanted: dict[str, Any] = ranges if of_moduli else listed
    for name, value in wanted.items():
        if value is None:
            raise InputError(path, f"bounds.{name}", "this key is missing; add it")
    if not of_moduli:
        return {
            **_of_coefficients(path, file, moduli, modulus),
            "least": None,
            "largest": None,
            "margin_E": margin.E * modulus if margin else DEFAULT_MARGIN_E,
            "margin_G": margin.G12 * modulus if margin else DEFAULT_MARGIN_G,
        }
    if margin is not None:
        problem = "the lower bounds of E1, E2 and G12 are the margins; leave this out"
        raise InputError(path, "fit.margin", problem)
    for name, (low, high) in ranges.items():
        if not low < high:
            problem = f"expected [least, largest], got [{low:g}, {high:g}]"
            raise InputError(path, f"bounds.{name}", problem)
    least, largest = np.array(list(ranges.values())).T * modulus
    p = ModuliParameters.between(
        FORMS[moduli], ends, least, largest, breaks=np.eye(3, 2) if moduli == "trilinear" else None
    )
    return {
        "lower": p.lower,
        "upper": p.upper,
        "least": least,
        "largest": largest,
        "margin_E": p.margin_E,
        "margin_G": p.margin_G,
    }


def _of_coefficients(path: Path, file: CommonFile, moduli: str, modulus: float) -> dict[str, Any]:
    degree = FORMS[moduli]
    kind = f"of degree {degree}" if moduli != "trilinear" else "of three regions, the last first,"
    count = 3 * (degree + 1)
    lower, upper = file.bounds.lower or [], file.bounds.upper or []
    for name, values in (("lower", lower), ("upper", upper)):
        if len(values) != count:
            problem = f"expected {count} coefficients (3 moduli {kind} as G12, E2, E1), got "
            raise InputError(path, f"bounds.{name}", problem + str(len(values)))
    places = [4 * m + k for m in range(3) for k in range(3 - degree, 4)]
    for i, (low, high) in enumerate(zip(lower, upper, strict=True)):
        if low > high:
            problem = (
                f"bounds of beta_{places[i]} are crossed: lower {low:g} is above upper"
                f" {high:g} {file.units.modulus}"
            )
            raise InputError(path, f"bounds.lower[{i}]", problem)
    return {"lower": np.array(lower) * modulus, "upper": np.array(upper) * modulus}
