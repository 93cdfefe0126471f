"""What is fitted beside the moduli, one value for all tests: nu12, thickness."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..identification.comparison import Comparison
from ..identification.nuisance import Nuisance
from .project import Project
from .schema import UnknownSection

#: Bounds unless the file says otherwise; those of the thickness in shares of the fabric's.
NU12, THICKNESS = (0.0, 0.6), (0.5, 1.5)
#: Below it a law can be positive definite.
MOST_NU12 = 1.0
#: Also of an incompressible one: its load is moduli times thickness times what strain makes of it.
PRODUCT = "a membrane under load knows moduli times thickness only"


def shared_unknowns(project: Project) -> tuple[Nuisance, ...]:
    """Of [fit.unknowns]; a fit starts from what [law] and [fabric] say.

    Raises
    ------
    InputError : bounds out of order, beyond what can be, or not around the value to start from; a
        thickness without a prior, which no data could tell from the moduli.
    """
    asked, shared = project.fit.unknowns, []
    if asked.nu12 is not None:
        start = project.law.nu12
        low, high = _bounds(project, "nu12", asked.nu12, NU12, start, 1.0)
        if not (low >= 0 and high < MOST_NU12):
            problem = f"expected numbers from 0 to below {MOST_NU12:g}, got [{low:g}, {high:g}]"
            raise InputError(project.path, "fit.unknowns.nu12.bounds", problem)
        prior = asked.nu12.prior
        shared.append(
            Nuisance("nu12", low, high, "", prior=prior, start=start, law_parameter="nu12",
                     shared=True)
        )  # fmt: skip
    if asked.thickness is not None:
        start, length = project.fabric.thickness, project.scales.length
        usual = (THICKNESS[0] * start / length, THICKNESS[1] * start / length)
        low, high = _bounds(project, "thickness", asked.thickness, usual, start, length)
        if not low > 0:
            problem = f"expected thicknesses above 0, got {low / length:g}"
            raise InputError(project.path, "fit.unknowns.thickness.bounds", problem)
        if asked.thickness.prior is None:
            problem = f"this key is missing; {PRODUCT}: say how well its thickness is known before"
            raise InputError(project.path, "fit.unknowns.thickness.prior", problem)
        prior = asked.thickness.prior * length
        shared.append(
            Nuisance("thickness", low, high, "mm", "thickness", 1.0, prior, start=start,
                     shared=True, why=PRODUCT)
        )  # fmt: skip
    return tuple(shared)


def _bounds(
    project: Project,
    name: str,
    section: UnknownSection,
    usual: tuple[float, float],
    start: float,
    unit: float,
) -> tuple[float, float]:
    low, high = (unit * value for value in section.bounds or usual)
    if not low < high:
        problem = f"expected [least, largest], got [{low / unit:g}, {high / unit:g}]"
        raise InputError(project.path, f"fit.unknowns.{name}.bounds", problem)
    if not low <= start <= high:
        problem = (
            f"expected bounds around {start / unit:g}, from which a fit starts, got "
            f"[{low / unit:g}, {high / unit:g}]"
        )
        raise InputError(project.path, f"fit.unknowns.{name}.bounds", problem)
    return low, high


def with_shared(
    comparisons: Iterable[Comparison], shared: Iterable[Nuisance]
) -> tuple[Comparison, ...]:
    """The comparisons with what they share before what is their own.

    The misfit that a prior allows is that of the data where it is one standard deviation away: it
    weighs what one value does of a block whose norm is that of its noise.
    """
    several, unknowns = tuple(comparisons), tuple(shared)
    if not unknowns:
        return several
    weight = float(np.median([_weight(c) for c in several]))
    unknowns = tuple(n if n.prior is None else replace(n, weight=weight) for n in unknowns)
    own = [tuple(n for n in c.nuisance if not n.shared) for c in several]
    return tuple(replace(c, nuisance=(*unknowns, *n)) for c, n in zip(several, own, strict=True))


def _weight(comparison: Comparison) -> float:
    objective = comparison.objective
    noise = objective.least_noise / np.median(objective.scale)
    return float(noise / np.sqrt(np.mean(objective.sizes)))
