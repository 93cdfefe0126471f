"""experiments/cycles/evaluation.py: tables, loops and refusals of evaluated histories."""

import json

import pandas as pd
import pytest
from bubblefit import cycles

from ...builders.load_histories import load_history, write_history
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
