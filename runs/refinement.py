"""Run tests with a card on finer and finer meshes, with more increments, or with other nu12.

A discretisation of size h gives f(h) = f(0) + C h^p + smaller terms, once h is small enough. Three
values determine p, C and f(0), whatever the ratios of their sizes (P. J. Roache's generalised
Richardson extrapolation). Each result has a remark where the values contradict that assumption."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from ..arguments import NotNegative, TwoOrMore, checked_arguments
from ..errors import InputError, SolverFailure
from ..experiments.base import Refined
from ..experiments.run_records import notes_of, other_thickness
from ..lazy_modules import pandas as pd
from ..meshes.mesh import Mesh
from ..notes import Note, as_note, note_lines, note_records
from ..project.project import Project
from ..storage.plain_values import plain_values
from .folder import Presented, check_unused, finished
from .in_use import alone_in_folder
from .progress import Listener
from .simulation import (
    FAILED,
    Analyses,
    GivenCard,
    StudiedModel,
    attempt,
    card_of,
    card_words,
    parts_of,
    studied_tests,
)

Array = NDArray[np.float64]
Curve = tuple[Array, Array]

#: Orders looked for; a smooth problem on common elements has 1 to 4.
LOWEST, HIGHEST = 0.05, 12.0
#: Two successive orders further apart than this are not one order yet.
STEADY = 0.5
RMS = "RMS of the load to the next finer level, N"


@dataclass(frozen=True)
class Convergence:
    """Order and limit of a sequence of refinements.
    order : observed on the three finest levels, None where there is none. limit : the value at size
    zero by Richardson's extrapolation. previous : the order observed one level coarser. remark : ""
    where nothing speaks against the limit."""

    order: float | None = None
    limit: float | None = None
    previous: float | None = None
    remark: str = ""


def observed_order(sizes: ArrayLike, changes: ArrayLike) -> float | None:
    """Return the order p with which two successive changes fall.
    sizes : (3,) coarse to fine, decreasing. changes : (2,) from the coarse to the middle level and
    from the middle to the fine one: of a value, or a norm of what changes. Returns: p, or None:
    changes of opposite sign, or a ratio that no order from `LOWEST` to `HIGHEST` has."""
    h = np.asarray(sizes, dtype=float)
    d = np.asarray(changes, dtype=float)
    if d[1] == 0 or not np.isfinite(d).all() or d[0] / d[1] <= 0:
        return None
    wanted = np.log(d[0] / d[1])

    def excess(p: float) -> float:
        ratios = h / h[1]  # powers of numbers near 1 do not overflow
        return float(np.log((ratios[0] ** p - 1.0) / (1.0 - ratios[2] ** p)) - wanted)

    if excess(LOWEST) > 0 or excess(HIGHEST) < 0:
        return None
    return float(brentq(excess, LOWEST, HIGHEST, xtol=1e-10))


def richardson(sizes: ArrayLike, values: ArrayLike, order: float) -> float:
    """Return the value at size zero from the two finest levels (2,)."""
    h = np.asarray(sizes, dtype=float)
    f = np.asarray(values, dtype=float)
    return float(f[1] + (f[1] - f[0]) / ((h[0] / h[1]) ** order - 1.0))


def convergence(sizes: Sequence[float], values: Sequence[float], noise: float = 0.0) -> Convergence:
    """Return order and limit of a sequence of refinements.
    sizes, values : (levels,) coarse to fine; sizes decrease, in any unit. noise : relative change
    that is not the refinement's: the accuracy of solver and files."""
    h = np.asarray(sizes, dtype=float)
    f = np.asarray(values, dtype=float)
    changes = np.diff(f)
    least = noise * np.abs(f).max(initial=0.0)
    if len(f) > 1 and np.abs(changes[-1]) <= least:
        return Convergence(remark="the two finest levels agree to the accuracy of the solver")
    if len(f) < 3:
        return Convergence(remark="an order needs three levels")
    order = observed_order(h[-3:], changes[-2:])
    if order is None:
        why = "the changes follow no power of the size"
        if changes[-2] * changes[-1] < 0:
            why = "the values go up and down"
        elif abs(changes[-1]) >= abs(changes[-2]):
            why = "the changes do not get smaller"
        return Convergence(remark=f"{why}: no order, no limit")
    limit = richardson(h[-2:], f[-2:], order)
    if abs(limit - f[-1]) > abs(f[-1] - f[-3]):
        # An order below a half where sizes are halved: the limit is not determined.
        words = f"changes that fall so slowly (order {order:.2g}) show no limit: refine further"
        return Convergence(remark=words)
    previous = None
    if len(f) > 3 and (np.abs(changes[-3:]) > least).all():
        previous = observed_order(h[-4:-1], changes[-3:-1])
    remark = ""
    if len(f) == 3:
        remark = "one order only: one more level would show whether it holds"
    elif previous is None:
        remark = "one order only, none from coarser levels: one more would show whether it holds"
    elif abs(previous - order) > STEADY:
        remark = f"the order still moves (from {previous:.2g}): the limit is a guess"
    return Convergence(order, limit, previous, remark)


