"""Starts coarse to fine: what runs on which mesh, what counts as one optimum, and going on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.cli.fits import lines_of
from bubblefit.cli.progress import FitsProgress, StudyProgress
from bubblefit.errors import InputError
from bubblefit.experiments.kinds import Weighting
from bubblefit.runs import fit as stages
from bubblefit.runs.fit import distinct, moduli_apart, one_fit
from bubblefit.runs.setup import coarse_problem
from bubblefit.runs.starts import Stage, StartRecord

from ..commands import result_in
from ..projects import BUBBLE, constant_strips, project_file

STARTS = 3


def project(folder: Path, *changes: tuple[str, str]) -> bf.Project:
    """A quarter bubble of 48 quads, 12 on the coarse mesh, its data of its own model."""
    finer = ("elements = 32", "elements = 192")
    path = project_file(folder, f"{BUBBLE}\n[fit]\ncoarse_to_fine = true\n", finer, *changes)
    return bf.read_project(path).with_fit(starts=STARTS, jobs=1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("stages")


@pytest.fixture(scope="module")
def fitted(folder: Path) -> bf.Fit:
    fit = bf.fit(project(folder), out=folder / "out")
    fit.report(folder / "out")
    return fit


def test_one_start_of_an_optimum_goes_on_to_the_full_mesh(fitted: bf.Fit) -> None:
    """The known answer, though coarse quads leave what they cannot follow."""
    first, *others = fitted.best.records
    assert [r.number for r in (first, *others)] == list(range(STARTS))
    assert first.same_as is None and [r.same_as for r in others] == [0] * (STARTS - 1)
    for record in fitted.best.records:
        assert record.objective == fitted.objective < 1e-6 < 1e-2 < record.coarse_objective
        assert record.coarse_analyses > 3
    # From so near an optimum few analyses are left.
    assert 1 < first.analyses - first.coarse_analyses < 8
    assert all(r.analyses == r.coarse_analyses for r in others)
    assert [r.status for r in others] == ["as start 0"] * (STARTS - 1)
    assert len(fitted.laws) == 1
    error = fitted.result["moduli_error"]
    assert max(error.values()) < 1e-3


def test_every_place_says_what_ran_where(fitted: bf.Fit, folder: Path) -> None:
    history = pd.read_csv(folder / "out" / "history.csv")
    records = fitted.best.records
    for record in records:
        own = history[history["start"] == record.number]
        assert list(own["analysis"]) == list(range(1, record.analyses + 1))
        assert (own["mesh"] == "coarse").sum() == record.coarse_analyses
        assert (own["mesh"][: record.coarse_analyses] == "coarse").all()
    result = result_in(folder / "out")
    coarse = int((history["mesh"] == "coarse").sum())
    assert result["coarse_to_fine"] == {
        "quads": {"bubble": {"coarse": 12, "full": 48}},
        "starts": STARTS,
        "distinct": 1,
        "coarse_analyses": coarse,
        "full_analyses": len(history) - coarse,
    }
    table = fitted.starts()
    for name in ("coarse_objective", "coarse_analyses", "same_as"):
        assert [s[name] for s in result["starts"]] == [getattr(r, name) for r in records]
        assert name in table.columns
    words = (
        f"3 starts on the coarse mesh (bubble 12 of 48 quads; {coarse} analyses), "
        f"1 distinct of their optima on the full one ({len(history) - coarse})"
    )
    assert words in (folder / "out" / "report.html").read_text()
    assert f"coarse to fine: {words}" in lines_of(fitted, folder)


def when_it_is(mesh: str, analyses: int) -> Callable[[Any], None]:
    """Interrupts once so many analyses of the last start ran on a mesh."""
    seen: list[Any] = []

    def tell(event: Any) -> None:
        if getattr(event, "analysis", None) is not None and event.mesh == mesh:
            seen.append(event)
            if len(seen) == analyses:
                raise KeyboardInterrupt

    return tell


@pytest.mark.parametrize("mesh, analyses", [("coarse", 18), ("full", 2)])
def test_interrupted_in_either_stage_it_ends_the_same(
    fitted: bf.Fit, folder: Path, tmp_path: Path, mesh: str, analyses: int
) -> None:
    with pytest.raises(KeyboardInterrupt):
        bf.fit(fitted.project, out=tmp_path / "out", progress=when_it_is(mesh, analyses))
    assert not (tmp_path / "out" / "result.json").exists()
    told: list[Any] = []
    again = bf.fit(fitted.project, out=tmp_path / "out", resume=True, progress=told.append)
    ended = [e.analyses for e in told if isinstance(e, StartRecord) and e.mesh == "coarse"]
    ran = [e for e in told if getattr(e, "mesh", "") == "coarse" and hasattr(e, "analysis")]
    assert sorted(ended) == sorted(r.coarse_analyses for r in fitted.best.records)
    assert len(ran) < sum(ended)  # what had ended was not run again
    for name in ("history.csv",):
        assert (tmp_path / "out" / name).read_text() == (folder / "out" / name).read_text()
    for key in ("starts", "coarse_to_fine", "beta", "objective"):
        assert again.result[key] == fitted.result[key]


def test_it_is_the_optimum_of_the_full_way(fitted: bf.Fit) -> None:
    full = bf.fit(fitted.project.with_fit(coarse_to_fine=False, starts=1))
    assert full.objective < 1e-6
    assert moduli_apart(fitted.problem, full.best.ranked[0], fitted.best.ranked[0]) < 1e-3
    assert full.stages == "" and full.coarse_to_fine is None
    assert full.result["coarse_to_fine"] is None and "same_as" not in full.result["starts"][0]


def test_without_a_coarser_mesh_every_start_runs_on_the_full_one(tmp_path: Path) -> None:
    fit = bf.fit(project(tmp_path, ("elements = 192", "elements = 48")).with_fit(starts=1))
    assert fit.coarse_to_fine is None and [r.mesh for r in fit.best.records] == ["full"]
    assert fit.stages == "no test has a coarser mesh: every start ran on the full one"


# Comparisons on a coarser mesh


def test_the_same_data_on_larger_quads(fitted: bf.Fit) -> None:
    """Row by row; what larger quads do to displacements is small beside them."""
    setup = fitted.setup
    coarse, full = coarse_problem(setup), setup.problem()
    assert coarse is not None
    (few,), (many,) = coarse.comparisons, full.comparisons
    assert (len(few.model.mesh.quads), len(many.model.mesh.quads)) == (12, 48)
    assert few.model.increments == many.model.increments
    y = full.unknowns.at(fitted.law.beta[list(full.unknowns.free)])
    point = coarse.evaluate(y, True)
    assert point is not None and point.jacobian.shape == (len(full.scale), 3)
    off = np.abs(point.residual * full.scale)
    assert 1e-3 < off.max() < 2.0  # mm, of an apex of 20 mm


def test_too_few_quads_are_no_disk(tmp_path: Path) -> None:
    prepared = bf.fit(project(tmp_path).with_fit(starts=1)).setup.tests[0]
    with pytest.raises(InputError, match="12 quads are too few for a disk"):
        prepared.finer(lambda name=None: None, Weighting(), 0.25)


def test_strips_coarsen_too(tmp_path: Path) -> None:
    settings = bf.read_project(constant_strips(tmp_path)).with_fit(coarse_to_fine=True)
    fit = bf.fit(settings, jobs=1)
    quads = fit.coarse_to_fine.quads
    assert set(quads) == {"one: warp", "one: fill", "two: warp"}
    assert all(coarse < full for coarse, full in quads.values())
    # Straight strips are homogeneous: their optimum is that of any mesh.
    for record in fit.best.records:
        assert record.objective == pytest.approx(record.coarse_objective, rel=1e-6)


# What counts as one optimum


def ended(fit: bf.Fit, number: int, value: float | None, moduli: Any = (80.0, 400.0, 800.0)) -> Any:
    """A start that ended with moduli (G12, E2, E1) in MPa."""
    unknowns = tuple(fit.problem.unknowns.at(np.array(moduli)).tolist())
    return StartRecord(
        number, (1, number), value, "", 5, () if value is None else unknowns, (), 0.1,
        reached=(0.05, 0.05, 0.05), mesh="coarse",
    )  # fmt: skip


def numbers(groups: Any) -> list[list[int]]:
    return [[record.number for record in group] for group in groups]


def test_optima_are_told_apart_by_moduli_and_by_what_they_leave(fitted: bf.Fit) -> None:
    records = [
        ended(fitted, 4, 0.2005, (81.5, 400.0, 800.0)),  # G12 1.9 % off: the same
        ended(fitted, 1, 0.2, (80.0, 400.0, 800.0)),
        ended(fitted, 2, 0.2, (80.0, 409.0, 800.0)),  # E2 2.25 % off
        ended(fitted, 3, 0.203, (80.0, 400.0, 800.0)),  # leaves 1.5 % more
        ended(fitted, 5, None),
        ended(fitted, 6, None),
    ]
    groups = distinct(fitted.problem, records, 1e-7)
    assert numbers(groups) == [[1, 4], [2], [3], [5], [6]]
    # Below the tolerance nothing that is left tells them apart.
    fine = [ended(fitted, 0, 1e-9), ended(fitted, 1, 9e-8)]
    assert numbers(distinct(fitted.problem, fine, 1e-7)) == [[0, 1]]
    assert numbers(distinct(fitted.problem, fine, 1e-8)) == [[0], [1]]


def test_moduli_are_compared_up_to_what_either_optimum_reached(fitted: bf.Fit) -> None:
    a, b = ended(fitted, 0, 0.1), ended(fitted, 1, 0.1, (80.0, 400.0, 816.0))
    assert moduli_apart(fitted.problem, b, a) == pytest.approx(0.02)


def test_the_next_of_a_group_is_tried_where_the_first_fails(
    fitted: bf.Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[Any] = []

    def run_start(
        problem: Any, options: Any, seed: int, number: int, tell: Any, coarse: Any
    ) -> Any:
        begun.append((number, coarse.number))
        return replace(coarse, mesh="full", objective=None if number < fails else 0.0)

    monkeypatch.setattr(stages, "run_start", run_start)
    group = [ended(fitted, n, 0.2) for n in (3, 5, 8)]
    for fails, tried in ((0, [3]), (4, [3, 5]), (99, [3, 5, 8])):
        begun.clear()
        told: list[Any] = []
        last = stages._going_on(fitted.setup, [group])(0, told.append)
        assert begun == [(n, n) for n in tried]
        full = {r.number: r for r in (*told, last)}
        assert sorted(full) == tried
        own = list(one_fit(group, full))
        assert [r.number for r in own] == [3, 5, 8]
        if fails == 99:
            assert [r.objective for r in own] == [None] * 3
        else:
            assert [r.same_as for r in own] == [None] * len(tried) + [tried[-1]] * (3 - len(tried))
            assert own[-1].objective == 0.0 and own[-1].coarse_objective == 0.2


# Progress


def said(progress: StudyProgress) -> tuple[str, int, int, str]:
    return progress.what, progress.done, progress.total, progress.note().split(",")[0]


def test_progress_counts_each_stage_and_forgets_the_other_meshs_objective(fitted: bf.Fit) -> None:
    def events() -> Iterator[Any]:
        yield Stage("starts on the coarse mesh", 2)
        yield ended(fitted, 0, 0.5)
        yield ended(fitted, 1, 0.25)
        yield Stage("distinct optima on the full mesh", 1)

    progress = FitsProgress(2, quiet=True)
    heard = []
    for event in events():
        progress.saw(event)
        heard.append(said(progress))
    assert heard == [
        ("starts on the coarse mesh", 0, 2, "no analysis yet"),
        ("starts on the coarse mesh", 1, 2, "best 0.5"),
        ("starts on the coarse mesh", 2, 2, "best 0.25"),
        ("distinct optima on the full mesh", 0, 1, "no analysis yet"),
    ]
    progress.saw("the next fit")
    assert said(progress) == ("starts", 0, 2, "no analysis yet")
