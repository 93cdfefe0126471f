"""Which figures and files cylinders have, what they are called, and what is drawn in them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.cylinder import report as figures
from bubblefit.experiments.cylinder.predicted import CylinderOutcome
from bubblefit.experiments.kinds import Output
from bubblefit.readers.bending import BendingCurve

from ...drawings import caught
from .test_page import BENT, WAY, case, run
from .test_tables import MEASURES

#: The second one ends half-way.
READ = (BendingCurve("1", WAY, 2 * WAY), BendingCurve("2", WAY[:2], 2 * WAY[:2] + 4.0))


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[Any]]:
    calls: dict[str, list[Any]] = {"draw_beam": [], "write_beam": []}
    for name, found in calls.items():
        monkeypatch.setattr(figures, name, lambda *what, own=found: own.append(what))
    return {**calls, "saved": caught(monkeypatch, figures, "bending_charts", "gas_charts")}


def outcome(*runs: Any, bent: tuple[int, ...]) -> CylinderOutcome:
    for one in runs:
        one.model = f"model of {one.test.name}"
    found = CylinderOutcome(runs)
    found.__dict__["bent"] = {i: replace(BENT, load=BENT.load + i) for i in bent}
    found.__dict__["measures"] = {
        i: replace(MEASURES, knee=(1.0 + i, 2.0), error=None if i else MEASURES.error) for i in bent
    }
    return found


def test_figures_of_every_test(tmp_path: Path, drawn) -> None:
    first, second = case("a b", measured=READ), case("a/b", 200.0)
    failed = case("broken")
    found = outcome(
        run(first, "soft"), run(second, "stiff"), run(first, "stiff"), run(failed, "soft"),
        bent=(0, 1, 2),
    )  # fmt: skip
    shown = figures.draw_figures(found, Output(tmp_path, "c/"))
    assert shown == [
        ("c/figures/a-b-beam.png", "a b: the bent beam, card soft"),
        ("c/figures/a-b-gas.png", "a b: the gas while bending"),
        ("c/figures/a-b-2-beam.png", "a/b: the bent beam, card stiff"),
        ("c/figures/a-b-2-gas.png", "a/b: the gas while bending"),
    ]
    (path, (panel,)), gas, (_, (other,)), more, all_loads = drawn["saved"]
    assert path == tmp_path / "c/figures/a-b-load.png"
    assert [path.name for path, _ in (gas, more)] == ["a-b-gas.png", "a-b-2-gas.png"]
    assert [(line.name, line.rank) for line in panel.lines] == [("soft", 0), ("stiff", 1)]
    assert [(line.name, line.rank) for line in other.lines] == [("stiff", 1)]
    one, two = panel.lines
    assert one.load.tolist() == BENT.load.tolist() and two.load[0] == BENT.load[0] + 2
    assert (one.deflection is BENT.deflection) and one.pressure is BENT.pressure
    assert one.volume is BENT.volume and (one.rms, two.rms) == (3.1, None)
    assert (one.knee, two.knee, one.limit) == ((1.0, 2.0), (3.0, 2.0), MEASURES.limit)
    assert [beam[3] for beam in drawn["draw_beam"]] == ["a b, soft, 80 mm", "a/b, stiff, 80 mm"]
    assert drawn["draw_beam"][0][0] == "model of a b"
    # Mean and scatter as far as all repetitions go.
    readings = panel.measured
    assert [load.tolist() for _, load in readings.readings] == [c.load.tolist() for c in READ]
    whole = readings.deflection <= 40.0 + 1e-9
    np.testing.assert_array_equal(np.isfinite(readings.mean), whole)
    np.testing.assert_array_equal(np.isfinite(readings.deviation), whole)
    np.testing.assert_allclose(readings.mean[whole], 2 * readings.deflection[whole] + 2.0)
    np.testing.assert_allclose(readings.deviation[whole], np.sqrt(8.0))
    assert other.measured is None
    path, laid = all_loads
    assert path == tmp_path / "c/figures/all-loads.png" and len(laid) == 4
    assert [panel.title for panel in laid] == ["a b", "broken", "a/b", ""]


def test_one_test_has_no_figure_of_all(tmp_path: Path, drawn) -> None:
    both = outcome(run(case("a"), "soft"), run(case("b"), "soft"), bent=(0,))
    assert len(figures.draw_figures(both, Output(tmp_path))) == 2
    assert [path.name for path, _ in drawn["saved"]] == ["a-load.png", "a-gas.png"]


@pytest.mark.parametrize(
    ("diameters", "rows"),
    [
        ((150.0, 150.0, 200.0), [2, 1]),
        ((150.0, 200.0, 150.0 + 1e-8), [2, 1]),
        ((150.0, 150.0, 150.0, 150.0), [3, 1]),
        ((150.0, 200.0, 250.0, 300.0), [3, 1]),
        ((150.0, 200.0, 250.0), [3]),
        ((150.0,), [1]),
    ],
)
def test_rows_of_a_figure_of_all(diameters: tuple[float, ...], rows: list[int]) -> None:
    tests: Any = [case(str(k), diameter) for k, diameter in enumerate(diameters)]
    found = figures._rows(tests)
    assert [len(row) for row in found] == rows
    assert sorted(test.name for row in found for test in row) == [t.name for t in tests]


def test_beams_for_paraview(tmp_path: Path, drawn) -> None:
    first = case("a b")
    found = outcome(
        run(first, "soft card"), run(case("c"), "soft card"), run(first, "x"), bent=(0, 2)
    )
    assert figures.write_beams(found, Output(tmp_path, "o-")) == [
        ("o-beams/a-b-soft-card.vtu", "the beam at 80 mm, for ParaView"),
        ("o-beams/a-b-x.vtu", "the beam at 80 mm, for ParaView"),
    ]
    assert [path.name for _, _, path in drawn["write_beam"]] == ["a-b-soft-card.vtu", "a-b-x.vtu"]
    assert [bent.load[0] for _, bent, _ in drawn["write_beam"]] == [BENT.load[0], BENT.load[0] + 2]
