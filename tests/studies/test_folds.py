"""Folds: a fit is not given the points left out, and is judged at those."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.errors import NoFeasibleStart
from bubblefit.project.project import read_project
from bubblefit.runs import compare as room
from bubblefit.runs.compare import FoldError, folds, validate
from bubblefit.runs.setup import prepare_fit

#: Without contraction the load is the fabric's 0.8 mm times 25 mm times E ln(1 + elongation / 20).
PROJECT = """
[fabric]
thickness = 0.8
[law]
form = "constant"
nu12 = 0.0
strain_range = [0.14, 0.14, 0.1]
[law.bounds]
E1 = [0.02, 2.0]
E2 = [0.02, 1.0]
G12 = [0.005, 0.2]
[[strips]]
increments = 4
match = "points"
warp = { gauge_length = 20, final_length = 22.9 }
fill = { gauge_length = 20, final_length = 22.9 }
[strips.data]
files = ["points.csv"]
"""
#: MPa, of two specimens a direction; each fits a constant modulus exactly.
MODULI = {"warp": (300.0, 360.0), "fill": (200.0, 180.0)}
ELONGATION = np.linspace(0.2, 2.9, 8)


def test_a_fold_errs_by_what_the_specimens_differ_by(tmp_path: Path) -> None:
    """A fit of one specimen is wrong by the other's difference; one of both by half of it."""
    lines, strain = ["direction,specimen,elongation (mm),load (N)"], np.log1p(ELONGATION / 20)
    for direction, moduli in MODULI.items():
        for specimen, modulus in zip("ab", moduli, strict=True):
            loads = 20 * modulus * strain
            lines += [
                f"{direction},{specimen},{u!r},{load!r}"
                for u, load in zip(ELONGATION.tolist(), loads.tolist(), strict=True)
            ]
    (tmp_path / "points.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "project.toml").write_text(PROJECT)
    project = read_project(tmp_path / "project.toml")
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    folds = [fold for fold in validate(setup, 5, 1) if fold is not None]
    # As many as specimens, whichever of two processes is first.
    assert sorted(fold.fold for fold in folds) == [0, 1]
    root_mean_square = float(np.sqrt(np.mean(strain**2)))
    for fold in folds:
        expected = {f"strips: {d}": 20 * abs(a - b) * root_mean_square
                    for d, (a, b) in MODULI.items()}  # fmt: skip
        assert fold.rms == pytest.approx(expected, rel=1e-3)
        assert fold.value == pytest.approx(sum(expected.values()), rel=1e-3)


def setup_of(**specimens: list[int]) -> Any:
    """As much of a fit as its folds look at."""
    return SimpleNamespace(
        tests=[SimpleNamespace(specimens=specimens)],
        project=SimpleNamespace(fit=SimpleNamespace(seed=3)),
        options="options",
    )


@pytest.mark.parametrize(
    ("specimens", "count"),
    [
        # No more than the fewest specimens; a single one loses points, as many as are asked for.
        ({"warp": [0, 0, 1, 2], "fill": [4, 5, 5, 6, 7]}, 3),
        ({"warp": [0] * 6, "fill": [0, 1, 2, 3, 4, 5]}, 5),
        ({"warp": [0] * 6}, 5),
        ({"warp": [0, 1] * 3, "fill": [0] * 3}, 2),
    ],
)
def test_how_many_folds(specimens: dict[str, list[int]], count: int) -> None:
    assert len(folds(setup_of(**specimens), 5)) == count


def test_the_best_start_of_a_fold_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some starts fail, or are none; the others go on."""
    ends: list[Any] = [3.0, None, NoFeasibleStart("none"), 1.0, 2.0]
    drawn: list[tuple[int, int]] = []
    reset: list[int] = []

    def feasible_start(problem: Any, seed: int, number: int) -> int:
        drawn.append((seed, number))
        if isinstance(ends[number], NoFeasibleStart):
            raise ends[number]
        return number

    def fit_from(problem: Any, start: int, options: Any) -> Any:
        assert options == "options"
        value, best = ends[start], SimpleNamespace(unknowns=f"of start {start}")
        return None if value is None else SimpleNamespace(value=value, best=best)

    monkeypatch.setattr(room, "feasible_start", feasible_start)
    monkeypatch.setattr(room, "fit_from", fit_from)
    problem: Any = SimpleNamespace(reset=lambda: reset.append(1))
    assert room.best_of(setup_of(), problem, 5) == "of start 3"
    assert drawn == [(3, number) for number in range(5)] and len(reset) == 5
    assert room.best_of(setup_of(), problem, 3) == "of start 0"
    ends[0] = None
    assert room.best_of(setup_of(), problem, 3) is None


def test_a_fold_without_a_fit_or_an_analysis(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is left out is what is judged, of the comparisons that lose points, from rest."""
    mask, asked = np.array([True, False]), []

    class Whole:
        comparisons = (SimpleNamespace(name="bubble"), SimpleNamespace(name="warp"))

        def part(self, numbers: list[int]) -> Any:
            asked.append(numbers)
            return SimpleNamespace(evaluate=lambda *a, **named: asked.append((a, named)))

    def problem(masks: Any) -> Whole:
        asked.append({name: own.tolist() for name, own in masks.items()})
        return Whole()

    own = SimpleNamespace(problem=problem)
    monkeypatch.setattr(room, "fit_of", lambda *_: (own, None))
    assert room._fold(setup_of(), 4, {"warp": mask}, 1) == FoldError(4, None, {}) and not asked
    monkeypatch.setattr(room, "fit_of", lambda *_: (own, "unknowns"))
    assert room._fold(setup_of(), 4, {"warp": mask}, 1) == FoldError(4, None, {})
    assert asked == [{"warp": [False, True]}, [1], (("unknowns", False), {"warm": False})]
