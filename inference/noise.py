"""The noise of the data, and tests whether the residual of a fit can be noise.

Neighbouring residuals are alike: a facet of a camera is wider than the step between its points, and
model errors are smooth. Where derivatives vary slowly, the variance of a fit grows by 1 + sum of
rho(d) over the neighbours, rho the correlation at the distance d.

Over distances that are long beside a facet noise has as much power in the smoothest polynomials
over the sheet as in those of the next degrees; a law or model of the wrong form leaves more in the
former. Their ratio has the distribution F of Fisher and Snedecor if nothing but noise is left.

Specimens err along their whole curve, but scatter about the truth: what is alike in all is the
model's. The mean amplitude of a few smooth shapes that no change of the unknowns can explain is
tested against their scatter (Hotelling's T squared)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.polynomial.legendre import legval

from ..errors import InputError, Note, NoteKind, SolverFailure
from ..materials.forms.base import Array
from ..materials.law import ThicknessChange
from .comparison import NoiseIs, Objective
from .problem import Evaluation, FitProblem

ABOVE_NOISE = NoteKind("above the noise", weight=13)
BELOW_NOISE = NoteKind("below the noise")
DISCREPANCY = NoteKind("wrong form", weight=15)
RINGS = 60  # rings around a point that others are compared with, unless given
#: Distances looked at in a block, and blocks looked at, evenly spread.
DISTANCES, BLOCKS = 500_000, 60
#: Standard deviations of a correlation of independent values, which are no correlation.
BY_CHANCE = 2.0
REACH = 0.5  # of the largest extent: beyond, there are no neighbours any more, unless given


def alike_in(objective: Objective, residual: Array) -> float:
    """Return `alike` of a comparison's residual (m,); 1 where its objective has no places."""
    places = getattr(objective, "places", ())
    if not places:
        return 1.0
    ends = np.cumsum(objective.sizes)[:-1]
    return alike(np.split(residual, ends), places)