@dataclass(frozen=True, eq=False)
class Level:
    """One refinement of a part by a factor, and its run; size : edge (mm), or share of the load.
    values : quantities of interest by name, None where the run failed, with the reason in
    `failure`. curve : (x, y) of the response, where levels are compared along one. seconds : wall
    clock."""

    part: StudiedModel
    factor: float
    size: float
    seconds: float = 0.0
    iterations: int = 0
    values: Mapping[str, float] | None = None
    curve: Curve | None = None
    failure: str = ""
    notes: Sequence[Note] = ()

    @property
    def elements(self) -> int:
        return len(self.part.model.mesh.quads)

    @property
    def row(self) -> dict[str, Any]:
        return {
            "factor": self.factor,
            "elements": self.elements,
            "increments": self.part.increments,
            "size": self.size,
            "seconds": self.seconds,
            "iterations": self.iterations,
        }


@dataclass(frozen=True, eq=False)
class Refinement(Presented):
    """A study of refinement: runs by part, coarse to fine; noise : relative, of the solver."""

    project: Project
    card: str
    solver: str
    what: Refined
    runs: Mapping[str, Sequence[Level]]
    noise: float
    warnings: tuple[Note, ...] = ()

    @property
    def result(self) -> dict[str, Any]:
        """Return the content of result.json: cost and values of each level, orders and limits."""
        return {
            "command": "study mesh",
            "project": str(self.project.path),
            "card": self.card,
            "solver": self.solver,
            "refined": self.what,
            "models": {name: _part(runs, self.noise) for name, runs in self.runs.items()},
            "notes": note_records(self.notes),
        }

    def table(self) -> pd.DataFrame:
        """Return a row a part, level and quantity, with its deviation from the finest level."""
        rows: list[dict[str, object]] = []
        for name, runs in self.runs.items():
            good = ended(runs)
            finest = (good[-1].values if good else None) or {}
            changes = rms_changes(runs)
            for run in runs:
                start = {"model": name, "refined": self.what, **run.row}
                for quantity, value in (run.values or {}).items():
                    off = value - finest.get(quantity, np.nan)
                    percent = 100 * off / finest.get(quantity, np.nan)
                    rows.append(
                        {
                            **start,
                            "quantity": quantity,
                            "value": value,
                            "off_finest": off,
                            "off_finest_percent": percent,
                        }
                    )
                if run in good and good.index(run) < len(changes):
                    rows.append({**start, "quantity": RMS, "value": changes[good.index(run)]})
                if run.failure:
                    rows.append({**start, "quantity": f"failed: {run.failure}"})
        return pd.DataFrame(rows)

    def lines(self) -> list[str]:
        words: list[str] = []
        for name, model in self.result["models"].items():
            head = list(model["quantities"])[-2:] or [""]
            words.append(f"{name}: {self.what} refined")
            columns = f"{'quads':>9} {'steps':>6} {'seconds':>8}   "
            words.append(columns + "   ".join(head).rstrip())
            for level in model["levels"]:
                text = f"{level['elements']:9d} {level['increments']:6d} {level['seconds']:8.2f}   "
                own = "   (the project's own)" if level["factor"] == 1 else ""
                if level["values"] is None:
                    words.append(f"{text}failed: {level['failed']}{own}")
                    continue
                numbers = [
                    f"{'-' if (v := level['values'].get(h)) is None else f'{v:.7g}':<{len(h)}}"
                    for h in head
                    if h
                ]
                words.append((text + "   ".join(numbers) + own).rstrip())
            words += [_quantity_words(*item) for item in model["quantities"].items()]
            if (rms := model.get("rms_N")) is not None:
                changes = ", ".join(f"{c:.3g}" for c in rms["to_next_finer"])
                order = "" if rms["order"] is None else f", order {rms['order']:.2f}"
                words.append(f"  RMS of the load to the next finer level: {changes} N{order}")
        return [*words, *note_lines(self.notes)]

    @property
    def notes(self) -> list[Note]:
        notes = []
        for name, runs in self.runs.items():
            for run in runs:
                size = f"{run.elements} quads"
                if self.what == "increments":
                    size = f"{run.part.increments} increments"
                failed = [Note(FAILED, run.failure)] if run.failure else []
                notes += [n.about(f"{name}, {size}") for n in (*failed, *map(as_note, run.notes))]
        return [*notes, *self.warnings]


