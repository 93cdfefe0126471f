"""Numbers of made-up runs of cylinders: in result.json, the table of runs and on the terminal."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import SOLVER, Note, NoteKind
from bubblefit.experiments.cylinder import report as figures
from bubblefit.experiments.cylinder import report as page
from bubblefit.experiments.cylinder.predicted import (
    BendingMeasures,
    BendingRun,
    CylinderOutcome,
    columns_of,
    curve_of,
    measured_table,
    terminal_table,
)
from bubblefit.experiments.kinds import Output
from bubblefit.readers.bending import BendingCurve, BendingError
from bubblefit.reports.content import Table
from bubblefit.reports.cylinders import bending_charts
from bubblefit.solvers.base import EARLY, SNAP, BandEnd
from bubblefit.solvers.calculix.cylinder import GAS

from ...cylinder_cases import ENDS
from ...drawings import caught

MEASURES = BendingMeasures(
    stiffness=4.256,
    loads={"20 mm": 86.4, "a long way": None},
    knee=(61.0, 251.0),
    limit=(120.0, 502.6),
    wrinkles=(33.0, 140.0),
    straightness=(0.99, 0.02),
    body_strain=(0.011, 0.022),
    anywhere_strain=(0.033, 0.044),
    pressure_rise=1.6,
    reached=150.0,
    error=BendingError(3.1, -1.2, 0.0519, 17, 4),
)


def run(name: str, card: str, early: str = "", *kinds: NoteKind):
    test = SimpleNamespace(
        name=name, reading=SimpleNamespace(places={"20 mm": 20.0, "a long way": 200.0})
    )
    notes = tuple(Note(kind, "words") for kind in kinds)
    said = SimpleNamespace(early=early)
    return SimpleNamespace(test=test, card=card, notes=notes, record=said, wall="")


def test_numbers_for_result_json():
    outcome = CylinderOutcome(())
    outcome.__dict__["measures"] = {0: MEASURES, 1: replace(MEASURES, limit=None, error=None)}
    found = outcome.numbers(0)
    assert found == {
        "reached_mm": 150.0,
        "stiffness_N_per_mm": 4.256,
        "buckling": {"is": "limit point", "deflection_mm": 120.0, "load_N": 502.6},
        "knee": {"deflection_mm": 61.0, "load_N": 251.0},
        "limit_point": {"deflection_mm": 120.0, "load_N": 502.6},
        "wrinkle_onset": {"deflection_mm": 33.0, "load_N": 140.0},
        "load_N": {"20 mm": 86.4, "a long way": None},
        "load_sigma_N": {"20 mm": None, "a long way": None},
        "spread": None,
        "inflation_strain": {
            "body": {"warp": 0.011, "fill": 0.022},
            "with_seam_and_ends": {"warp": 0.033, "fill": 0.044},
        },
        "straight_before_buckling": {"r_squared": 0.99, "largest_deviation": 0.02},
        "pressure_rise_kPa": 1.6,
        "error": {"rms": 3.1, "mean": -1.2, "relative": 0.0519, "compared": 17, "beyond": 4},
    }
    other = outcome.numbers(1)
    assert other["buckling"] == {"is": "knee", "deflection_mm": 61.0, "load_N": 251.0}
    assert other["limit_point"] == {"deflection_mm": None, "load_N": None}
    assert other["error"] is None
    assert outcome.error(0) == 0.0519 and outcome.error(1) is None and outcome.error(2) is None


def test_a_row_of_the_table_of_runs():
    row = columns_of(MEASURES, ["20 mm", "a long way"])
    assert row == {
        "stiffness_N_per_mm": 4.256,
        "knee_mm": 61.0, "knee_N": 251.0, "limit_mm": 120.0, "limit_N": 502.6,
        "wrinkles_mm": 33.0, "wrinkles_N": 140.0,
        "load_at_20_mm_N": 86.4, "load_at_a_long_way_N": None,
        "inflation_warp_strain": 0.011, "inflation_fill_strain": 0.022,
        "pressure_rise_kPa": 1.6,
        "rms_N": 3.1, "rms_relative": 0.0519, "mean_error_N": -1.2, "compared": 17,
        "reached_mm": 150.0,
    }  # fmt: skip
    empty = columns_of(None, ["20 mm", "a long way"])
    assert list(empty) == list(row) and set(empty.values()) == {None}


def test_curves_and_readings():
    """Lists of rows as they go into load_deflection.csv and measured.csv."""
    way = np.array([0.0, 30.0])
    read = [BendingCurve("a", way, np.array([0.0, 58.0])), BendingCurve("b", way, 2.0 * way)]
    tests = [SimpleNamespace(name="x", measured=read), SimpleNamespace(name="y", measured=())]
    twice = measured_table([*tests, SimpleNamespace(name="z", measured=read[:1])])
    assert twice.index.tolist() == list(range(2 * 61)) and set(twice["test"]) == {"x", "z"}
    table = measured_table(tests)
    assert list(table.columns) == [
        "test", "deflection_mm", "mean_N", "standard_deviation_N", "repetitions"
    ]  # fmt: skip
    assert len(table) == 61 and set(table["test"]) == {"x"}
    assert table.iloc[30].tolist()[1:] == pytest.approx([15.0, 29.5, np.sqrt(0.5), 2])
    assert list(measured_table(tests[1:]).columns) == list(table.columns)
    bent = BendingRun(
        way, np.array([0.0, 60.0]), np.array([0.1, 0.102]), np.array([5e7, 4e7]),
        np.empty(0), np.empty(0), np.empty(0),
    )  # fmt: skip
    curve = curve_of(bent)
    assert list(curve.columns) == [
        "deflection_mm", "load_N", "gauge_pressure_kPa", "volume_mm3", "wrinkled_share"
    ]  # fmt: skip
    assert curve.iloc[1].tolist()[:4] == pytest.approx([30.0, 60.0, 102.0, 4e7])
    assert curve["wrinkled_share"].isna().all()
    assert list(curve_of(None).columns) == list(curve.columns) and len(curve_of(None)) == 0


def test_the_terminals_table():
    runs = [
        run("150/140", "soft", "", SNAP, GAS),
        run("200", "a stiff card"),
        run("250", "soft", "no equilibrium"),
    ]
    dull = replace(MEASURES, limit=None, knee=None, stiffness=None, error=None)
    ended = ["finished", "failed: killed", "stopped at 90 of 150 mm: no equilibrium"]
    lines = terminal_table(runs, {0: MEASURES, 2: dull}, ended)
    assert lines == [
        "test     card           N/mm   buckles at    20 mm  a long way   error",
        "150/140  soft           4.26  503 N 120 mm     86 N           -   5.2 %  [snap]",
        "200      a stiff card  failed: killed",
        "250      soft              -             -     86 N           -       -"
        "  stopped at 90 of 150 mm: no equilibrium",
    ]
    lines = terminal_table(runs[2:], {0: dull}, ended[2:])
    assert "error" not in lines[0] and lines[0].endswith("a long way")


@pytest.mark.parametrize(("limit", "knee", "word"), [(1, 1, "limit point"), (0, 1, "knee")])
def test_what_buckling_is(limit: int, knee: int, word: str):
    found = replace(
        MEASURES, limit=(9.0, 1.0) if limit else None, knee=(8.0, 2.0) if knee else None
    )
    assert found.buckling_is == word
    assert found.buckling == ((9.0, 1.0) if limit else (8.0, 2.0))
    assert replace(found, limit=None, knee=None).buckling_is == "none"


WAY, LOAD = np.array([0.0, 40.0, 80.0]), np.array([0.0, 100.0, 90.0])
BENT = BendingRun(
    deflection=WAY, load=LOAD, pressure=np.array([0.1, 0.101, 0.102]),
    volume=np.array([5e7, 4.9e7, 4.8e7]), inflated=np.empty(0), wrinkled=np.array([0.0, 0.1, 0.2]),
    bent=np.empty(0),
)  # fmt: skip
CURVE = BendingCurve("1", WAY, LOAD)


def case(name: str, diameter: float = 150.0, **other: Any) -> SimpleNamespace:
    fields = {
        "name": name, "diameter": diameter, "length": 3000.0, "size": 40.0, "seam_width": 35.0,
        "supports": SimpleNamespace(span=2000.0), "measured": (), "assumed": (),
        "deflections": (80.0, 160.0),
        "reading": SimpleNamespace(places={"20 mm": 20.0, "a long way": 200.0}, slope_over=20.0),
    }  # fmt: skip
    return SimpleNamespace(**(fields | other))


def run_page(
    test: SimpleNamespace,
    card: str,
    seconds: float = 12.34,
    end: BandEnd | None = None,
    **record: Any,
) -> SimpleNamespace:
    said = SimpleNamespace(**({"failure": "", "early": "", "seconds": seconds} | record))
    kinds = (EARLY, SNAP) if said.early else (GAS, SOLVER)
    notes = tuple(Note(kind, "words") for kind in kinds)
    return SimpleNamespace(
        test=test, card=card, notes=notes, record=said, end=end, wall=end.name if end else "",
        predicted=end is None or end.predicted, around=None,
        material=SimpleNamespace(certainty="known"),
    )  # fmt: skip


@pytest.fixture
def outcome() -> CylinderOutcome:
    first, second = case("150/90", measured=(CURVE, CURVE)), case("the wide one", 200.0)
    found = CylinderOutcome(
        [
            run_page(first, "soft card"),
            run_page(first, "stiff", failure="killed"),
            run_page(second, "soft card", early="no equilibrium within the smallest step"),
        ]
    )
    knee = replace(
        MEASURES, limit=None, wrinkles=None, stiffness=None, error=None, pressure_rise=-0.126
    )
    found.__dict__["measures"] = {0: MEASURES, 2: knee}
    found.__dict__["bent"] = {0: BENT, 2: BENT}
    return found


def test_every_cell(outcome, tmp_path, monkeypatch):
    monkeypatch.setattr(page, "draw_figures", lambda *_: [("a.png", "a picture")])
    monkeypatch.setattr(page, "write_beams", lambda *_: [("b.vtu", "a beam")])
    shown = page.show_outcome(outcome, Output(tmp_path / "out", "c/"))
    assert shown.facts == [
        ("length, mm", 3000.0), ("span, mm", 2000.0), ("element size, mm", 40.0),
        ("seam width, mm", 35.0),
    ]  # fmt: skip
    assert shown.figures == [("a.png", "a picture")]
    assert shown.files == [
        (
            "c/load_deflection.csv",
            "every curve: deflection, load, pressure, volume, wrinkled share",
        ),
        ("c/measured.csv", "mean and scatter of the repetitions on a grid"),
        ("b.vtu", "a beam"),
    ]
    runs, errors = shown.tables
    stopped = "stopped at 80 of 160 mm: no equilibrium within the smallest step"
    rows = [
        ["150/90", "soft card", "4.26", "503 N, 120 mm", "33 mm", "86", None, "0.022", "+1.60",
         "finished", None, 2, 12.3],
        ["150/90", "stiff", None, None, None, None, None, None, None, "failed: killed", None, 2,
         12.3],
        ["the wide one", "soft card", None, "251 N, 61 mm (knee)", None, "86", None, "0.022",
         "-0.13", stopped, "snap, stopped early", 2, 12.3],
    ]  # fmt: skip
    assert [unbroken(row) for row in runs.rows] == rows
    assert "\u00a0" in str(runs.rows[0][3]) and runs.rows[2][9] == stopped  # which is broken
    assert runs == Table(
        "Runs",
        ["test", "card", "stiffness, N/mm", "buckles", "wrinkles from", "load at 20 mm, N",
         "load at a long way, N", "inflation strain", "pressure, kPa", "ended", "marked",
         "notes", "s"],
        runs.rows,
        "Stiffness: to 20 mm of deflection. Buckles: the limit point where the load falls "
        "afterwards, else the knee, where the slope over 20 mm has fallen to half. Wrinkles: more "
        "of the surface than when inflated. Inflation strain: the largest along warp or fill in "
        "the body, without the quads beside seam and caps. Pressure: its rise to the last frame. "
        "Marked: the kinds of notes that speak against a run's numbers; the notes stand below.",
        text=(1, 9, 10),
    )  # fmt: skip
    assert errors == Table(
        "Against measured loads",
        ["test", "card", "RMS, N", "of the largest load", "mean, N", "readings", "beyond"],
        [["150/90", "soft\u00a0card", 3.1, "5.2\u00a0%", "-1.2", 17, 4]],
        "Model less reading at every reading that the model reaches; beyond: those it does not.",
        text=(1,),
    )
    curves = pd.read_csv(tmp_path / "out" / "c" / "load_deflection.csv")
    assert list(curves.columns) == [
        "test", "card", "wall", "deflection_mm", "load_N", "gauge_pressure_kPa", "volume_mm3",
        "wrinkled_share",
    ]  # fmt: skip
    assert curves["test"].tolist() == ["150/90"] * 3 + ["the wide one"] * 3
    assert curves["gauge_pressure_kPa"].tolist() == pytest.approx([100.0, 101.0, 102.0] * 2)
    assert curves["wrinkled_share"].tolist() == [0.0, 0.1, 0.2] * 2
    measured = pd.read_csv(tmp_path / "out" / "c" / "measured.csv")
    assert set(measured["test"]) == {"150/90"} and set(measured["repetitions"]) == {2}
    assert measured["mean_N"].max() == pytest.approx(100.0, rel=0.02)
    assert measured["standard_deviation_N"].abs().max() < 1e-9


def unbroken(row: list[object]) -> list[object]:
    return [c.replace("\u00a0", " ") if isinstance(c, str) else c for c in row]


def test_without_readings_there_is_nothing_to_compare(outcome, tmp_path, monkeypatch):
    monkeypatch.setattr(page, "draw_figures", lambda *_: [])
    monkeypatch.setattr(page, "write_beams", lambda *_: [])
    plain = CylinderOutcome(
        [run_page(case("a"), "soft"), run_page(case("b", size=20.0, length=1e3), "soft")]
    )
    plain.__dict__["measures"] = {i: replace(MEASURES, error=None) for i in (0, 1)}
    plain.__dict__["bent"] = {0: BENT, 1: BENT}
    shown = page.show_outcome(plain, Output(tmp_path))
    assert [name for name, _ in shown.files] == ["load_deflection.csv"]
    assert [table.title for table in shown.tables] == ["Runs"]
    assert shown.facts == [("span, mm", 2000.0), ("seam width, mm", 35.0)]  # what all share
    assert plain.error(0) is None and plain.ended(1) == "finished"


@pytest.mark.parametrize(
    ("cases", "words"),
    [
        (((150.0, 20.0), (200.0, 20.0)), "20 mm"),
        (((150.0, 15.0), (200.0, 20.0)), "0.1 diameters (15 to 20 mm)"),
        (((150.0, 20.0), (200.0, 15.0)), "15 to 20 mm"),
        (((150.0, 20.0), (200.0, 20.0000004)), "20 mm"),
        (((150.0, 20.0), (200.0, 20.00001)), "20 to 20 mm"),
    ],
)
def test_over_what_a_slope_is_taken(cases, words: str):
    tests = [
        case("a", diameter, reading=SimpleNamespace(places={}, slope_over=over))
        for diameter, over in cases
    ]
    assert page._slopes(tests) == words


def test_names_of_files_differ_whatever_the_tests_are_called():
    found = figures.file_names(["150 mm, 90 kPa", "150 mm; 90 kPa", "150 MM 90 kpa", "???", "-x."])
    assert list(found.values()) == [
        "150-mm-90-kPa", "150-mm-90-kPa-2", "150-MM-90-kpa-3", "4", "x"
    ]  # fmt: skip


def test_every_test_once(outcome):
    assert [test.name for test in figures.tests_of(outcome)] == ["150/90", "the wide one"]


#: The second one ends half-way.
READ = (BendingCurve("1", WAY, 2 * WAY), BendingCurve("2", WAY[:2], 2 * WAY[:2] + 4.0))


@pytest.fixture
def drawn(monkeypatch) -> dict[str, list[Any]]:
    calls: dict[str, list[Any]] = {"draw_beam": [], "write_beam": []}
    for name, found in calls.items():
        monkeypatch.setattr(figures, name, lambda *what, own=found: own.append(what))
    return {**calls, "saved": caught(monkeypatch, figures, "bending_charts", "gas_charts")}


def outcome_figures(*runs: Any, bent: tuple[int, ...]) -> CylinderOutcome:
    for one in runs:
        one.model = f"model of {one.test.name}"
    found = CylinderOutcome(runs)
    found.__dict__["bent"] = {i: replace(BENT, load=BENT.load + i) for i in bent}
    found.__dict__["measures"] = {
        i: replace(MEASURES, knee=(1.0 + i, 2.0), error=None if i else MEASURES.error) for i in bent
    }
    return found


def test_figures_of_every_test(tmp_path, drawn):
    first, second = case("a b", measured=READ), case("a/b", 200.0)
    failed = case("broken")
    found = outcome_figures(
        run_page(first, "soft"), run_page(second, "stiff"),
        run_page(first, "stiff"), run_page(failed, "soft"),
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


def test_one_test_has_no_figure_of_all(tmp_path, drawn):
    both = outcome_figures(run_page(case("a"), "soft"), run_page(case("b"), "soft"), bent=(0,))
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
def test_rows_of_a_figure_of_all(diameters: tuple[float, ...], rows: list[int]):
    tests: Any = [case(str(k), diameter) for k, diameter in enumerate(diameters)]
    found = figures._rows(tests)
    assert [len(row) for row in found] == rows
    assert sorted(test.name for row in found for test in row) == [t.name for t in tests]


def test_beams_for_paraview(tmp_path, drawn):
    first = case("a b")
    found = outcome_figures(
        run_page(first, "soft card"),
        run_page(case("c"), "soft card"),
        run_page(first, "x"),
        bent=(0, 2),
    )
    assert figures.write_beams(found, Output(tmp_path, "o-")) == [
        ("o-beams/a-b-soft-card.vtu", "the beam at 80 mm, for ParaView"),
        ("o-beams/a-b-x.vtu", "the beam at 80 mm, for ParaView"),
    ]
    assert [path.name for _, _, path in drawn["write_beam"]] == ["a-b-soft-card.vtu", "a-b-x.vtu"]
    assert [bent.load[0] for _, bent, _ in drawn["write_beam"]] == [BENT.load[0], BENT.load[0] + 2]


@pytest.fixture
def outcome_band() -> CylinderOutcome:
    """Both ends with one card, the prediction alone with another: its other end failed."""
    test, (slack, rigid) = case("150/90", measured=(CURVE, CURVE)), ENDS
    found = CylinderOutcome(
        [
            run_page(test, "soft", end=slack), run_page(test, "soft", end=rigid),
            run_page(test, "hard", end=slack), run_page(test, "hard", end=rigid, failure="killed"),
        ]
    )  # fmt: skip
    stiff = SimpleNamespace(**(vars(BENT) | {"load": 1.5 * LOAD}))
    found.__dict__["measures"] = dict.fromkeys((0, 1, 2), MEASURES)
    found.__dict__["bent"] = {0: BENT, 1: stiff, 2: BENT}
    return found


def test_every_row_says_which_wall(outcome_band, tmp_path, monkeypatch):
    monkeypatch.setattr(page, "draw_figures", lambda *_: [])
    monkeypatch.setattr(page, "write_beams", lambda *_: [])
    shown = page.show_outcome(outcome_band, Output(tmp_path))
    runs, errors = shown.tables
    assert runs.header[:4] == ["test", "card", "wall", "stiffness, N/mm"]
    assert [unbroken(row[1:3]) for row in runs.rows] == [
        ["soft", "slack"], ["soft", "rigid wall"], ["hard", "slack"], ["hard", "rigid wall"]
    ]  # fmt: skip
    assert all(len(row) == len(runs.header) for row in runs.rows)
    assert runs.rows[3][runs.header.index("ended")] == "failed:\u00a0killed"
    assert runs.text == (1, 2, runs.header.index("ended"), runs.header.index("marked"))
    assert runs.note.endswith("stand below. Slack: it wrinkles. Rigid wall: it does not.")
    assert errors.header[:4] == ["test", "card", "wall", "RMS, N"] and errors.text == (1, 2)
    assert [unbroken(row[2:4]) for row in errors.rows] == [
        ["slack", 3.1], ["rigid wall", 3.1], ["slack", 3.1]
    ]  # fmt: skip
    curves = pd.read_csv(tmp_path / "load_deflection.csv")
    assert list(curves.columns[:4]) == ["test", "card", "wall", "deflection_mm"]
    assert curves["wall"].tolist() == ["slack"] * 3 + ["rigid wall"] * 3 + ["slack"] * 3
    assert curves["load_N"].tolist() == [*LOAD, *1.5 * LOAD, *LOAD]


def test_the_terminal_says_which_wall(outcome_band):
    head, *rows = outcome_band.lines()
    assert head.startswith("test    card  wall         N/mm   buckles at")
    assert [row[: head.index("N/mm") - 2].rstrip() for row in rows] == [
        "150/90  soft  slack", "150/90  soft  rigid wall", "150/90  hard  slack",
        "150/90  hard  rigid wall",
    ]  # fmt: skip
    assert rows[3].endswith("failed: killed")


def test_a_line_is_the_prediction_and_its_band_goes_to_the_other_end(
    outcome_band, tmp_path, monkeypatch
):
    calls = caught(monkeypatch, figures, "bending_charts", "gas_charts")
    beams: list[tuple[str, str]] = []
    monkeypatch.setattr(
        figures, "draw_beam", lambda m, r, path, title: beams.append((path.name, title))
    )
    monkeypatch.setattr(figures, "write_beam", lambda m, r, path: None)
    for one in outcome_band.runs:
        one.model = None
    shown = dict(figures.draw_figures(outcome_band, Output(tmp_path)))
    panel = calls[0][1][0]
    assert panel.band == "from slack to rigid wall"
    soft, hard = panel.lines
    np.testing.assert_array_equal([soft.deflection, soft.load], [WAY, LOAD])
    assert soft.other is not None and hard.other is None
    np.testing.assert_array_equal(soft.other, [WAY, 1.5 * LOAD])
    assert "figures/150-90-load.png" not in shown  # a chart on the page
    monkeypatch.setattr(figures, "bending_charts", bending_charts)
    (charts,) = figures.load_charts(outcome_band)
    assert charts.caption == "Load over deflection; line: slack, dashed: rigid wall"
    (chart,) = charts.charts
    curves = {s.name: s for s in chart.series if s.look == "line"}
    assert list(curves) == ["mean", "soft", "soft, other end", "hard"]
    assert curves["soft, other end"].y == pytest.approx(1.5 * LOAD)
    assert curves["soft, other end"].dashes == 1 and curves["soft"].y == pytest.approx(LOAD)
    assert beams == [("150-90-beam.png", "150/90, soft, 80 mm")]
    assert figures.write_beams(outcome_band, Output(tmp_path)) == [
        ("beams/150-90-soft.vtu", "the beam at 80 mm, for ParaView"),
        ("beams/150-90-soft-rigid-wall.vtu", "the beam at 80 mm, for ParaView (rigid wall)"),
        ("beams/150-90-hard.vtu", "the beam at 80 mm, for ParaView"),
    ]
