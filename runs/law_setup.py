"""Setup of a fit's law from the project: form, bounds, memory, and unknowns of all tests."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..experiments.base import Reach
from ..experiments.forward import STRAINS
from ..inference.nuisance import Nuisance
from ..inference.unknowns import LawBounds
from ..materials.forms.base import (
    SHEAR,
    LawForm,
    checked_offer,
    form_named,
    form_settings,
    of_strain,
)
from ..materials.forms.spline import Form
from ..materials.forms.symmetry import MODULI, pooled_strains, symmetric
from ..materials.law import HypoelasticLaw
from ..materials.memory import QUANTITIES, Memory
from ..project.project import Project
from ..project.schema import RecalledSection, UnknownSection

#: Smallest modulus allowed anywhere on the strain range (MPa), unless the file says otherwise.
DEFAULT_MARGIN_E = 5.0
DEFAULT_MARGIN_G = 0.5
#: End of the strain range of moduli that do not depend on strain: nothing is held there.
UNBOUNDED_RANGE = 1.0
#: Shares of the strain range between the regions of a law, unless tests give them.
THIRDS = (1 / 3, 2 / 3)
#: Default bounds; those of the thickness in shares of the fabric's.
NU12_BOUNDS = (0.0, 0.6)
THICKNESS_BOUNDS = (0.5, 1.5)
#: Why data leave an unknown open: the thickness also if incompressible, as its load is moduli times
#: thickness times a function of strain.
PRODUCT = "a membrane under load knows moduli times thickness only"
UNLOADED = "cycles to several peaks, unloaded to low loads, would tell it"
#: Constants (`QUANTITIES`) of a strain without memory; where the fit of a memory begins ...
NO_MEMORY = (0.0, 1.0, 1.0, 0.0)
MEMORY_START = (0.3, 1.4, 1.15, 1.0)
#: ... and its bounds, the saturation's per unit of strain.
MEMORY_BOUNDS = {
    "set": (0.0, 0.99),
    "unloading": (1.0, 1.99),
    "reloading": (1.0, 1.99),
    "saturation": (0.0, 1e3),
}


def law_of(project: Project, reaches: Sequence[Reach]) -> HypoelasticLaw:
    """Return the law of a fit, whose coefficients are still zero.

    Parameters
    ----------
    project : Project
    reaches : sequence of Reach
        Strains that the data of each test reach.

    Raises
    ------
    InputError
        The form or a setting is unknown, or no strain range follows from the tests.
    """
    section = project.law
    path = project.path
    if project.form is None:
        try:
            checked_offer(section.form)
        except InputError as error:
            raise InputError(path, "law.form", error.problem) from None
    ends = _strain_range(project, reaches)
    try:
        form = _form_of(project, reaches, ends)
    except InputError as error:
        key = f"law.{error.field}" if error.field else "law.form"
        raise InputError(path, key, error.problem) from None
    change = project.fabric.thickness_change
    return HypoelasticLaw(
        np.zeros(form.size), section.nu12, np.array(ends), change, form, _memory(project)
    )


def _form_of(project: Project, reaches: Sequence[Reach], ends: Sequence[float]) -> LawForm:
    """Return the form of the moduli, of an object or by its name, with its symmetry; InputError."""
    form: LawForm
    if isinstance(project.form, Form):
        form = project.form.pieces(ends)
    elif project.form is not None:
        form = project.form
    else:
        form = form_named(project.law.form, _form_settings(project, reaches, ends), ends)
    return symmetric(form, project.law.symmetry, project.law.nu12)


def _form_settings(
    project: Project, reaches: Sequence[Reach], ends: Sequence[float]
) -> dict[str, Any]:
    """Return the settings of the form; breaks from the tests' data if it needs and has none."""
    settings = dict(project.law.model_extra or {})
    if "breaks" in settings or "breaks" not in form_settings(project.law.form):
        return settings
    breaks = {}
    for component, name in enumerate(STRAINS):
        measured = [reach.break_shares[component] for reach in reaches]
        shares = next((pair for pair in measured if pair is not None), THIRDS)
        breaks[name] = [ends[component] * share for share in shares]
    return {**settings, "breaks": breaks}