def _quantity_words(name: str, found: Mapping[str, Any]) -> str:
    words = f"  {name}: {found['finest']:.7g} on the finest"
    if found["order"] is not None:
        words += f", order {found['order']:.2f}, limit {found['limit']:.7g}"
    if found["own_error"] is not None:
        percent = 100 * found["own_error"]
        against = found["own_error_against"]
        words += f"; the project's own is {percent:+.2g} % off the {against}"
    return words + (f" ({found['remark']})" if found["remark"] else "")


def _part(runs: Sequence[Level], noise: float) -> dict[str, Any]:
    good = ended(runs)
    levels = [
        {
            **run.row,
            "values": None if run.values is None else dict(run.values),
            **({"failed": run.failure} if run.failure else {}),
        }
        for run in runs
    ]
    result: dict[str, Any] = {"levels": levels, "quantities": {}}
    if len(good) < 2:
        return result
    finest = good[-1].values or {}
    result["quantities"] = {name: _quantity(name, v, good, noise) for name, v in finest.items()}
    if changes := rms_changes(runs):
        sizes = [run.size for run in good]
        largest = largest_load(good)
        clear = min(changes[-2:]) > noise * largest
        order = observed_order(sizes[-3:], changes[-2:]) if len(changes) > 1 and clear else None
        result["rms_N"] = {"to_next_finer": changes, "largest_load": largest, "order": order}
    return result


def _quantity(name: str, finest: float, good: Sequence[Level], noise: float) -> dict[str, Any]:
    # A run that stopped early has no loads from there on.
    known = {run: run.values[name] for run in good if name in (run.values or {})}  # type: ignore[index]
    observed = convergence([level.size for level in known], list(known.values()), noise)
    best = finest if observed.limit is None else observed.limit
    own = next((value for level, value in known.items() if level.factor == 1), None)
    return {
        "finest": finest,
        "order": observed.order,
        "order_one_coarser": observed.previous,
        "limit": observed.limit,
        "remark": observed.remark,
        "own_error": None if own is None else own / best - 1.0,
        "own_error_against": "finest" if observed.limit is None else "limit",
    }


def ended(runs: Sequence[Level]) -> list[Level]:
    """Return the levels that have values, coarse to fine."""
    return [run for run in runs if run.values is not None]


def largest_load(good: Sequence[Level]) -> float:
    """Return the largest load of the finest level's curve."""
    curve = good[-1].curve
    assert curve is not None
    return float(np.abs(curve[1]).max())


def rms_changes(runs: Sequence[Level]) -> list[float]:
    """Return the RMS between the curves of each level that ended well and the next finer one."""
    curves = [run.curve for run in ended(runs) if run.curve is not None]
    return [rms_between(a, b) for a, b in pairwise(curves)]


def rms_between(coarse: Curve, fine: Curve) -> float:
    """Return the RMS difference of curves at the coarse one's x, as far as the fine one goes."""
    (x, y), (fx, fy) = coarse, fine
    both = x <= fx[-1] * (1 + 1e-9)
    x = x[both]
    y = y[both]
    there = np.interp(x, np.append(0.0, fx), np.append(0.0, fy))
    return float(np.sqrt(np.mean((y - there) ** 2)))


def edge_length(mesh: Mesh) -> float:
    """Return the edge (mm) of a square of the mean area of the quads, in the plane at rest."""
    a, b, c, d = (mesh.points[mesh.quads[:, i]] for i in range(4))
    area = 0.5 * np.linalg.norm(np.cross(c - a, d - b), axis=1)
    return float(np.sqrt(area.mean()))


