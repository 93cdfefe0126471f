"""The material card `material.toml`: read, write."""

from __future__ import annotations

import difflib
import math
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from ..errors import InputError
from ..writing import replacing
from .law import UNLIMITED, HypoelasticLaw

#: MPa per unit.
UNITS = {"GPa": 1000.0, "MPa": 1.0, "Pa": 1e-6}
DIRECTIONS = ("warp", "fill", "shear")


KEYS = (
    "name",
    "source",
    "law",
    "unit",
    "beta",
    "nu12",
    "thickness_mm",
    "thickness_change",
    "valid_strain",
    "breaks",
)
#: What the key `law` says; a tri-linear law has breaks.
TEXTS = {
    "polynomial": "hypoelastic orthotropic; tangent moduli of log strain; Cauchy stress",
    "trilinear": "hypoelastic orthotropic; tri-linear: tangent moduli constant in three regions of "
    "log strain; Cauchy stress",
}
HEADERS = {
    "polynomial": "# beta_0..3: G12 of |gamma12|, beta_4..7: E2 of eps2, beta_8..11: E1 of eps1, "
    "highest power first.\n# Outside valid_strain a modulus keeps its end value.\n",
    "trilinear": "# Moduli beyond the second break, between the breaks, up to the first:\n"
    "# beta_1..3: G12 of |gamma12|, beta_5..7: E2 of eps2, beta_9..11: E1 of eps1; the others "
    "are 0.\n# Outside valid_strain a modulus keeps its end value.\n",
}


@dataclass(frozen=True, eq=False)
class MaterialCard:
    """A law with the thickness it was fitted for (mm), a name, and where it came from."""

    law: HypoelasticLaw
    thickness: float
    name: str = ""
    source: str = ""


def write_card(card: MaterialCard, path: Path, unit: str = "GPa") -> None:
    """Write a card with its coefficients in `unit` ("GPa", "MPa" or "Pa")."""
    law, scale = card.law, UNITS[unit]
    ends = law.strain_range
    named = zip(DIRECTIONS, ends, strict=True)
    valid = {name: [0.0, float(end)] for name, end in named if end < UNLIMITED}
    content: dict[str, Any] = {
        "name": card.name,
        "source": card.source,
        "law": TEXTS[law.form],
        "unit": unit,
        "beta": [float(b) / scale for b in law.beta],
        "nu12": law.nu12,
        "thickness_mm": card.thickness,
        "thickness_change": law.thickness_change,
        "valid_strain": valid,
    }
    if law.breaks is not None:
        content["breaks"] = dict(zip(DIRECTIONS, law.breaks.tolist(), strict=True))
    with replacing(path) as temporary:
        temporary.write_text(HEADERS[law.form] + tomli_w.dumps(content), encoding="utf-8")


def read_card(path: Path) -> MaterialCard:
    """Read a card.

    Raises
    ------
    InputError : naming the file and the field: not TOML, a missing key, a unit that is not one
        of GPa, MPa, Pa, not twelve finite coefficients, a range that is not [0, end], breaks that
        are not [first, second], coefficients that a tri-linear law does not have.
    """
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:  # beside its own, tomllib lets these through
        raise InputError(path, "TOML syntax", str(error)) from None
    for key in content:
        if key not in KEYS:
            near = difflib.get_close_matches(key, KEYS, n=1, cutoff=0.5)
            meant = f"did you mean {near[0]!r}? " if near else ""
            raise InputError(path, key, f"unknown key; {meant}allowed: {', '.join(KEYS)}")
    unit = _get(path, content, "unit", str)
    if unit not in UNITS:
        raise InputError(path, "unit", f"expected one of {', '.join(UNITS)}, got {unit!r}")
    beta = _get(path, content, "beta", list)
    if len(beta) != 12:
        raise InputError(path, "beta", f"expected 12 coefficients, got {len(beta)}")
    if not all(_is_number(b) for b in beta):
        raise InputError(path, "beta", "expected finite numbers only")
    mpa = [b * UNITS[unit] for b in beta]
    if not all(map(math.isfinite, mpa)):
        raise InputError(path, "beta", f"{max(beta, key=abs):g} {unit} is too large a coefficient")
    valid = _get(path, content, "valid_strain", dict, {})
    _check_directions(path, "valid_strain", valid)
    ends = []
    for name in DIRECTIONS:
        limits = valid.get(name, [0.0, UNLIMITED])
        good = isinstance(limits, list) and len(limits) == 2 and all(map(_is_number, limits))
        if not good or limits[0] != 0 or not limits[1] > 0:
            raise InputError(path, f"valid_strain.{name}", f"expected [0, end], got {limits}")
        ends.append(float(limits[1]))
    thickness = _get(path, content, "thickness_mm", (int, float))
    if not _is_number(thickness) or not thickness > 0:
        raise InputError(path, "thickness_mm", f"expected > 0, got {thickness}")
    try:
        law = HypoelasticLaw(
            np.array(mpa, dtype=float),
            _get(path, content, "nu12", (int, float)),
            np.array(ends),
            _get(path, content, "thickness_change", str, "constant"),
            _breaks(path, content),
        )
    except InputError as error:
        raise InputError(path, error.field, error.problem) from None
    name = _get(path, content, "name", str, "")
    return MaterialCard(law, float(thickness), name, _get(path, content, "source", str, ""))


def _breaks(path: Path, content: dict[str, Any]) -> NDArray[np.float64] | None:
    text = _get(path, content, "law", str, "")
    if "breaks" not in content:
        if "tri-linear" in text:
            raise InputError(path, "breaks", "this key is missing; `law` says tri-linear")
        return None
    given = _get(path, content, "breaks", dict)
    _check_directions(path, "breaks", given)
    for name in DIRECTIONS:
        pair = given.get(name)
        good = isinstance(pair, list) and len(pair) == 2 and all(map(_is_number, pair))
        if not good or not 0 < pair[0] < pair[1]:
            problem = f"expected [first, second], 0 < first < second, got {pair}"
            raise InputError(path, f"breaks.{name}", problem)
    return np.array([given[name] for name in DIRECTIONS], dtype=float)


def _check_directions(path: Path, key: str, table: dict[str, Any]) -> None:
    for name in table:
        if name not in DIRECTIONS:
            problem = f"unknown direction; allowed: {', '.join(DIRECTIONS)}"
            raise InputError(path, f"{key}.{name}", problem)


def _is_number(value: Any) -> bool:
    # TOML integers have no largest; beyond a double they are no numbers to us.
    real = isinstance(value, (int, float)) and not isinstance(value, bool)
    return real and abs(value) <= sys.float_info.max


def _get(path: Path, content: dict[str, Any], key: str, kind: Any, default: Any = None) -> Any:
    value = content.get(key, default)
    if value is None:
        raise InputError(path, key, "this key is missing")
    if not isinstance(value, kind) or isinstance(value, bool):
        raise InputError(path, key, f"has the wrong type, got {value!r}")
    return value
