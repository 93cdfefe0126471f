"""Studies of mesh, increments and Poisson's ratio: tests run with a card on varied models."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import NotNegative, TwoOrMore, checked_arguments
from ..errors import InputError, SolverFailure
from ..experiments.base import Refined, Test
from ..experiments.forward import notes_of, other_thickness
from ..lazy_modules import pandas as pd
from ..materials.card import MaterialCard
from ..materials.forms.base import Array
from ..meshes.mesh import Mesh
from ..notes import Note, Verdict, as_note
from ..project.project import Project
from .convergence import Convergence, convergence, observed_order
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

Curve = tuple[Array, Array]

RMS = "RMS of the load to the next finer level, N"


@dataclass(frozen=True, eq=False)
class Level:
    """Hold one refinement of a part of a test by a factor, and its run.

    Attributes
    ----------
    part : StudiedModel
    factor : float
        Refinement relative to the project's own model, which has 1.
    size : float
        Mean edge of the elements in mm, or share of the load in one increment.
    seconds : float
        Wall-clock time of the run.
    iterations : int
        Number of equilibrium iterations of the run.
    values : mapping of str to float, or None
        Quantities of interest by name; None where the run failed.
    curve : (x, y) or None
        The response, where levels are compared along one.
    failure : str
        Why the run failed, or "".
    notes : sequence of Note
    """

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
        """Return the number of quads."""
        return len(self.part.model.mesh.quads)

    @property
    def row(self) -> dict[str, Any]:
        """Return the level and the cost of its run as plain values."""
        return {
            "factor": self.factor,
            "elements": self.elements,
            "increments": self.part.increments,
            "size": self.size,
            "seconds": self.seconds,
            "iterations": self.iterations,
        }

    @property
    def numbers(self) -> dict[str, Any]:
        """Return `row` with the values, and the reason of a failure."""
        numbers = {**self.row, "values": self.values}
        if self.failure:
            numbers["failed"] = self.failure
        return numbers


#: Relative error of a quantity above which a finer mesh, or more increments, are advised.
LARGE_ERROR = 0.01


@dataclass(frozen=True, eq=False)
class Refinement(Presented):
    """Hold a convergence study of elements or increments.

    Attributes
    ----------
    project : Project
    card, solver : str
        Their names.
    refined : str
        "elements" or "increments".
    runs : mapping of str to sequence of Level
        By part of a test, coarse to fine.
    noise : float
        Relative accuracy of the solver's results, below which changes say nothing.
    warnings : tuple of Note
    """

    project: Project
    card: str
    solver: str
    refined: Refined
    runs: Mapping[str, Sequence[Level]]
    noise: float
    warnings: tuple[Note, ...] = ()

    @cached_property
    def models(self) -> dict[str, dict[str, Any]]:
        """Return by part the cost and values of each level, orders and limits as plain values."""
        return {name: _model_numbers(levels, self.noise) for name, levels in self.runs.items()}

    @property
    def errors(self) -> dict[str, float]:
        """Return, by model and quantity, the relative error at the project's own refinement."""
        return {
            f"{name}: {quantity}": numbers["own_error"]
            for name, model in self.models.items()
            for quantity, numbers in model["quantities"].items()
            if numbers["own_error"] is not None
        }

    @property
    def verdict(self) -> Verdict:
        """Return the largest error that the project's refinement leaves."""
        failed = tuple(note.line for note in self.notes if note.kind is FAILED)
        sizes = {name: abs(error) for name, error in self.errors.items()}
        if not sizes:
            step = "run it with levels that end well (--levels, --coarser)"
            words = f"the error of the project's {self.refined} is not known"
            return Verdict("not to be used", words, failed, next_step=step)
        worst = max(sizes, key=sizes.__getitem__)
        size = sizes[worst]
        step = f"compute with more {self.refined}" if size > LARGE_ERROR else ""
        return Verdict(
            "usable within limits" if failed or step else "usable",
            f"the project's {self.refined} leave errors of {100 * size:.2g} % at most ({worst})",
            failed,
            next_step=step,
        )

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the study: cost and values of each level, orders and limits."""
        return {
            "command": "study mesh",
            "project": str(self.project.path),
            "card": self.card,
            "solver": self.solver,
            "refined": self.refined,
            "models": self.models,
        }

    def table(self) -> pd.DataFrame:
        """Return the quantities of interest on all levels.

        Returns
        -------
        DataFrame
            One row per part, level and quantity: `model`, `refined`, `factor`, `elements`,
            `increments`, `size`, `seconds`, `iterations`, `quantity`, `value`, and its deviation
            from the finest level, `off_finest` and `off_finest_percent`.
        """
        table = []
        for name, levels in self.runs.items():
            for row in _level_rows(levels):
                table.append({"model": name, "refined": self.refined, **row})
        return pd.DataFrame(table)

    def result_lines(self) -> list[str]:
        """Return the results of the study as lines of the terminal."""
        lines = []
        for name, model in self.models.items():
            lines += [f"{name}: {self.refined} refined", *_model_lines(model)]
        return lines

    @property
    def notes(self) -> list[Note]:
        """Return the notes of the levels, and those of the study."""
        notes = []
        for name, levels in self.runs.items():
            for level in levels:
                size = f"{level.elements} quads"
                if self.refined == "increments":
                    size = f"{level.part.increments} increments"
                failures = [Note(FAILED, level.failure)] if level.failure else []
                remarks = [*failures, *map(as_note, level.notes)]
                notes += [note.about(f"{name}, {size}") for note in remarks]
        return [*notes, *self.warnings]


def _level_rows(levels: Sequence[Level]) -> list[dict[str, object]]:
    """Return the rows of the levels of a part in the table."""
    ended_levels = ended(levels)
    finest = (ended_levels[-1].values if ended_levels else None) or {}
    changes = rms_changes(levels)
    rows: list[dict[str, object]] = []
    for level in levels:
        for quantity, value in (level.values or {}).items():
            difference = value - finest.get(quantity, np.nan)
            rows.append(
                {
                    **level.row,
                    "quantity": quantity,
                    "value": value,
                    "off_finest": difference,
                    "off_finest_percent": 100 * difference / finest.get(quantity, np.nan),
                }
            )
        if level in ended_levels and ended_levels.index(level) < len(changes):
            rows.append({**level.row, "quantity": RMS, "value": changes[ended_levels.index(level)]})
        if level.failure:
            rows.append({**level.row, "quantity": f"failed: {level.failure}"})
    return rows


def _model_lines(model: Mapping[str, Any]) -> list[str]:
    """Return lines on the levels of a part, then order and limit of each quantity."""
    names = list(model["quantities"])[-2:]
    columns = f"{'quads':>9} {'steps':>6} {'seconds':>8}   "
    lines = [columns + "   ".join(names or [""]).rstrip()]
    lines += [_level_line(level, names) for level in model["levels"]]
    lines += [_quantity_words(*item) for item in model["quantities"].items()]
    rms = model.get("rms_N")
    if rms is not None:
        changes = ", ".join(
            "none" if np.isnan(change) else f"{change:.3g}" for change in rms["to_next_finer"]
        )
        order = "" if rms["order"] is None else f", order {rms['order']:.2f}"
        lines.append(f"  RMS of the load to the next finer level: {changes} N{order}")
    return lines


def _level_line(level: Mapping[str, Any], names: Sequence[str]) -> str:
    """Return a line on a level, with the values of the named quantities."""
    head = f"{level['elements']:9d} {level['increments']:6d} {level['seconds']:8.2f}   "
    mark = "   (the project's own)" if level["factor"] == 1 else ""
    if level["values"] is None:
        return f"{head}failed: {level['failed']}{mark}"
    cells = []
    for name in names:
        value = level["values"].get(name)
        cells.append(f"{'-' if value is None else f'{value:.7g}':<{len(name)}}")
    return (head + "   ".join(cells) + mark).rstrip()


def _quantity_words(name: str, quantity: Mapping[str, Any]) -> str:
    """Return a line on the order, the limit and the error of a quantity."""
    words = f"  {name}: {quantity['finest']:.7g} on the finest"
    if quantity["order"] is not None:
        words += f", order {quantity['order']:.2f}, limit {quantity['limit']:.7g}"
    if quantity["own_error"] is not None:
        percent = 100 * quantity["own_error"]
        against = quantity["own_error_against"]
        words += f"; the project's own is {percent:+.2g} % off the {against}"
    return words + (f" ({quantity['remark']})" if quantity["remark"] else "")


def _model_numbers(levels: Sequence[Level], noise: float) -> dict[str, Any]:
    """Return the levels of a part, and order and limit of each quantity, as plain values."""
    ended_levels = ended(levels)
    result: dict[str, Any] = {"levels": [level.numbers for level in levels], "quantities": {}}
    if len(ended_levels) < 2:
        return result
    finest = ended_levels[-1].values or {}
    result["quantities"] = {
        name: _quantity_numbers(name, value, ended_levels, noise) for name, value in finest.items()
    }
    changes = rms_changes(levels)
    if changes:
        load = largest_load(ended_levels)
        order = None
        if len(changes) > 1 and min(changes[-2:]) > noise * load:
            order = observed_order([level.size for level in ended_levels][-3:], changes[-2:])
        result["rms_N"] = {"to_next_finer": changes, "largest_load": load, "order": order}
    return result


def _quantity_numbers(
    name: str, finest: float, ended_levels: Sequence[Level], noise: float
) -> dict[str, Any]:
    """Return order, limit and error of a quantity on levels that ended, as plain values."""
    sizes = []
    values = []
    of_project = None
    for level in ended_levels:
        if level.values is None or name not in level.values:
            continue  # a run that stopped early has no loads from there on
        sizes.append(level.size)
        values.append(level.values[name])
        if level.factor == 1 and of_project is None:
            of_project = level.values[name]
    observed = convergence(sizes, values, noise)
    return {
        "finest": finest,
        "order": observed.order,
        "order_one_coarser": observed.previous,
        "limit": observed.limit,
        "remark": observed.remark,
        "own_error": _error_of_project(of_project, observed, values, noise),
        "own_error_against": "finest" if observed.limit is None else "limit",
    }


def _error_of_project(
    of_project: float | None, observed: Convergence, values: Sequence[float], noise: float
) -> float | None:
    """Return the relative error of the project's level against the limit or the finest level.

    None is returned if it is not known: of a project that is the finest level itself, unless that
    and the next coarser one agree to the accuracy of the solver.
    """
    if of_project is None:
        return None
    if observed.limit is not None:
        return of_project / observed.limit - 1.0
    changes = np.abs(np.diff(values[-2:]))
    agree = len(changes) > 0 and changes[0] <= noise * np.abs(values).max()
    if of_project == values[-1] and not agree:
        return None
    return of_project / values[-1] - 1.0


def ended(levels: Sequence[Level]) -> list[Level]:
    """Return the levels that have values, coarse to fine."""
    return [level for level in levels if level.values is not None]


def largest_load(ended_levels: Sequence[Level]) -> float:
    """Return the largest load of the finest level's curve."""
    curve = ended_levels[-1].curve
    assert curve is not None
    return float(np.abs(curve[1]).max())


