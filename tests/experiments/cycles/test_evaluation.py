"""experiments/cycles/evaluation.py: tables of cycles; slip, drift and scatter of histories."""

import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit import cycles
from bubblefit.experiments.cycles.evaluation import DRIFT, SLIP, evaluate_history, scatter_notes
from bubblefit.readers.histories import LoadHistory, read_history

from ...builders.load_histories import faulty_histories, load_history, write_history
from ...support.commands import in_process
from ...support.refusals import complaint, refused


def test_elongation_between_grips_needs_its_length_and_is_doubted(tmp_path):
    time, load, strain = load_history()
    path = write_history(
        tmp_path / "g.csv", ["Time (s),Load (N),Crosshead (mm)"], (time, load, 200 * strain)
    )
    assert "length" in complaint(cycles, path)
    found = cycles(path, length=200.0)
    assert found.histories[0].values[0].top == pytest.approx(0.010, rel=0.03)
    assert any(note.kind == "strain between grips" for note in found.notes)


@pytest.mark.parametrize(
    ("given", "field"),
    [({"reference_load": 2.0}, "reference load"), ({"reference_load": 2900.0}, "reference load"),
     ({"reference_load": -1.0}, "reference_load"), ({"length": 0.0}, "length"),
     ({"columns": {"pressure": "p"}}, "columns")],
)  # fmt: skip
def test_history_that_cannot_be_evaluated_is_refused(plain_history_file, given, field):
    assert refused(cycles, plain_history_file, **given).field == field


def test_strain_in_percent_without_unit_is_refused(tmp_path):
    time, load, strain = load_history()
    path = write_history(tmp_path / "p.csv", ["time_s,load_N,strain"], (time, load, 100 * strain))
    assert "strain_unit" in complaint(cycles, path)
    assert cycles(path, strain_unit="%").histories[0].values[0].top == pytest.approx(0.01, rel=0.03)


def test_cycles_command_writes_tables_and_json(plain_history_file, golden, tmp_path):
    done = in_process("cycles", plain_history_file.name, "--reference-load", 100, cwd=tmp_path)
    golden("cycles", done.stdout, tmp_path)
    out = tmp_path / "out" / "cycles"
    tables = {"cycles.csv", "holds.csv", "loops.csv", "notes.csv"}
    assert {p.name for p in out.iterdir()} == {*tables, "cycles.png", "page.json", "report.html"}
    run = ("cycles", plain_history_file.name, "--json", "--length", 1)
    assert "--overwrite" in in_process(*run, cwd=tmp_path, code=2).stderr
    rows = json.loads(in_process(*run, "--overwrite", cwd=tmp_path).stdout)["cycles"]
    assert rows[2]["peak_N"] == pytest.approx(6000.0)
    said = in_process(
        "cycles",
        plain_history_file.name,
        "--reference-load",
        9,
        "--overwrite",
        cwd=tmp_path,
        code=2,
    )
    assert "reference load" in said.stderr


def test_raw_export_equals_its_plain_table(shared_data):
    raw = shared_data / "webbing" / "raw_instron" / "st_1p75in_Test1.Stop.csv"
    found = cycles([raw, shared_data / "webbing" / "st_1p75in_test1.csv"], reference_load=178.0)
    for a, b in zip(found.histories[0].values, found.histories[1].values, strict=True):
        assert (a.permanent, a.EA_loading, a.loss) == pytest.approx(
            (b.permanent, b.EA_loading, b.loss), rel=0.02
        )
    # Ranges published with the data: 1.75 in strap, cycles 1 and 3.
    assert found.histories[0].values[0].permanent == pytest.approx(0.0123, rel=0.02)
    assert found.histories[0].values[2].loss == pytest.approx(20.7, rel=0.02)


def test_loops_are_written_reading_by_reading(plain_history_file, tmp_path):
    in_process("cycles", plain_history_file, "--reference-load", 100, "--out", "out", cwd=tmp_path)
    table = pd.read_csv(tmp_path / "out" / "loops.csv")
    names = ["file", "cycle", "branch", "time_s", "travel_mm", "strain", "load_N"]
    assert table.columns.tolist() == names
    found = cycles(plain_history_file, reference_load=100.0)
    history = found.histories[0]
    for v in history.values:
        loop = table[table["cycle"] == v.cycle.number]
        assert loop["branch"].tolist() == ["loading"] * 40 + ["unloading"] * 39
        assert loop["strain"].max() == pytest.approx(v.top)
        assert loop["load_N"].max() == pytest.approx(v.peak)
    assert table["travel_mm"].isna().all()


def test_slip_and_drift_are_doubted(tmp_path):
    found = cycles(list(faulty_histories(tmp_path).values()))
    by = {kind: {n.of for n in found.notes if n.kind == kind} for kind in (SLIP, DRIFT)}
    assert by == {SLIP: {"negative.csv", "lost.csv"}, DRIFT: {"drifting.csv"}}
    assert found.histories[1].values[2].loss < 0


