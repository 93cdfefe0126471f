"""What the project of every fit has: material, bounds, fit, solver; in mm, N, MPa."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from ..errors import InputError
from .bounds import read_bounds
from .schema import (
    FORMS,
    MODULUS_UNITS,
    CalculixSection,
    CommonFile,
    Form,
    Section,
    SolverSection,
)
from .schema_errors import first_error

Array = NDArray[np.float64]
File = TypeVar("File", bound=Section)

#: Most analyses of one start, unless the file says otherwise.
DEFAULT_ANALYSES = {"lm": 100, "slsqp": 500, "cobyla": 2000}
#: End of the strain range of constant moduli: nothing is held there.
CONSTANT_RANGE = 1.0
POLYNOMIALS = ("constant", "linear", "quadratic", "cubic")


@dataclass(frozen=True, eq=False, kw_only=True)
class FitProject:
    """What every fit is asked to do. Lengths mm, loads N, pressures and moduli MPa.

    `moduli` : "constant" to "cubic", or "trilinear" with its `breaks` (3, 2) strains
    (eps1, eps2, gamma12). `lower`, `upper` : bounds in the order of Table 4.2 (G12, E2, E1,
    highest power first); `least`, `largest` (3,) E1, E2, G12 where the file bounds the moduli.
    `strain_range` : ends (eps1, eps2, gamma12). `margin_E`, `margin_G` : smallest modulus allowed
    on that range. `solver_options` : by name of a solver, what its constructor is given.
    `modulus_unit`, `modulus_scale` : unit of the file and MPa per unit, for output in kind.

    Raises
    ------
    InputError : settings that contradict each other (also after `dataclasses.replace`).
    """

    path: Path
    title: str
    nu12: float
    thickness: float
    thickness_change: Literal["constant", "incompressible"]
    moduli: Form
    breaks: Array | None
    strain_range: tuple[float, float, float]
    lower: Array
    upper: Array
    least: Array | None
    largest: Array | None
    margin_E: float
    margin_G: float
    starts: int
    seed: int
    method: str
    gradient: Literal["exact", "differences"]
    constraints: Literal["margin", "boolean"]
    solver: str
    analyses_given: int | None
    tolerance: float
    modulus_unit: str
    modulus_scale: float
    solver_options: Mapping[str, Mapping[str, Any]]

    def __post_init__(self) -> None:
        if self.method == "lm" and self.constraints == "boolean":
            problem = "boolean flags have no slope: use 'margin' with method 'lm', or 'slsqp'"
            raise InputError(self.path, "fit.constraints", problem + " or 'cobyla'")

    @property
    def degree(self) -> int:
        """Coefficients a modulus, less one."""
        return FORMS[self.moduli]

    @property
    def max_analyses(self) -> int:
        """Most analyses of one start; the method's own default unless the file names it."""
        return self.analyses_given or DEFAULT_ANALYSES[self.method]

    @property
    def free(self) -> tuple[int, ...]:
        """Place of each fitted coefficient in the full beta (12,)."""
        return tuple(4 * m + k for m in range(3) for k in range(3 - self.degree, 4))

    def full_beta(self, coefficients: Array) -> Array:
        """Fitted coefficients (3 (degree + 1),) as the full beta (12,), zeros elsewhere."""
        beta = np.zeros(12)
        beta[list(self.free)] = coefficients
        return beta