@checked_arguments
@alone_in_folder
def refine(
    project: Project,
    card: GivenCard | None = None,
    tests: str | Sequence[str] | None = None,
    what: Refined = "elements",
    levels: TwoOrMore = 4,
    factor: TwoOrMore = 2,
    coarser: NotNegative | None = None,
    *,
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Listener = None,
) -> Refinement:
    """Run tests with a card on finer and finer meshes, or with more and more increments.
    card : as of `profile`. tests : names or kinds, all unless given. levels : number of refinements
    of `what`. factor : edges, or increments, are divided by it from one level to the next. coarser
    : levels coarser than the project's own; 1 of elements and 0 of increments unless given.
    progress : receives every `Step`, as of `fit`. out : folder of the study, which keeps analyses
    that ended, to resume. InputError : a level that cannot be meshed, or equals another.
    OutputError. SolverFailure : fewer than two levels ended well anywhere."""
    check_unused(out, resume, overwrite)
    below = (1 if what == "elements" else 0) if coarser is None else coarser
    if below >= levels:
        raise InputError(None, "--coarser", f"expected fewer than the {levels} levels, got {below}")
    material = card_of(project, card)
    analyses = Analyses(project, progress, out, resume)
    chosen = studied_tests(project, tests)

    def size(part: StudiedModel) -> float:
        return edge_length(part.model.mesh) if what == "elements" else 1.0 / part.increments

    # All before the first run: a level that cannot be meshed is a mistake in the options.
    every = [
        {
            name: Level(part, own, size(part))
            for name, part in parts_of(project, chosen, material.thickness, what, own).items()
        }
        for own in (float(factor) ** (k - below) for k in range(levels))
    ]
    for name in every[0]:
        for coarse, fine in pairwise(own[name].size for own in every):
            if not fine < coarse * (1 - 1e-9):
                problem = "two levels come out the same: nothing is left to coarsen; use fewer"
                raise InputError(project.path, "--coarser", problem)
    analyses.total = levels * len(every[0])

    def run(level: Level) -> Level:
        """Run one level; an analysis that does not end well is a level without values."""
        part = level.part
        begun = time.perf_counter()
        studied = part.studied
        history = attempt(analyses.run, part.name, part.model, material.law, part.increments)
        # Without the keeping, and of a run that was kept earlier what it took then.
        seconds = time.perf_counter() - begun
        if isinstance(history, SolverFailure):
            return replace(level, seconds=seconds, failure=history.reason)
        return replace(
            level,
            seconds=seconds if history.seconds is None else history.seconds,
            iterations=history.iterations,
            values=studied.quantities(part.model, history),
            curve=None if studied.curve is None else studied.curve(part.model, history),
            notes=notes_of(history, material),
        )

    runs = {}
    for name, first in every[0].items():
        if not analyses.solver.external:  # it compiles on first use: once, untimed
            attempt(analyses.solver.run, first.part.model, material.law)
        runs[name] = [run(own[name]) for own in every]
    if all(len(ended(several)) < 2 for several in runs.values()):
        reason = next(r.failure for several in runs.values() for r in several if r.failure)
        raise SolverFailure(f"fewer than two levels ended well: {reason}", analyses.solver.name)
    # Result files of other programs have 6 digits.
    noise = 1e-5 if analyses.solver.external else 1e-7
    notes = tuple(other_thickness(material, project.fabric.thickness))
    named = project, card_words(card), analyses.solver.name
    return finished(Refinement(*named, what, runs, noise, notes), out)


# Poisson's ratio nu12 varied, with the moduli as they are

#: The range of coated fabrics, in equal steps.
NU12 = (0.05, 0.15, 0.25, 0.35, 0.45)


@dataclass(frozen=True, eq=False)
class Ratios:
    """A response at several nu12, (n,) each: itself, over that at the base nu12, over the mean."""

    nu12: Array
    value: Array
    to_base: Array
    to_mean: Array

    @property
    def spread(self) -> tuple[float, float]:
        """Return the lowest and highest `to_base`, less one; NaN where no run ended."""
        known = self.to_base[np.isfinite(self.to_base)]
        return (float(known.min() - 1), float(known.max() - 1)) if len(known) else (np.nan, np.nan)


def ratios(nu12: Sequence[float], values: ArrayLike, base: float) -> Ratios:
    """Return a response (n,) and its ratios; NaN where a run failed, left out of the mean."""
    v = np.asarray(values, dtype=float)
    mean = float(np.mean(v[np.isfinite(v)])) if np.isfinite(v).any() else np.nan
    return Ratios(np.asarray(nu12, dtype=float), v, v / base, v / mean)


@dataclass(frozen=True, eq=False)
class PartRatios:
    """One part of a test; response : name of their kind; failed : why a run failed, by nu12."""

    response: str
    responses: Mapping[str, Ratios]
    failed: Mapping[str, str]
    notes: Sequence[Note]