@pytest.mark.parametrize(
    ("creep", "is_doubted"), [(None, True), (0.0, True), (0.9, True), (1.1, False)]
)
def test_drift_is_of_readings_before_the_machine_moves(creep, is_doubted):
    """The machine's travel changes by a share of 3e-4 of its range over each five readings."""
    time, load, strain = load_history()
    rest = np.arange(40)
    strain = np.r_[1e-5 * rest, strain + 1e-5 * rest[-1]]
    load = np.r_[np.full(40, load[0]), load]
    time = 0.5 * np.arange(len(load))
    travel = None
    if creep is not None:
        travel = 5.0 * load / load.max()
        travel[:40] += creep * 3e-4 * np.ptp(travel) * np.minimum(rest / 5.0, 1.0)
    history = LoadHistory(Path("rest.csv"), load, strain, time, travel)
    notes = [str(note) for note in evaluate_history(history).notes if note.kind == DRIFT]
    assert len(notes) == is_doubted
    assert all("moves by 2e-05 a second before the load does" in note for note in notes)


def slid_history(lost, seated, readings=40, settled=0.0):
    """Return a history of which the extensometer loses strain, and the grips settle in cycle 2.

    lost : of the strain at the peak of cycle 2, beside cycle 1. seated : share of the strain by the
    travel of cycle 3, to a higher load. readings : of the last unloading. settled : mm by which the
    grips settle up to a sixth of the last peak.
    """
    turns = [(0.0, 0.0), (0.010, 3000.0), (0.004, 50.0), (0.010 * (1 - lost), 3000.0)]
    turns += [(0.0045 - 0.010 * lost, 50.0), (0.016, 6000.0), (0.010, 50.0)]
    branches = list(zip(pairwise(turns), [40] * 5 + [readings], strict=True))
    strain, load = (
        np.concatenate([np.linspace(a[k], b[k], n)[1:] for (a, b), n in branches]) for k in (0, 1)
    )
    travel = 300.0 * strain
    third = slice(4 * 39 - 1, 5 * 39)
    rise = travel[third] - travel[third][0]
    travel[third] = travel[third][0] + rise / (1 - seated)
    travel[third] += settled * np.minimum(load[third] / 1000.0, 1.0)
    travel[third.stop :] += travel[third.stop - 1] - 300.0 * strain[third.stop - 1]
    return evaluate_history(LoadHistory(Path("slid.csv"), load, strain, travel=travel))


@pytest.mark.parametrize(
    ("lost", "seated", "words"),
    [
        (0.0, 0.0, None),
        (0.033, 0.24, None),
        (0.036, 0.0, "at the peak of cycle 2 0.00036 less strain than in cycle 1"),
        (0.0, 0.26, "over the loading of cycle 3 the machine's travel makes"),
    ],
)
def test_slip_is_suspected_beyond_that_of_good_specimens(lost, seated, words):
    notes = [str(note) for note in slid_history(lost, seated).notes if note.kind == SLIP]
    assert len(notes) == (words is not None)
    assert words is None or notes[0].startswith(words)


def test_slip_is_judged_from_a_fifth_of_the_peak():
    (note,) = (note for note in slid_history(0.0, 0.26, readings=6).notes if note.kind == SLIP)
    assert "the machine's travel makes 0.0125 of strain" in str(note)
    assert "and the extensometer shows 0.00928" in str(note)
    assert all(note.kind != SLIP for note in slid_history(0.0, 0.0, settled=3.0).notes)


def test_slip_of_measured_straps_and_cords(shared_data):
    """No second cycle of good files; what a strap loses for certain."""
    files = sorted((shared_data / "webbing").glob("*.csv"))
    notes = [note for one in cycles(files).histories for note in one.notes if note.kind == SLIP]
    assert {(note.of, re.search(r"cycle \d", note).group()) for note in notes} == {
        ("st_1p75in_test2.csv", "cycle 1"),
        ("st_1p75in_test2.csv", "cycle 2"),
        ("st_2in_test1.csv", "cycle 2"),
    }


def test_scatter_between_specimens_is_noted_with_its_figure(tmp_path):
    """Specimens of 100, 90 and 80 N: one differs by 20 / 90 at most from the mean of the others."""
    time, load, strain = load_history()
    for k, share in enumerate((1.0, 0.9, 0.8)):
        write_history(
            tmp_path / f"s{k}.csv", ["time_s,load_N,strain"], (time, share * load, strain)
        )
    several = [read_history(tmp_path / f"s{k}.csv") for k in range(3)]
    histories = [evaluate_history(history, 100.0) for history in several]
    (note,) = scatter_notes({"warp": histories})
    assert "3 specimens of the warp" in note and "differs by 18 %" in note
    assert "standard deviation 11 %" in note and "do not hold it" in note
    (single,) = scatter_notes({"fill": histories[:1]})
    assert "one specimen of the fill" in single and "is not known" in single