def alike(
    residuals: Sequence[Array], places: Sequence[Array], reach: float = REACH, rings: int = RINGS
) -> float:
    """Return the number of values that err as one, 1 where they are independent.
    residuals : blocks (n,), which count alike. places : (n, 2) mm or (n, 1) of each. reach : of the
    largest extent, where neighbours end. rings : of distances."""
    products, pairs, asked = np.zeros(rings), np.zeros(rings), 0
    random = np.random.default_rng(0)
    step = max(1, -(-len(residuals) // BLOCKS))
    for own, at in zip(residuals[::step], places[::step], strict=True):
        if len(own) < 2:
            continue
        few = random.permutation(len(own))[: max(20, DISTANCES // len(own))]
        extent = float(np.ptp(at, axis=0).max())
        apart = scipy.spatial.distance.cdist(at[few], at) / (reach * extent)
        ring = np.minimum(apart * rings, rings).astype(int)
        ring[np.arange(len(few)), few] = rings  # a point is no neighbour of its own
        value = own[few, None] * own
        inside = ring < rings
        # Every block counts alike, whatever its size.
        unit = float(np.mean(own**2))
        if not unit > 0:
            continue
        products += np.bincount(ring[inside], value[inside] / unit, minlength=rings)
        pairs += np.bincount(ring[inside], minlength=rings)
        asked += len(few)
    if not asked:
        return 1.0
    known = pairs > 0
    rho = products[known] / pairs[known]
    neighbours = pairs[known] / asked
    # Every pair was met twice, at most; of few pairs a correlation is chance.
    chance = rho <= BY_CHANCE / np.sqrt(np.maximum(pairs[known] / 2, 1.0))
    positive = int(np.argmax(chance)) if chance.any() else len(rho)
    return float(1.0 + (rho * neighbours)[:positive].sum())


@dataclass(frozen=True)
class Misfit:
    """The RMS residual of a comparison beside the noise of its data, both in `unit`s."""

    rms: float
    noise: float
    noise_is: NoiseIs
    unit: str

    @property
    def ratio(self) -> float:
        return self.rms / self.noise if self.noise > 0 else np.inf


def misfits(problem: FitProblem, residual: Array) -> dict[str, Misfit]:
    """Return the misfit of every comparison, by name, from the residual (m,) of all."""
    misfit, found = residual * problem.scale, {}
    for k, comparison in enumerate(problem.comparisons):
        rms = float(np.sqrt(np.mean(misfit[problem.rows(k)] ** 2)))
        own = comparison.objective
        found[comparison.name] = Misfit(
            rms, own.least_noise, getattr(own, "noise_is", "assumed"), own.unit
        )
    return found


@dataclass(frozen=True, eq=False)
class Noise:
    """The noise that a fit is assessed with.
    level : by comparison, in the unit of its data (mm, N). alike : by comparison, neighbours that
    err as one. rows : (m,) the standard deviation that as many independent values would have. least
    : (m,) the least noise of each comparison's data, all values independent."""

    level: dict[str, float]
    alike: dict[str, float]
    rows: Array
    least: Array

    @classmethod
    def of(cls, problem: FitProblem, residual: Array) -> Noise:
        """Return the noise from a residual (m,), at least the objective's least noise.
        Neighbours that err as one count as one; a misfit below the noise is taken for white unless
        the objective knows better (`alike`, of the specimens of a load curve)."""
        scale = problem.scale
        level, together = {}, {}
        rows, least = np.empty_like(scale), np.empty_like(scale)
        for k, (name, misfit) in enumerate(misfits(problem, residual).items()):
            own = problem.rows(k)
            level[name], together[name] = max(misfit.noise, misfit.rms), 1.0
            if misfit.rms > misfit.noise:
                together[name] = alike_in(problem.comparisons[k].objective, residual[own])
            known = getattr(problem.comparisons[k].objective, "alike", 1.0)
            together[name] = max(together[name], known)
            rows[own] = level[name] * np.sqrt(together[name]) / scale[own]
            least[own] = misfit.noise / scale[own]
        known = [n.weight for n in problem.unknowns.nuisance.all if n.prior is not None]
        rows[len(rows) - len(known) :] = least[len(rows) - len(known) :] = known
        return cls(level, together, rows, least)


#: Degree of the polynomials that are smooth over the whole sheet, and of the next ones.
SMOOTH, NEXT = 4, 8
FALSE_ALARMS = 0.01  # of so many fits in which nothing but noise is left, one is said to leave more
#: Values of a block for every shape that is looked at, at least; blocks that are asked how many
#: values err as one.
LEAST_VALUES, FEW = 2, 3
#: A facet is not small beside the next shapes. If A of n values err as one, noise that is alike
#: over a Gaussian has exp(2.6 to 3.5 sqrt(A / n)) times their power in the smooth ones (computed on
#: a square, n / A from 40 to 400; white noise has as much).
STEEPER = 3.5
#: Of what was measured (RMS): a discrepancy of displacements, or of loads, that does not matter
#: unless its cause moves a modulus by more than `MOVES`.
OF_SHEET, OF_LOAD, MOVES = 0.002, 0.01, 0.02
#: Of a discrepancy: a cause that explains less is not named; causes that are named, at most.
NAMED, CAUSES = 0.5, 2
DISTINCT = 1e-2  # of a cause: if less is left beside the slopes, the moduli follow it


@dataclass(frozen=True)
class Cause:
    """A cause of a discrepancy, with its amount and remedy in `words`.
    share : of the squares of the discrepancy that it explains. moves : largest relative change of a
    modulus where it is mended, halfway along the strains."""

    words: str
    share: float
    moves: float = 0.0


#: Largest relative change of a modulus by a step of the unknowns.
Effect = Callable[[Array], float]


def ranked_causes(
    left: Array, slopes: Array, causes: Mapping[str, Array], effect: Effect | None = None
) -> tuple[Cause, ...]:
    """Return causes of a discrepancy (n,), the likeliest first.
    slopes : (n, unknowns); what they follow explains nothing. causes : (n, k), change of the
    residual by one unit of each cause, by its words with `{}` for the amounts."""
    basis, size, _ = np.linalg.svd(slopes, full_matrices=False)
    basis = basis[:, size > NOTHING * size.max(initial=0.0)]
    beside = left - basis @ (basis.T @ left)
    whole, found = float(beside @ beside), []
    for words, columns in causes.items():
        own = columns - basis @ (basis.T @ columns)
        real = np.linalg.norm(own, axis=0) > DISTINCT * np.linalg.norm(columns, axis=0)
        amount = np.zeros(len(real))
        if not real.any() or not whole > 0:
            continue
        amount[real] = -np.linalg.lstsq(own[:, real], beside, rcond=DISTINCT)[0]
        explained = 1.0 - float(np.sum((beside + own @ amount) ** 2)) / whole
        step = np.asarray(-np.linalg.lstsq(slopes, columns @ amount, rcond=NOTHING)[0], float)
        moves = 0.0 if effect is None else effect(step)
        found.append(Cause(words.format(*amount), explained, moves))
    return tuple(sorted(found, key=lambda one: -one.share))


@dataclass(frozen=True)
class Discrepancy:
    """The part of a comparison's residual that is smooth over its whole sheet.
    ratio : power in a smooth shape over that in one of the next. largest : of those that noise
    alone exceeds in one of a hundred fits. rms : of the part beyond the noise's share, in `unit`s.
    least : uncertainty of a mean by the noise; less does not matter. specimens : of strips; then
    `ratio` is of Hotelling's test and `rms` of what all have in common. share : `rms` over the RMS
    of what was measured. causes : the likeliest first."""

    ratio: float
    largest: float
    rms: float
    unit: str
    least: float = 0.0
    specimens: int = 0
    share: float = 1.0
    causes: tuple[Cause, ...] = ()

    @property
    def named(self) -> tuple[Cause, ...]:
        """Return the causes that its shape points to."""
        return tuple(one for one in self.causes[:CAUSES] if one.share > NAMED)

    @property
    def systematic(self) -> bool:
        """Return whether it cannot be noise, and exceeds what the noise leaves open anyway."""
        return self.ratio > self.largest and self.rms > self.least

    @property
    def significant(self) -> bool:
        """Return whether it is systematic and so large that it matters."""
        large = self.share > (OF_LOAD if self.specimens else OF_SHEET)
        return self.systematic and (large or any(one.moves > MOVES for one in self.named))


def discrepancies(
    problem: FitProblem, residual: Array, doubt: Array | None, best: Evaluation, effect: Effect
) -> dict[str, Discrepancy]:
    """Return the discrepancy of every comparison on a sheet, or of several specimens, by name.
    residual : (m,). doubt : (m,) part of it that the mesh may cause. best : where causes are looked
    for."""
    found = {}
    doubt = np.zeros_like(residual) if doubt is None else doubt
    for k, comparison in enumerate(problem.comparisons):
        objective, rows = comparison.objective, problem.rows(k)
        if getattr(objective, "specimens", None) is not None:
            one = _of_specimens(problem, residual, best, k, effect)
        else:
            one = _of_sheet(problem, (residual[rows], doubt[rows]), k)
            if one is not None and one.systematic:
                one = replace(one, causes=_causes_on_sheet(problem, residual, best, k, effect))
        if one is not None:
            measured = np.asarray(getattr(objective, "measured", ()))
            if measured.any():
                one = replace(one, share=one.rms / float(np.sqrt(np.mean(measured**2))))
            found[comparison.name] = one
    return found


def _of_sheet(problem: FitProblem, parts: Sequence[Array], k: int) -> Discrepancy | None:
    objective = problem.comparisons[k].objective
    places = getattr(objective, "places", ())
    if not places or places[0].shape[1] != 2:
        return None
    scale, ends = problem.scale[problem.rows(k)], np.cumsum(objective.sizes)[:-1]
    blocks, of_mesh = (np.split(part * scale, ends) for part in parts)
    one = discrepancy(blocks, of_mesh, places, problem.unknowns.count, objective.unit)
    least = objective.least_noise / float(np.sqrt(len(scale)))
    return None if one is None else replace(one, least=least)


def _causes_on_sheet(
    problem: FitProblem, residual: Array, best: Evaluation, k: int, effect: Effect | None
) -> tuple[Cause, ...]:
    """Return causes of the smooth part of a comparison's residual, by its shapes' amplitudes."""
    rows, objective = problem.rows(k), problem.comparisons[k].objective
    if best.jacobian is None or not hasattr(objective, "causes"):
        return ()
    causes = {**objective.causes(best.histories[k]), **_by_thickness(problem, best, k)}
    columns = np.column_stack([residual[rows], best.jacobian[rows], *causes.values()])
    blocks = np.split(columns * problem.scale[rows, None], np.cumsum(objective.sizes)[:-1])
    some = [
        smooth_shapes(at)[:, : _shapes(SMOOTH)].T @ block
        for block, at in zip(blocks, objective.places, strict=True)  # type: ignore[attr-defined]
        if len(block) >= LEAST_VALUES * _shapes(NEXT)
    ]
    ends = np.cumsum([1, best.jacobian.shape[1], *(own.shape[1] for own in causes.values())])
    left, slopes, *own = np.split(np.concatenate(some), ends[:-1], axis=1)
    return ranked_causes(left[:, 0], slopes, dict(zip(causes, own, strict=True)), effect)


def _by_thickness(problem: FitProblem, best: Evaluation, k: int) -> dict[str, Array]:
    """Return (m, 1) of the other option of the thickness; none for another program."""
    comparison, unknowns = problem.comparisons[k], problem.unknowns
    law = unknowns.law(problem.law, best.unknowns)
    other: ThicknessChange = "incompressible" if law.thickness_change == "constant" else "constant"
    values = unknowns.nuisance_values(comparison.name, best.unknowns)
    if problem.solver.external:
        return {}
    try:
        there = comparison.run(
            replace(law, thickness_change=other), unknowns.free, values, warm=False
        )
    except (InputError, SolverFailure):
        return {}
    residual = comparison.objective.residual
    by = residual(there, values) - residual(best.histories[k], values)
    return {f'thickness_change = "{other}", {{:.0%}} of its effect': by[:, None]}


def discrepancy(
    blocks: Sequence[Array], doubts: Sequence[Array], places: Sequence[Array], unknowns: int,
    unit: str,
) -> Discrepancy | None:  # fmt: skip
    """Return the discrepancy of blocks (n,) at places (n, 2) mm; None where values are too few.
    Doubt is taken off the smooth shapes; `unknowns` have taken as many out of the residual."""
    usable = [(block, doubt, at) for block, doubt, at in zip(blocks, doubts, places, strict=True)
              if len(block) >= LEAST_VALUES * _shapes(NEXT) and block.any()]  # fmt: skip
    if not usable:
        return None
    # Power in units of each block's own, and shapes.
    smooth, following, count = np.zeros(2), np.zeros(2), _shapes(SMOOTH)
    before, shapes, rest = np.zeros((0, 2)), np.zeros((0, 0)), []
    left, of_next, values = 0.0, 0.0, 0
    for block, doubt, at in usable:
        if at is not before and not np.array_equal(at, before):
            shapes, before = smooth_shapes(at), at
        amplitude, own = shapes.T @ block, float(np.mean(block**2))
        share, beyond = amplitude**2, -((shapes[:, :count].T @ doubt) ** 2).sum()
        beyond += share[:count].sum()
        smooth += beyond / own, count
        following += share[count:].sum() / own, shapes.shape[1] - count
        left, of_next = left + beyond, of_next + count * share[count:].mean()
        values += len(block)
        rest.append(block - shapes @ amplitude)
    step = -(-len(rest) // FEW)
    together = alike(rest[::step], [at for _, _, at in usable][::step])
    independent = values / len(usable) / together
    free = smooth[1] - unknowns
    if free < 1 or not following[0] > 0:
        return None
    steeper = float(np.exp(STEEPER * np.sqrt((1.0 - 1.0 / together) / independent)))
    ratio = (smooth[0] / free) / (following[0] / following[1])
    largest = float(scipy.special.fdtri(free, following[1], 1 - FALSE_ALARMS)) * steeper
    rms = np.sqrt(max(left - steeper * of_next, 0.0) / values)
    return Discrepancy(float(ratio), largest, float(rms), unit)


def smooth_shapes(places: Array) -> Array:
    """Return (n, shapes) orthonormal over the places, polynomials of ever higher degree."""
    low, high = places.min(axis=0), places.max(axis=0)
    unit = 2 * (places - low) / np.where(high > low, high - low, 1.0) - 1.0
    powers = [(i, total - i) for total in range(NEXT + 1) for i in range(total, -1, -1)]
    x, y = (np.stack([legval(one, np.eye(NEXT + 1)[i]) for i in range(NEXT + 1)], axis=1)
            for one in unit.T)  # fmt: skip
    columns = np.stack([x[:, i] * y[:, j] for i, j in powers], axis=1)
    return np.asarray(np.linalg.qr(columns)[0])


def _shapes(degree: int) -> int:
    return (degree + 1) * (degree + 2) // 2


def notes_of_discrepancies(found: Mapping[str, Discrepancy]) -> list[Note]:
    """Return notes where more is left than noise can be."""
    return [Note(DISCREPANCY, _words(one), name) for name, one in found.items() if one.significant]


def _words(one: Discrepancy) -> str:
    of = "loads" if one.specimens else "displacements"
    left = f"{one.rms:.2g} {one.unit} of what the fit leaves, {_percent(one.share)} of the {of}, is"
    chance = f"chance gives {one.largest:.3g} in one of a hundred"
    where = (
        f"alike in all {one.specimens} specimens (Hotelling's F is {one.ratio:.3g}; {chance})"
        if one.specimens
        else f"smooth over the whole sheet ({one.ratio:.3g} times the power that noise has in such "
        f"shapes; {chance})"
    )
    named = " or ".join(
        f"{cause.words} ({100 * cause.share:.0f} % of it explained; moduli would change by up to "
        f"{_percent(round(cause.moves, 3))})"
        for cause in one.named
    )
    if named:
        return f"{left} {where}; it has the shape of {named}"
    share = max((cause.share for cause in one.causes), default=0.0)
    known = f" (known causes explain at most {100 * share:.0f} %)" if one.causes else ""
    sheet = "" if one.specimens else ", or [bubble.sheet] for a sheet that was not flat"
    return (
        f"{left} {where}: the form of the law or the model is wrong{known}, and the moduli are off "
        f"by more than their bands say; try another form (bubblefit compare){sheet}"
    )


def _percent(share: float) -> str:
    return f"{100 * share:.{2 if share < 0.1 else 3}g} %"


#: Shapes that are tested, at most, and degrees of polynomials among which they are found.
SHAPES, DEGREES = 2, 8
COVERED = 0.8  # of the whole curve, that a specimen must cover to count
#: Of the largest singular value: below, a slope says nothing of its own; of a shape, likewise.
NOTHING, LEFT = 1e-6, 1e-3


def _of_specimens(
    problem: FitProblem, residual: Array, best: Evaluation, k: int, effect: Effect
) -> Discrepancy | None:
    if best.jacobian is None:
        return None
    objective: Any = problem.comparisons[k].objective
    rows, (at,), whose = problem.rows(k), objective.places, objective.specimens
    scale = problem.scale[rows]
    off, slopes = residual[rows] * scale, best.jacobian[rows] * scale[:, None]
    some = [np.flatnonzero(whose == number) for number in np.unique(whose)]
    left, places, steep = ([v[own] for own in some] for v in (off, at[:, 0], slopes))
    known = objective.causes(best.histories[k]) if hasattr(objective, "causes") else {}
    order = np.concatenate(some)
    causes = {words: (own * scale[:, None])[order] for words, own in known.items()}
    return alike_in_all(left, places, steep, objective.unit, causes, effect)


def alike_in_all(
    residuals: Sequence[Array], places: Sequence[Array], slopes: Sequence[Array], unit: str,
    causes: Mapping[str, Array] | None = None, effect: Effect | None = None,
) -> Discrepancy | None:  # fmt: skip
    """Return what specimens have in common beside the model and what no unknown can follow.
    residuals : (n,) of each specimen, model less measured, in `unit`s. places : (n,) along its
    curve. slopes : (n, unknowns). causes : of all, see `ranked_causes`. None with fewer than
    three specimens that cover most of the curve."""
    low, high = (end(end(own) for own in places) for end in (min, max))
    if not high > low:
        return None
    whole = np.concatenate(slopes)
    _, size, axes = np.linalg.svd(whole, full_matrices=False)
    kept = axes[size > NOTHING * size[0]] if size[0] > 0 else axes[:0]
    some = [k for k, own in enumerate(places) if np.ptp(own) >= COVERED * (high - low)
            and len(own) >= len(kept) + SHAPES + 1]  # fmt: skip
    count = min(SHAPES, len(some) - 2)
    if count < 1:
        return None
    along = [2 * (own - low) / (high - low) - 1.0 for own in places]
    shapes = _beside(whole @ kept.T, np.concatenate(along), count)
    count = shapes.shape[1]
    if not count:
        return None  # the law can follow whatever is smooth
    amplitudes = []
    for k in some:
        columns = np.column_stack([slopes[k] @ kept.T, _values(along[k], shapes)])
        amplitudes.append(np.linalg.lstsq(columns, residuals[k], rcond=None)[0][-count:])
    each = np.array(amplitudes)
    mean, specimens = each.mean(axis=0), len(some)
    spread = np.atleast_2d(np.cov(each.T))
    common = _values(np.concatenate(along), shapes) @ mean
    followed = np.linalg.qr(whole @ kept.T)[0] if len(kept) else np.zeros((len(common), 0))
    rms = float(np.sqrt(np.mean((common - followed @ (followed.T @ common)) ** 2)))
    sizes = np.linalg.eigvalsh(spread)
    if not sizes[0] > NOTHING**2 * sizes[-1]:
        return None  # specimens that differ by a factor only, or not at all
    square = specimens * float(mean @ np.linalg.solve(spread, mean))
    ratio = square * (specimens - count) / (count * (specimens - 1))
    largest = float(scipy.special.fdtri(count, specimens - count, 1 - FALSE_ALARMS))
    why = ranked_causes(common, whole, causes or {}, effect)
    return Discrepancy(ratio, largest, rms, unit, specimens=specimens, causes=why)


def _beside(slopes: Array, along: Array, count: int) -> Array:
    """Return (DEGREES + 1, count) Legendre coefficients of the smoothest shapes beside the slopes.
    A shape that they can follow, with those taken before it, says nothing of the form."""
    unit = np.linalg.qr(slopes)[0] if slopes.shape[1] else np.zeros((len(along), 0))
    shapes = []
    for row in np.eye(DEGREES + 1):
        every = legval(along, row)
        left = every - unit @ (unit.T @ every)
        left -= unit @ (unit.T @ left)
        size = float(np.linalg.norm(left))
        if size**2 > LEFT * float(every @ every):
            shapes.append(row)
            unit = np.column_stack([unit, left / size])
        if len(shapes) == count:
            break
    return np.array(shapes).reshape(-1, DEGREES + 1).T


def _values(along: Array, shapes: Array) -> Array:
    """Return (n, count) of shapes at places from -1 to 1."""
    return np.stack([legval(along, column) for column in shapes.T], axis=1)


#: Of so many fits in which the noise is as it is given, one is said to be off to a side.
CHANCE = 0.01
MATTERS = 0.1  # of the noise: less is no matter, however many values say it (rounding, a mesh)


@dataclass(frozen=True)
class NoiseTest:
    """A comparison's residual beside the noise given; free : independent ones less the unknowns."""

    misfit: Misfit
    values: int
    independent: float
    free: float

    @property
    def square(self) -> float:
        return self.independent * self.misfit.ratio**2

    @property
    def above(self) -> float:
        """Return the probability that such noise leaves as much, or more."""
        return float(scipy.special.chdtrc(self.free, self.square))

    @property
    def below(self) -> float:
        """Return the probability that it leaves as little, or less."""
        return float(scipy.special.chdtr(self.free, self.square))

    @property
    def note_kind(self) -> NoteKind | None:
        """Return the kind of note to give; None where the residual is as expected."""
        expected = np.sqrt(self.free / self.independent)
        if self.above < CHANCE and self.misfit.ratio > (1 + MATTERS) * expected:
            return ABOVE_NOISE
        if self.below < CHANCE and self.misfit.ratio < (1 - MATTERS) * expected:
            return BELOW_NOISE
        return None

    @property
    def words(self) -> str:
        m = self.misfit
        return (
            f"the fit leaves {m.rms:.3g} {m.unit} RMS, {m.ratio:.3g} times the noise given "
            f"({m.noise:.3g} {m.unit}; {self.values} values count as {self.independent:.3g} "
            "independent ones)"
        )

    @property
    def numbers(self) -> dict[str, Any]:
        return {
            "values": self.values, "independent": self.independent, "chi_square": self.square,
            "degrees_of_freedom": self.free, "probability_of_more": self.above,
            "probability_of_less": self.below,
        }  # fmt: skip


def noise_tests(problem: FitProblem, residual: Array) -> dict[str, NoiseTest]:
    """Return tests of the comparisons with given noise, by name, from the residual (m,) of all."""
    given: dict[str, tuple[Misfit, int, float]] = {}
    total, every = 0.0, misfits(problem, residual)
    if not any(misfit.noise_is == "given" for misfit in every.values()):
        return {}
    for k, (name, misfit) in enumerate(every.items()):
        own = residual[problem.rows(k)]
        independent = len(own) / alike_in(problem.comparisons[k].objective, own)
        total += independent
        if misfit.noise_is == "given" and misfit.noise > 0:
            given[name] = misfit, len(own), independent
    taken = problem.unknowns.count / max(total, 1.0)
    return {name: NoiseTest(misfit, values, independent, max(independent * (1.0 - taken), 1.0))
            for name, (misfit, values, independent) in given.items()}  # fmt: skip


def notes_of_noise(tests: Mapping[str, NoiseTest]) -> list[Note]:
    """Return notes where more, or less, is left than the noise given can leave."""
    return [Note(kind, f"{test.words}: {REASONS[kind]}", name) for name, test in tests.items()
            if (kind := test.note_kind) is not None]  # fmt: skip


REASONS = {
    ABOVE_NOISE: "the noise is given too small, or model or data are off by more than "
    "noise, and the uncertainty counts all of the residual as noise",
    BELOW_NOISE: "the noise is given too large, and so is the uncertainty that follows from it",
}