def _strain_range(project: Project, reaches: Sequence[Reach]) -> tuple[float, float, float]:
    """Return the ends of the strain range: the project's, or what the tests reach."""
    law = project.law
    if law.strain_range is not None:
        strains = [[end] for end in law.strain_range]
    else:
        by_component = zip(*(reach.strain for reach in reaches), strict=True)
        strains = [[end for end in ends if end is not None] for ends in by_component]
    ends = []
    pooled = pooled_strains(strains, law.symmetry, law.nu12)
    for name, reached in zip(STRAINS, pooled, strict=True):
        if reached:
            ends.append(max(reached))
        elif not _depends_on_strain(project):
            ends.append(UNBOUNDED_RANGE)
        else:
            problem = (
                f"this key is missing, and no test tells how far the {name} strain goes; give the "
                "ends [warp, fill, shear], such as [0.13, 0.13, 0.13]"
            )
            raise InputError(project.path, "law.strain_range", problem)
    return ends[0], ends[1], ends[2]


def _depends_on_strain(project: Project) -> bool:
    """Return whether the moduli depend on strain."""
    if isinstance(project.form, Form):
        return project.form.of_strain
    return of_strain(project.law.form)


def _memory(project: Project) -> Memory | None:
    """Return the memory of [law.memory], what is fitted at its start."""
    section = project.law.memory
    if section is None:
        return None
    constants: list[float] = []
    for recalled in section.by_strain.values():
        constants += _memory_constants(recalled)
    try:
        return Memory.of(constants)
    except InputError as error:
        raise InputError(project.path, f"law.{error.field}", error.problem) from None


def _memory_constants(recalled: RecalledSection | str | None) -> tuple[float, ...]:
    """Return the constants of one strain, where a fit of them begins."""
    if recalled is None:
        return NO_MEMORY
    if isinstance(recalled, RecalledSection):
        return tuple(recalled.model_dump().values())
    return MEMORY_START


# Bounds -----------------------------------------------------------------------------------------


def bounds_of(project: Project, form: LawForm) -> LawBounds:
    """Return the bounds of the moduli or of their coefficients, MPa.

    Raises
    ------
    InputError
        Bounds are missing, crossed, too few or too many.
    """
    section = project.law.bounds
    if not form.size:
        return LawBounds({}, None, np.empty(0), np.empty(0))
    if section is None:
        problem = "this section is missing; give [least, largest] of E1, E2 and G12"
        raise InputError(project.path, "law.bounds", problem)
    if section.has_moduli:
        unit = project.scales.modulus
        pairs = _complete(project, _with_moduli_of_symmetry(project, section.of_moduli))
        return LawBounds.of_moduli({name: (a * unit, b * unit) for name, (a, b) in pairs.items()})
    if section.lower is None and section.upper is None:
        problem = "give [least, largest] of E1, E2 and G12, or 'lower' and 'upper' coefficients"
        raise InputError(project.path, "law.bounds", problem)
    return _coefficient_bounds(project, form, _complete(project, section.of_coefficients))


def _with_moduli_of_symmetry(
    project: Project, bounds: Mapping[str, list[float] | None]
) -> dict[str, list[float] | None]:
    """Return bounds of moduli with those that follow by symmetry; InputError: these are given."""
    law = project.law
    complete = dict(bounds)
    for name in bounds.keys() - MODULI[law.symmetry].keys():
        if bounds[name] is not None:
            problem = f"follow from those of E1, as the law is {law.symmetry}; leave this out"
            raise InputError(project.path, f"law.bounds.{name}", problem)
        if bounds["E1"] is not None:
            share = 0.5 / (1.0 + law.nu12) if name == SHEAR else 1.0
            complete[name] = [share * bound for bound in bounds["E1"]]
    return complete


def _complete(project: Project, bounds: Mapping[str, list[float] | None]) -> dict[str, list[float]]:
    """Return the bounds of one sort; InputError: a key is missing."""
    complete = {}
    for name, values in bounds.items():
        if values is None:
            raise InputError(project.path, f"law.bounds.{name}", "this key is missing; add it")
        complete[name] = values
    return complete