def rms_changes(levels: Sequence[Level]) -> list[float]:
    """Return the RMS between the curves of each level that ended well and the next finer one."""
    curves = [level.curve for level in ended(levels) if level.curve is not None]
    return [rms_between(coarse, fine) for coarse, fine in pairwise(curves)]


def rms_between(coarse: Curve, fine: Curve) -> float:
    """Return the RMS difference of curves at the coarse one's x, as far as the fine one goes.

    It is NaN where the fine one ends before the first x of the coarse one.
    """
    x, y = coarse
    fine_x, fine_y = fine
    overlap = x <= fine_x[-1] * (1 + 1e-9)
    if not overlap.any():
        return np.nan
    y_of_fine = np.interp(x[overlap], np.append(0.0, fine_x), np.append(0.0, fine_y))
    return float(np.sqrt(np.mean((y[overlap] - y_of_fine) ** 2)))


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

    Parameters
    ----------
    project : Project
    card : MaterialCard, path or str, optional
        As in `profile`.
    tests : str or sequence of str, optional
        Names of tests, or a kind of test; by default all.
    what : str
        What is refined: "elements" or "increments".
    levels : int
        Number of levels, two or more.
    factor : int
        Factor by which edges, or load increments, get smaller from one level to the next.
    coarser : int, optional
        Number of levels coarser than the project's own; by default 1 of elements, 0 of increments.
    out : path, optional
        Folder of the study, which keeps analyses that ended, to resume.
    resume, overwrite : bool
        Go on with what the folder holds, or replace it.
    progress : callable or bool, optional
        Receives every `Step`, as in `fit`.

    Returns
    -------
    Refinement

    Raises
    ------
    InputError
        A level cannot be meshed, or equals another.
    OutputError
        The folder already holds a result.
    SolverFailure
        There is no part of a test of which two levels ended well.
    """
    check_unused(out, resume, overwrite)
    if coarser is None:
        coarser = 1 if what == "elements" else 0
    if coarser >= levels:
        problem = f"expected fewer than the {levels} levels, got {coarser}"
        raise InputError(None, "--coarser", problem)
    chosen = studied_tests(project, tests)
    material = card_of(project, card)
    analyses = Analyses(project, progress, out, resume)
    factors = [float(factor) ** (level - coarser) for level in range(levels)]
    # All levels are meshed before the first run, as one that cannot be is an error in the options.
    levels_of = _planned_levels(project, chosen, material.thickness, what, factors)
    analyses.total = levels * len(levels_of)
    study = Refinement(
        project=project,
        card=card_words(card),
        solver=analyses.solver.name,
        refined=what,
        runs=_run_levels(analyses, levels_of, material),
        noise=1e-5 if analyses.solver.external else 1e-7,  # files of other programs have 6 digits
        warnings=tuple(other_thickness(material, project.fabric.thickness)),
    )
    return finished(study, out)


def _planned_levels(
    project: Project,
    tests: Sequence[Test],
    thickness: float,
    refined: Refined,
    factors: Sequence[float],
) -> dict[str, list[Level]]:
    """Return the levels of every part of the tests, coarse to fine, before they are run."""
    levels_of: dict[str, list[Level]] = {}
    for factor in factors:
        for name, part in parts_of(project, tests, thickness, refined, factor).items():
            if refined == "elements":
                size = edge_length(part.model.mesh)
            else:
                size = 1.0 / part.increments
            levels_of.setdefault(name, []).append(Level(part, factor, size))
    for levels in levels_of.values():
        for coarse, fine in pairwise(levels):
            if not fine.size < coarse.size * (1 - 1e-9):
                problem = "two levels come out the same: nothing is left to coarsen; use fewer"
                raise InputError(project.path, "--coarser", problem)
    return levels_of


def _run_levels(
    analyses: Analyses, levels_of: Mapping[str, Sequence[Level]], material: MaterialCard
) -> dict[str, list[Level]]:
    """Run all levels of every part; SolverFailure where no part has two that ended well."""
    runs = {}
    for name, planned in levels_of.items():
        if not analyses.solver.external:  # it compiles at its first run, which is not timed
            attempt(analyses.solver.run, planned[0].part.model, material.law)
        runs[name] = [_run_level(analyses, level, material) for level in planned]
    if all(len(ended(of_part)) < 2 for of_part in runs.values()):
        failures = [level.failure for of_part in runs.values() for level in of_part]
        reason = next(failure for failure in failures if failure)
        raise SolverFailure(f"fewer than two levels ended well: {reason}", analyses.solver.name)
    return runs


def _run_level(analyses: Analyses, level: Level, material: MaterialCard) -> Level:
    """Run one level; an analysis that does not end well is a level without values."""
    part = level.part
    studied = part.studied
    start_time = time.perf_counter()
    history = attempt(analyses.run, part.name, part.model, material.law, part.increments)
    # This time includes writing the analysis; the history has its own time, also of a kept one.
    seconds = time.perf_counter() - start_time
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


# Variation of Poisson's ratio nu12 with the moduli held ------------------------------------------

#: Values of nu12 over the range of coated fabrics, in equal steps.
NU12 = (0.05, 0.15, 0.25, 0.35, 0.45)


@dataclass(frozen=True, eq=False)
class Ratios:
    """Hold a response of a test at several values of nu12.

    Attributes
    ----------
    nu12, value : (n,) arrays
        Poisson's ratios, and the response at each.
    to_base, to_mean : (n,) arrays
        The response divided by that at the card's nu12, and by the mean over all nu12.
    """

    nu12: Array
    value: Array
    to_base: Array
    to_mean: Array

    @property
    def spread(self) -> tuple[float, float]:
        """Return the least and the largest relative change of the response; NaN if no run ended."""
        ratios_of_runs = self.to_base[np.isfinite(self.to_base)]
        if not len(ratios_of_runs):
            return np.nan, np.nan
        return ratios_of_runs.min() - 1, ratios_of_runs.max() - 1


def ratios(nu12: Sequence[float], values: ArrayLike, base: float) -> Ratios:
    """Return a response at each nu12 with its ratios to `base` and mean; NaN where a run failed."""
    responses = np.asarray(values, dtype=float)
    is_finite = np.isfinite(responses)
    mean = np.mean(responses[is_finite]) if is_finite.any() else np.nan
    return Ratios(np.asarray(nu12, dtype=float), responses, responses / base, responses / mean)


@dataclass(frozen=True, eq=False)
class PartRatios:
    """Hold the responses of one part of a test at several values of nu12.

    Attributes
    ----------
    response : str
        Name of the kind of response, such as an apex height or a load.
    responses : mapping of str to Ratios
        By name of the response.
    failed : mapping of str to str
        Why a run failed, by nu12.
    notes : sequence of Note
    """

    response: str
    responses: Mapping[str, Ratios]
    failed: Mapping[str, str]
    notes: Sequence[Note]

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the responses, and the reasons of failures."""
        return {"responses": self.responses, "failed": self.failed}


