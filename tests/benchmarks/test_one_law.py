"""What bench_one_law.py makes of a fit: rows that have not converged, independent values."""

from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.notes import Note
from bubblefit.runs.verdict import NOT_CONVERGED

from ..support.paths import load_script

bench = load_script("benchmarks/bench_one_law.py")

SIZES = {"strips: warp": 40, "bubble": 60}
SCALE = {"strips: warp": 5.0, "bubble": 0.2}


def record_of(correlated_count, notes=()):
    """Return a fit of two comparisons whose residuals are 0.1 and -0.1 in turn."""
    ends = np.cumsum([0, *SIZES.values()])
    comparisons = [
        SimpleNamespace(name=name, objective=SimpleNamespace(scale=np.full(size, SCALE[name])))
        for name, size in SIZES.items()
    ]
    noise = SimpleNamespace(correlated_count=correlated_count)
    point = SimpleNamespace(
        unknowns=np.zeros(3), residual=np.resize([0.1, -0.1], sum(SIZES.values()))
    )
    numbers = {"strips": {"e_uniaxial_N": 2.0}, "bubble": {"mean_abs_mm": 2.254}}
    return SimpleNamespace(
        best=SimpleNamespace(point=point, certainty=SimpleNamespace(noise=noise)),
        problem=SimpleNamespace(
            comparisons=comparisons, rows=lambda k: slice(int(ends[k]), int(ends[k + 1]))
        ),
        findings={name: SimpleNamespace(numbers=values) for name, values in numbers.items()},
        result={"analyses": 80},
        notes=list(notes),
        law=None,
    )


def criterion_by_hand(counts):
    strips, bubble = counts
    logarithms = strips * np.log(0.5**2) + bubble * np.log(0.02**2)
    return logarithms + 3 * np.log(strips + bubble)


def test_correlated_values_count_as_one_in_the_information_criterion():
    independent = record_of({"strips: warp": 1.0, "bubble": 1.0})
    assert bench.criterion(independent) == pytest.approx(criterion_by_hand((40.0, 60.0)))
    correlated = record_of({"strips: warp": 4.0, "bubble": 12.0})
    assert bench.criterion(correlated) == pytest.approx(criterion_by_hand((10.0, 5.0)))


def test_row_of_a_fit_that_has_not_converged_says_so(monkeypatch):
    monkeypatch.setattr(bench, "moduli", lambda law: "moduli")
    counts = {"strips: warp": 1.0, "bubble": 1.0}
    converged = bench.words(record_of(counts), 2.5)
    assert converged.startswith("strips 2.0 N (scatter 2.5), bubble 2.254 mm; moduli; 3 unknowns")
    stopped = bench.words(record_of(counts, [Note(NOT_CONVERGED, "80 analyses")]), 2.5)
    assert stopped == f"NOT CONVERGED: {converged}"