def _coefficient_bounds(
    project: Project, form: LawForm, bounds: Mapping[str, list[float]]
) -> LawBounds:
    """Return the bounds of the free coefficients of a form; InputError: crossed, or not as many."""
    path = project.path
    for name, values in bounds.items():
        if len(values) != len(form.free):
            problem = (
                f"expected {len(form.free)} coefficients of {form.name} moduli "
                f"({', '.join(form.labels[i] for i in form.free)}), got {len(values)}"
            )
            raise InputError(path, f"law.bounds.{name}", problem)
    lower = np.array(bounds["lower"])
    upper = np.array(bounds["upper"])
    crossed = np.flatnonzero(lower > upper)
    if len(crossed):
        k = int(crossed[0])
        problem = (
            f"bounds of {form.labels[form.free[k]]} are crossed: lower {lower[k]:g} is above upper "
            f"{upper[k]:g} {project.scales.modulus_unit}"
        )
        raise InputError(path, f"law.bounds.lower[{k}]", problem)
    unit = project.scales.modulus
    margin_e = DEFAULT_MARGIN_E
    margin_g = DEFAULT_MARGIN_G
    if project.law.margin is not None:
        margin_e = project.law.margin.E * unit
        margin_g = project.law.margin.G12 * unit
    margins = {"E1": margin_e, "E2": margin_e, "G12": margin_g}
    return LawBounds(margins, None, lower * unit, upper * unit)


# Unknowns beside the moduli ---------------------------------------------------------------------


def shared_unknowns(project: Project) -> tuple[Nuisance, ...]:
    """Return the unknowns of [fit.unknowns] and of the memory, one value for all tests.

    A fit starts from the values of [law] and [fabric].

    Raises
    ------
    InputError
        Bounds that are not around the value to start from; a thickness without a prior, which no
        data could tell from the moduli.
    """
    unknowns = project.fit.unknowns
    shared = []
    if unknowns.nu12 is not None:
        shared.append(_nu12_unknown(project, unknowns.nu12))
    if unknowns.thickness is not None:
        shared.append(_thickness_unknown(project, unknowns.thickness))
    return (*shared, *_memory_unknowns(project))


def _nu12_unknown(project: Project, section: UnknownSection) -> Nuisance:
    """Return the unknown Poisson's ratio."""
    start = project.law.nu12
    if project.law.symmetry == "isotropic":
        problem = "G12 of an isotropic law has the nu12 of [law]; leave this out, and compare fits"
        raise InputError(project.path, "fit.unknowns.nu12", problem)
    low, high = _bounds_around(project, "nu12", section.bounds or NU12_BOUNDS, start, 1.0)
    return Nuisance(
        "nu12", low, high, "", prior=section.prior, start=start, law_parameter="nu12", shared=True
    )


def _thickness_unknown(project: Project, section: UnknownSection) -> Nuisance:
    """Return the unknown thickness, mm."""
    start = project.fabric.thickness
    length = project.scales.length
    default_bounds = [share * start / length for share in THICKNESS_BOUNDS]
    bounds = section.bounds or default_bounds
    low, high = _bounds_around(project, "thickness", bounds, start, length)
    if section.prior is None:
        problem = f"this key is missing; {PRODUCT}: say how well its thickness is known before"
        raise InputError(project.path, "fit.unknowns.thickness.prior", problem)
    return Nuisance(
        "thickness",
        low,
        high,
        "mm",
        model_parameter="thickness",
        prior=section.prior * length,
        start=start,
        shared=True,
        hint=PRODUCT,
    )


def _bounds_around(
    project: Project, name: str, bounds: Sequence[float], start: float, unit: float
) -> tuple[float, float]:
    """Return bounds of an unknown in base units; InputError: `start` is not within them."""
    low, high = (bound * unit for bound in bounds)
    if not low <= start <= high:
        problem = (
            f"expected bounds around {start / unit:g}, from which a fit starts, got "
            f"[{low / unit:g}, {high / unit:g}]"
        )
        raise InputError(project.path, f"fit.unknowns.{name}.bounds", problem)
    return low, high


def _memory_unknowns(project: Project) -> Iterator[Nuisance]:
    """Yield the unknown constants of the memory, strain by strain."""
    if project.law.memory is None:
        return
    _memory(project)  # a mistake in the other constants shows first
    for strain, recalled in project.law.memory.by_strain.items():
        if recalled != "fitted":
            continue
        for quantity, start in zip(QUANTITIES, MEMORY_START, strict=True):
            name = f"{quantity}_{strain}"
            low, high = MEMORY_BOUNDS[quantity]
            yield Nuisance(
                name,
                low,
                high,
                "",
                start=start,
                law_parameter=name,
                shared=True,
                hint=UNLOADED,
            )