@dataclass(frozen=True, eq=False)
class Nu12Study(Presented):
    """Hold the result of a study of nu12.

    Attributes
    ----------
    project : Project
    card, solver : str
        Their names.
    base : float
        The card's own nu12.
    parts : mapping of str to PartRatios
        By part of a test.
    warnings : tuple of Note
    """

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
    def verdict(self) -> Verdict:
        """Return by how much nu12 changes the responses."""
        spreads = [r.spread for part in self.parts.values() for r in part.responses.values()]
        failed = tuple(
            f"{name} failed at nu12 = {value}"
            for name, part in self.parts.items()
            for value in part.failed
        )
        low = np.nanmin(spreads)
        high = np.nanmax(spreads)
        return Verdict(
            "usable within limits" if failed else "usable",
            f"nu12 changes the {self.response} by {100 * low:+.1f} to {100 * high:+.1f} %",
            failed,
        )

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the study."""
        return {
            "command": "study nu12",
            "project": str(self.project.path),
            "card": self.card,
            "solver": self.solver,
            "base_nu12": self.base,
            "response": self.response,
            "models": {name: part.numbers for name, part in self.parts.items()},
        }

    def table(self) -> pd.DataFrame:
        """Return the responses at all values of nu12.

        Returns
        -------
        DataFrame
            One row per part, response and nu12: `model`, `response`, `nu12`, `value`, `to_base`,
            `to_mean`.
        """
        tables = [
            pd.DataFrame({"model": name, "response": response, **vars(of_response)})
            for name, part in self.parts.items()
            for response, of_response in part.responses.items()
        ]
        return pd.concat(tables, ignore_index=True)

    def result_lines(self) -> list[str]:
        """Return the results of the study as lines of the terminal."""
        ratios_by_title = {
            f"{name}, {response}": of_response
            for name, part in self.parts.items()
            for response, of_response in part.responses.items()
        }
        width = max(map(len, ratios_by_title))
        first = next(iter(ratios_by_title.values()))
        head = " " * width + "".join(f"{f'{nu12:g}':>9}" for nu12 in first.nu12) + "   spread"
        lines = [f"{self.response}, relative to that at nu12 = {self.base:g}", head]
        for title, of_response in ratios_by_title.items():
            numbers = "".join(f"{ratio:9.4f}" for ratio in of_response.to_base)
            low, high = (100 * end for end in of_response.spread)
            lines.append(f"{title:<{width}}{numbers}   {low:+.1f} to {high:+.1f} %")
        return lines

    @property
    def notes(self) -> list[Note]:
        """Return the notes of the parts, and those of the study."""
        notes = []
        for name, part in self.parts.items():
            notes += [note.about(name) for note in part.notes]
        return [*notes, *self.warnings]


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
    """Run tests with a card at several values of nu12, its moduli unchanged.

    Parameters
    ----------
    project : Project
    card, tests, out, resume, overwrite, progress
        As in `refine`.
    values : sequence of float
        Values of nu12, from 0 to below 1.

    Returns
    -------
    Nu12Study

    Raises
    ------
    InputError
        A value is not from 0 to below 1; otherwise as in `refine`.
    OutputError
        The folder already holds a result.
    SolverFailure
        The run of a part with the card, or those with all values, did not end well.
    """
    check_unused(out, resume, overwrite)
    for value in values:
        if not 0 <= value < 1:
            raise InputError(None, "--nu12", f"expected 0 <= nu12 < 1, got {value:g}")
    material = card_of(project, card)
    values = sorted(set(values))
    analyses = Analyses(project, progress, out, resume)
    parts = parts_of(project, studied_tests(project, tests), material.thickness)
    analyses.total = len(parts) * (1 + len(values))  # the first run of each has the card's own
    study = Nu12Study(
        project=project,
        card=card_words(card),
        solver=analyses.solver.name,
        base=material.law.nu12,
        parts={name: _vary_part(analyses, part, material, values) for name, part in parts.items()},
        warnings=tuple(other_thickness(material, project.fabric.thickness)),
    )
    return finished(study, out)


def _vary_part(
    analyses: Analyses, part: StudiedModel, material: MaterialCard, values: Sequence[float]
) -> PartRatios:
    """Run a part at every value; raises SolverFailure where that with the card, or all, fail."""
    base_responses: Mapping[str, float] = {}
    responses = []
    failed: dict[str, str] = {}
    notes = []
    for value in (None, *values):  # None: the card's own
        nu12 = material.law.nu12 if value is None else value
        law = replace(material.law, nu12=nu12)
        history = attempt(analyses.run, part.name, part.model, law, part.increments)
        run_responses: Mapping[str, float] = {}
        if isinstance(history, SolverFailure):
            failed[f"{nu12:g}"] = history.reason
            if value is None or len(failed) == len(values):
                raise history
            remarks = [Note(FAILED, history.reason)]
        else:
            run_responses = part.studied.responses(part.model, history)
            remarks = notes_of(history, material)
        notes += [note.about(f"nu12 = {nu12:g}") for note in remarks]
        if value is None:
            base_responses = run_responses
        else:
            responses.append(run_responses)
    ratios_by_name = {
        name: ratios(values, [run_responses.get(name, np.nan) for run_responses in responses], base)
        for name, base in base_responses.items()
    }
    return PartRatios(part.studied.response, ratios_by_name, failed, notes)