@dataclass(frozen=True, eq=False)
class Nu12Study(Presented):
    """The result of a study of nu12, by part of a test. base : the card's own nu12."""

    project: Project
    card: str
    solver: str
    base: float
    parts: Mapping[str, PartRatios]
    warnings: tuple[Note, ...] = ()

    @property
    def response(self) -> str:
        """Return the names of the kinds of responses, of all parts."""
        return " or ".join(dict.fromkeys(part.response for part in self.parts.values()))

    @property
    def result(self) -> dict[str, Any]:
        return plain_values(
            {
                "command": "study nu12",
                "project": str(self.project.path),
                "card": self.card,
                "solver": self.solver,
                "base_nu12": self.base,
                "response": self.response,
                "models": {
                    name: {
                        "responses": {
                            response: {key: own.tolist() for key, own in vars(r).items()}
                            for response, r in part.responses.items()
                        },
                        "failed": dict(part.failed),
                    }
                    for name, part in self.parts.items()
                },
                "notes": note_records(self.notes),
            }
        )

    def table(self) -> pd.DataFrame:
        """Return columns model, response, nu12, value, to_base, to_mean."""
        frames = [
            pd.DataFrame({"model": name, "response": response, **vars(r)})
            for name, part in self.parts.items()
            for response, r in part.responses.items()
        ]
        return pd.concat(frames, ignore_index=True)

    def lines(self) -> list[str]:
        words = [f"{self.response}, relative to that at nu12 = {self.base:g}"]
        named = {
            f"{n}, {k}": r for n, part in self.parts.items() for k, r in part.responses.items()
        }
        wide = max(map(len, named))
        first = next(iter(named.values()))
        words.append(" " * wide + "".join(f"{f'{v:g}':>9}" for v in first.nu12) + "   spread")
        for name, r in named.items():
            numbers = "".join(f"{v:9.4f}" for v in r.to_base)
            low, high = (100 * s for s in r.spread)
            words.append(f"{name:<{wide}}{numbers}   {low:+.1f} to {high:+.1f} %")
        return [*words, *note_lines(self.notes)]

    @property
    def notes(self) -> list[Note]:
        of_parts = [n.about(name) for name, part in self.parts.items() for n in part.notes]
        return [*of_parts, *self.warnings]


@checked_arguments
@alone_in_folder
def vary_nu12(
    project: Project,
    card: GivenCard | None = None,
    values: Sequence[float] = NU12,
    tests: str | Sequence[str] | None = None,
    *,
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Listener = None,
) -> Nu12Study:
    """Run tests with a card whose nu12 is changed; arguments and errors as of `refine`."""
    check_unused(out, resume, overwrite)
    for value in values:
        if not 0 <= value < 1:
            raise InputError(None, "--nu12", f"expected 0 <= nu12 < 1, got {value:g}")
    material = card_of(project, card)
    several = tuple(sorted(set(values)))
    analyses = Analyses(project, progress, out, resume)
    base = material.law.nu12
    parts = parts_of(project, studied_tests(project, tests), material.thickness)
    analyses.total = len(parts) * (1 + len(several))

    def run(part: StudiedModel) -> PartRatios:
        """Run a part at every value; raises SolverFailure where its own, or all, fail."""
        responses: dict[float | None, Mapping[str, float]] = {}
        failed = {}
        notes = []
        for value in (None, *several):
            nu12 = base if value is None else value
            law = replace(material.law, nu12=nu12)
            history = attempt(analyses.run, part.name, part.model, law, part.increments)
            if isinstance(history, SolverFailure):
                failed[f"{nu12:g}"] = history.reason
                if value is None or len(failed) == len(several):
                    raise history
                own = [Note(FAILED, history.reason)]
            else:
                responses[value] = part.studied.responses(part.model, history)
                own = notes_of(history, material)
            notes += [note.about(f"nu12 = {nu12:g}") for note in own]
        every = [responses.get(value, {}) for value in several]
        found = {
            name: ratios(several, [own.get(name, np.nan) for own in every], at_base)
            for name, at_base in responses[None].items()
        }
        return PartRatios(part.studied.response, found, failed, notes)

    study = Nu12Study(
        project,
        card_words(card),
        analyses.solver.name,
        base,
        {name: run(part) for name, part in parts.items()},
        tuple(other_thickness(material, project.fabric.thickness)),
    )
    return finished(study, out)
