"""The law of a fit: its form over the strains that the tests reach, and its bounds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..experiments.base import Reach
from ..experiments.notes import STRAINS
from ..identification.unknowns import LawBounds
from ..materials.forms.base import Form
from ..materials.forms.registry import form_named, form_settings, of_strain
from ..materials.law import HypoelasticLaw
from .project import Project
from .schema import BoundsSection

#: Smallest modulus allowed anywhere on the strain range (MPa), unless the file says otherwise.
MARGIN_E, MARGIN_G = 5.0, 0.5
#: End of the strain range of moduli that do not depend on strain: nothing is held there.
UNBOUNDED_RANGE = 1.0
#: Shares of the strain range between the regions of a law, where no test tells.
THIRDS = (1 / 3, 2 / 3)


def law_of(project: Project, reaches: Sequence[Reach]) -> HypoelasticLaw:
    """The law that a fit starts from: everything but its coefficients, which are zero.

    reaches : what the data of each test say of the law.

    Raises
    ------
    InputError : no such form, a setting that it does not know, no strain range that follows from
        the tests.
    """
    section, path = project.law, project.path
    ends = _strain_range(project, reaches)
    try:
        form = form_named(section.form, _form_settings(project, reaches, ends), ends)
    except InputError as error:
        field = f"law.{error.field}" if error.field else "law.form"
        raise InputError(path, field, error.problem) from None
    return HypoelasticLaw(
        np.zeros(form.size),
        section.nu12,
        np.array(ends),
        project.fabric.thickness_change,
        form,
    )


def _form_settings(
    project: Project, reaches: Sequence[Reach], ends: Sequence[float]
) -> dict[str, Any]:
    """What [law] says to its form; breaks from the tests' data where it needs and has none."""
    settings = dict(project.law.model_extra or {})
    if "breaks" in settings or "breaks" not in form_settings(project.law.form):
        return settings
    breaks = {}
    for i, name in enumerate(STRAINS):
        said = [pair for reach in reaches if (pair := reach.break_shares[i]) is not None]
        breaks[name] = [ends[i] * share for share in (said or [THIRDS])[0]]
    return {**settings, "breaks": breaks}


def _strain_range(project: Project, reaches: Sequence[Reach]) -> tuple[float, float, float]:
    given = project.law.strain_range
    if given is not None:
        return given[0], given[1], given[2]
    ends: list[float] = []
    for i, name in enumerate(STRAINS):
        known = [e for reach in reaches if (e := reach.strain[i]) is not None]
        if known:
            ends.append(max(known))
        elif not of_strain(project.law.form):
            ends.append(UNBOUNDED_RANGE)
        else:
            problem = (
                f"this key is missing, and no test tells how far the {name} strain goes; give the "
                "ends [warp, fill, shear], such as [0.13, 0.13, 0.13]"
            )
            raise InputError(project.path, "law.strain_range", problem)
    return ends[0], ends[1], ends[2]


def bounds_of(project: Project, form: Form) -> LawBounds:
    """Between what the moduli, or their coefficients, are looked for; MPa.

    Raises
    ------
    InputError : no bounds, crossed ones, too few or too many, or some of both kinds.
    """
    path, section, margin = project.path, project.law.bounds, project.law.margin
    unit = project.scales.modulus
    if section is None:
        problem = "this section is missing; give [least, largest] of E1, E2 and G12"
        raise InputError(path, "law.bounds", problem)
    of_moduli = _of_one_kind(project, section)
    if of_moduli and margin is not None:
        problem = "the lower bounds of E1, E2 and G12 are the margins; leave this out"
        raise InputError(path, "law.margin", problem)
    if of_moduli:
        return LawBounds.of_moduli(
            {name: _ordered(project, name, getattr(section, name)) for name in ("E1", "E2", "G12")}
        )
    lower, upper = (_listed(project, form, name) for name in ("lower", "upper"))
    for i, (place, low, high) in enumerate(zip(form.free, lower, upper, strict=True)):
        if low > high:
            problem = (
                f"bounds of {form.labels[place]} are crossed: lower {low:g} is above upper "
                f"{high:g} {project.scales.modulus_unit}"
            )
            raise InputError(path, f"law.bounds.lower[{i}]", problem)
    e, g = (margin.E * unit, margin.G12 * unit) if margin else (MARGIN_E, MARGIN_G)
    margins = {"E1": e, "E2": e, "G12": g}
    return LawBounds.of_entries(np.array(lower) * unit, np.array(upper) * unit, margins)


def _of_one_kind(project: Project, section: BoundsSection) -> bool:
    """Whether the moduli are bounded, not their coefficients."""
    ranges = {name: getattr(section, name) for name in ("E1", "E2", "G12")}
    listed = {name: getattr(section, name) for name in ("lower", "upper")}
    of_moduli = any(v is not None for v in ranges.values())
    of_entries = any(v is not None for v in listed.values())
    if of_moduli and of_entries:
        problem = "expected either 'lower' and 'upper' or E1, E2, G12, got some of both"
        raise InputError(project.path, "law.bounds", problem)
    if not of_moduli and not of_entries:
        problem = "give [least, largest] of E1, E2 and G12, or 'lower' and 'upper' coefficients"
        raise InputError(project.path, "law.bounds", problem)
    for name, value in (ranges if of_moduli else listed).items():
        if value is None:
            raise InputError(project.path, f"law.bounds.{name}", "this key is missing; add it")
    return of_moduli


def _ordered(project: Project, name: str, pair: Sequence[float]) -> tuple[float, float]:
    low, high = pair
    if not low < high:
        problem = f"expected [least, largest], got [{low:g}, {high:g}]"
        raise InputError(project.path, f"law.bounds.{name}", problem)
    return low * project.scales.modulus, high * project.scales.modulus


def _listed(project: Project, form: Form, name: str) -> list[float]:
    assert project.law.bounds is not None
    values: list[float] = getattr(project.law.bounds, name)
    if len(values) != len(form.free):
        problem = (
            f"expected {len(form.free)} coefficients of {form.name} moduli "
            f"({', '.join(form.labels[i] for i in form.free)}), got {len(values)}"
        )
        raise InputError(project.path, f"law.bounds.{name}", problem)
    return values