def parse(path: Path, kinds: Mapping[str, type[File]]) -> File:
    """Parse a project file whose `project.kind` is one of `kinds`.

    Raises
    ------
    InputError : one line naming the file and the dotted key: TOML syntax, another kind, missing
        or unknown keys, values that cannot be meant.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        problem = "no such file; `bubblefit init DIR` writes an example to start from"
        raise InputError(path, "", problem) from None
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(path, "", "is not a text file in UTF-8") from None
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(path, "TOML syntax", str(error)) from None
    section = content.get("project")
    kind = section.get("kind") if isinstance(section, dict) else None
    if kind is not None and kind not in list(kinds):  # a list: what is not text has no hash
        known = " or ".join(repr(k) for k in kinds)
        other = kind in ["bubble", "uniaxial", "joint", "bend"]
        advice = f"; run `bubblefit {kind}`" if other else ""
        raise InputError(path, "project.kind", f"expected {known}, got {kind!r}{advice}")
    file = kinds.get(kind) if isinstance(kind, str) else None
    file = file or next(iter(kinds.values()))
    try:
        return file.model_validate(content)
    except ValidationError as found:
        raise first_error(path, found, file) from None


def common_settings(
    path: Path,
    file: CommonFile,
    default_range: tuple[float, float, float] | None = None,
    default_breaks: Callable[[tuple[float, float, float]], Array] | None = None,
) -> dict[str, Any]:
    """The fields of `FitProject` (all but the thickness) from a file.

    default_range : strain range where the file gives none. default_breaks : breaks of a
    tri-linear law where the file gives none, from its strain range; thirds of it unless given.
    """
    fit, material = file.fit, file.material
    modulus = MODULUS_UNITS[file.units.modulus]
    moduli = _form(path, file)
    ends = _strain_range(path, file, moduli, default_range)
    return {
        "path": path,
        "title": file.project.title or path.parent.resolve().name,
        "nu12": material.nu12,
        "thickness_change": material.thickness_change,
        "moduli": moduli,
        "breaks": _breaks(path, file, moduli, ends, default_breaks or _thirds),
        "strain_range": ends,
        **read_bounds(path, file, moduli, ends, modulus),
        "starts": fit.starts,
        "seed": fit.seed,
        "method": fit.method,
        "gradient": fit.gradient,
        "constraints": fit.constraints,
        "solver": fit.solver,
        "analyses_given": fit.max_analyses,
        "tolerance": fit.tolerance,
        "modulus_unit": file.units.modulus,
        "modulus_scale": modulus,
        "solver_options": solver_options(path, file.solver),
    }


def _form(path: Path, file: CommonFile) -> str:
    material = file.material
    if material.moduli is not None and material.degree is not None:
        raise InputError(path, "material.degree", "is given by material.moduli; leave one out")
    if material.moduli is not None:
        return material.moduli
    return POLYNOMIALS[3 if material.degree is None else material.degree]


def _strain_range(
    path: Path, file: CommonFile, moduli: str, default: tuple[float, float, float] | None
) -> tuple[float, float, float]:
    ends = file.material.strain_range
    if ends is not None:
        return ends[0], ends[1], ends[2]
    if default is not None:
        return default
    if moduli != "constant":
        problem = (
            "this key is missing; give the ends [warp, fill, shear], such as [0.13, 0.13, 0.13]"
        )
        raise InputError(path, "material.strain_range", problem)
    return (CONSTANT_RANGE,) * 3


def _breaks(
    path: Path,
    file: CommonFile,
    moduli: str,
    ends: tuple[float, float, float],
    default: Callable[[tuple[float, float, float]], Array],
) -> Array | None:
    given = file.material.breaks
    if moduli != "trilinear":
        if given is not None:
            problem = f"only a trilinear law has breaks, not {moduli} moduli; leave this out"
            raise InputError(path, "material.breaks", problem)
        return None
    if given is None:
        return default(ends)
    breaks = np.array([given.warp, given.fill, given.shear])
    for name, (first, second), end in zip(("warp", "fill", "shear"), breaks, ends, strict=True):
        if not first < second < end:
            problem = f"expected increasing strains below the end of the range, {end:g}"
            raise InputError(path, f"material.breaks.{name}", problem)
    return breaks


def _thirds(ends: tuple[float, float, float]) -> Array:
    return np.outer(ends, [1 / 3, 2 / 3])


def solver_options(path: Path, section: SolverSection) -> dict[str, dict[str, Any]]:
    """By name of a solver, what its constructor is given; those that plug in among them."""
    return {
        "membrane": section.membrane.model_dump(),
        "calculix": _calculix(path, section.calculix),
        # "marc" itself comes from the command line only.
        "marc": {"marc": None, **section.marc.given(path.parent)},
        **(section.model_extra or {}),
    }


def _calculix(path: Path, section: CalculixSection) -> dict[str, Any]:
    """Options of CalculixSolver; paths in a project file are beside that file."""
    options = section.model_dump()
    for name in ("templates", "scratch"):
        if options[name] is not None:
            options[name] = path.parent / os.path.expanduser(options[name])
    # A bare name is a program on the PATH.
    if options["ccx"] is not None and os.sep in options["ccx"]:
        options["ccx"] = path.parent / os.path.expanduser(options["ccx"])
    return options
