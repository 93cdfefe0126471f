"""reports/kinds/strips.py: numbers and figures of strips."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.base import DIRECTIONS_MISSED, UNMATCHED
from bubblefit.experiments.data_files import READING, Output
from bubblefit.experiments.forward import CardRun
from bubblefit.experiments.measured import FittedPart
from bubblefit.experiments.strips.data import Strip
from bubblefit.experiments.strips.load_objective import LoadObjective
from bubblefit.materials.forms.polynomial import CONSTANT
from bubblefit.materials.forms.symmetry import symmetric
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.notes import GRAVE
from bubblefit.project.project import read_project
from bubblefit.reports.kinds import strips as report
from bubblefit.reports.kinds.strips import LEFT_OUT, POISSON, rms_of_loads
from bubblefit.solvers.base import History

from ...builders.projects import constant_strips
from ...builders.strip_tests import BIAS, WARP, notes_on_directions
from ...support.charts import caught


def test_shear_is_that_of_the_quads_between_the_gauge_points(monkeypatch):
    """A row of quads, 10 mm long, from -20 mm on, between gauge points at -10 and 10 mm."""
    shear = [0.9, 0.2, -0.3, 0.8]
    points = np.array([[x, y, 0.0] for y in (-20.0, -10.0, 0.0, 10.0, 20.0) for x in (0.0, 5.0)])
    quads = np.array([[2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2] for k in range(4)])
    mesh = SimpleNamespace(points=points, quads=quads, node_sets={"gauge": [2, 6]})
    model = SimpleNamespace(mesh=mesh, warp="warp")
    history = SimpleNamespace(displacement=np.array([0 * points, 0 * points + 1]))
    strain = np.column_stack([np.ones(4), np.ones(4), shear])

    def middle(of, u, warp):
        assert of is mesh and warp == "warp" and (u == 1.0).all()
        return strain

    monkeypatch.setattr(report, "surface_strain", middle)
    strip = SimpleNamespace(data=BIAS, model=model, history=history)
    assert report.failure_strains([strip], np.full(3, 9.0))[2] == pytest.approx(0.3)
    drawn = caught(monkeypatch, report, "strip_charts")
    monkeypatch.setattr(report, "write_vtu", lambda *what, **more: drawn.append((what, more)))
    report.draw_bias(model, history, Path("b.png"), Path("b.vtu"))
    (picture, *_, moved, drawn_shear, gauge), (written, more) = drawn
    assert picture == Path("b.png") and (moved == 1.0).all()
    assert drawn_shear.tolist() == shear and gauge == [2, 6]
    assert written[0] is mesh and (written[1] == 1.0).all() and written[2] == Path("b.vtu")
    assert more == {"cell_data": {"log_strain_1_2_12": strain}}


#: Two increments, to 2 and 4 mm.
MODEL = straight_strip("warp", 20.0, 24.0, 0.8, increments=2)
#: A fit with no comparison but those of the test.
ALONE: Any = SimpleNamespace(compared_with=(), law=HypoelasticLaw.linear(500.0, 200.0, 20.0))
#: RMS of 3 and -4 N.
RMS = float(np.sqrt(12.5))


def history(*load: float, shear: float = 0.0) -> History:
    strain = np.array([0.1, 0.02, shear])
    return History(np.array(load), np.zeros((2, 4, 3)), -strain / 2, strain)


def matched(strip: Strip = WARP, loads=(203.0, 396.0)) -> FittedPart:
    objective = LoadObjective([2.0, 4.0], [2.0, 4.0], [200.0, 400.0])
    return FittedPart(strip, MODEL, objective, history(*loads))


def holding(test, strips) -> Any:
    return SimpleNamespace(seen=(), test=test, fitted_parts=lambda _: strips)


def test_findings_of_strips_name_errors_and_omitted_points():
    test = SimpleNamespace(name="s", match_by="points", weights={"warp": 1.0, "bias": 2.5})
    found = report.findings(holding(test, [matched(), matched(BIAS, (200.0, 410.0))]), ALONE)
    other = float(np.sqrt(50.0))
    warp = {
        "rms_N": pytest.approx(RMS), "scatter_N": 7.5, "weight": 1.0, "matched": 2,
        "gauge_length_mm": 20.0, "final_length_mm": 24.0, "end_load_N": 396.0,
    }  # fmt: skip
    bias = warp | {
        "rms_N": pytest.approx(other), "scatter_N": None, "weight": 2.5, "end_load_N": 410.0
    }  # fmt: skip
    assert found.numbers == {
        "directions": {"warp": warp, "bias": bias},
        "e_uniaxial_N": pytest.approx(RMS + other),
        "matched_by": "points",
    }
    (line,) = found.lines
    for words, numbers in (
        (line, ("warp 3.54", "7.5", "bias 7.07", "10.61")),
        (found.quality, (" N: warp 3.536", "bias 7.071")),
        (found.summary, (" N: warp 3.54", "bias 7.07", "10.61")),
    ):
        assert all(number in words for number in numbers), words
    unmatched, *notes, left_out = found.warnings
    assert (unmatched.kind, unmatched.of) == (UNMATCHED, "") and "no fill" in unmatched
    assert [(n.kind, str(n)) for n in notes] == [
        (READING, "a note"), (READING, "another")
    ]  # fmt: skip
    assert (left_out.kind, left_out.of, left_out[:8]) == (LEFT_OUT, "warp", "3 points")
    test.match_by = "polynomial"
    found = report.findings(holding(test, [matched()]), ALONE)
    assert LEFT_OUT not in [n.kind for n in found.warnings]


# Cards, one beside the other
@pytest.fixture
def drawn(monkeypatch) -> dict[str, list[Any]]:
    biases: list[Any] = []
    monkeypatch.setattr(report, "draw_bias", lambda *what: biases.append(what))
    return {"loads": caught(monkeypatch, report, "load_charts"), "bias": biases}


def simulated(folder, outcomes, within: bool = False):
    strips = {"warp": WARP, "bias": BIAS}
    chosen = {direction: strips[direction] for _, direction in outcomes}
    test: Any = SimpleNamespace(strips=chosen, match_by="polynomial")
    law = SimpleNamespace(strain_range=np.array([0.1, 0.1, 0.1]))
    cards: Any = {name: SimpleNamespace(law=law) for name, _ in outcomes}
    runs = {key: CardRun(MODEL, outcome) for key, outcome in outcomes.items()}
    return report.simulate(test, cards, runs, Output(folder), within)


@pytest.mark.parametrize(
    ("strains", "shown"),
    [
        ([[0] * 3, [0.1, 0.1, 0.1]], 2), ([[0] * 3, [0.101, 0.0, 0.0]], 1),
        ([[0] * 3, [0.0, 0.101, 0.0]], 1), ([[0] * 3, [0.0, 0.0, -0.101]], 1),
        ([[0] * 3, [-0.5, -0.5, 0.0]], 2), ([[0] * 3, [0.1 * (1 + 1e-7), 0.0, 0.0]], 2),
        ([[1, 1, 1]], 0),
    ],
)  # fmt: skip
def test_curves_end_with_the_valid_range_of_the_card(tmp_path, drawn, monkeypatch, strains, shown):
    strain = iter(strains)
    monkeypatch.setattr(report, "surface_strain", lambda *_: np.array([next(strain)]))
    found = simulated(tmp_path, {("soft", "warp"): history(223.0, 436.0)}, within=True)
    (card,) = found.numbers["cards"].values()
    warp = card["directions"]["warp"]
    assert warp["shown_to_mm"] == 2.0 * shown and warp["end_load_N"] == 436.0
    assert warp["rms_N"] == (None, pytest.approx(3.0), pytest.approx(RMS))[shown]
    assert (card["e_uniaxial_N"] is None) == (shown < 2)
    ((_, _, (panel,), _),) = drawn["loads"]
    assert [len(model[1]) for model in panel.models] == [shown] * bool(shown)
    assert len(pd.read_csv(tmp_path / "loads.csv")) == 2


@pytest.mark.parametrize("match", ["points", "polynomial"])
def test_simulated_loads_have_the_rms_error_of_the_fit(tmp_path, match):
    path = constant_strips(tmp_path)
    path.write_text(path.read_text().replace('match = "points"', f'match = "{match}"'))
    project = read_project(path).with_fit(jobs=1)
    fit = bf.fit(project, starts=1)
    solver = fit.setup.make_solver()
    for name, findings in fit.findings.items():
        test = project.tests[name]
        for direction, model in test.models().items():
            history = solver.run(model, fit.card.law)
            end = float(model.elongations[-1])
            found = rms_of_loads(test, test.strips[direction], model, history, end)
            told = findings.numbers["directions"][direction]["rms_N"]
            assert found == pytest.approx(told, rel=1e-5)


def test_directions_that_the_law_misses_are_named_with_their_errors():
    shares = {"bias": 0.89, "30 degrees": 1.09, "60 degrees": 1.04}
    names = ["s: warp", *(f"s: {direction}" for direction in shares)]
    note = next(n for n in notes_on_directions(shares, names) if n.kind == DIRECTIONS_MISSED)
    assert note.endswith("off by -12 % at 45 degrees, +8 % at 30 degrees")
    assert note.kind.weight >= GRAVE
    # Along the yarns and at one angle a law can follow all loads: what is off has another cause.
    kinds = [n.kind for n in notes_on_directions({"bias": 0.89}, ["s: warp", "s: bias"])]
    assert DIRECTIONS_MISSED not in kinds


def test_directions_of_another_test_are_matched():
    def unmatched(compared_with):
        notes = notes_on_directions({"30 degrees": 1.0}, compared_with)
        return [str(note) for note in notes if note.kind == UNMATCHED]

    (fill,) = unmatched(["s: warp", "s: 30 degrees"])
    assert fill.startswith("no fill strip of s is matched: E2")
    assert not unmatched(["s: warp", "s: 30 degrees", "t: fill"])


def test_lateral_strain_that_contradicts_the_law_is_noted():
    def notes(ratio):
        warnings = notes_on_directions({}, ["s: warp"], ratio)
        return [str(note) for note in warnings if note.kind == POISSON]

    (words,) = notes(0.42)
    assert "gives nu12 = 0.42, the law has 0.24" in words
    assert not notes(0.28) and not notes(None)


def test_isotropic_law_needs_no_strips_across():
    law = HypoelasticLaw(np.array([500.0]), 0.4, None, form=symmetric(CONSTANT, "isotropic", 0.4))
    fitted = SimpleNamespace(compared_with=(), law=law)
    test = SimpleNamespace(name="s", match_by="points", weights={"warp": 1.0})
    found = report.findings(holding(test, [matched()]), fitted)
    assert UNMATCHED not in [note.kind for note in found.warnings]
