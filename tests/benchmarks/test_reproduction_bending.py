"""The thesis' statements on bending: checked on made-up runs, and on what the command writes."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from bubblefit.solvers import registry

from ..commands import in_process
from ..cylinder_cases import Formula
from ..places import EXAMPLES
from ..scripts import script

EXAMPLE = EXAMPLES / "bend-valmex7318" / "project.toml"


bending = script("benchmarks/reproduction/bending.py")
CARDS = ("uniaxial", "bubble 1", "bubble 2", "bubble 3", "bubble 4")
CYLINDERS = tuple(
    bending.Cylinder(f"{diameter:g} mm, {1e3 * pressure:g} kPa", diameter, pressure)
    for diameter, pressures in bending.PRESSURES.items()
    for pressure in pressures
)


def made_up(buckling=1.9):
    """Runs in which everything is as the thesis says."""
    runs = {}
    for case in CYLINDERS:
        rank = bending.PRESSURES[case.diameter].index(pytest.approx(case.pressure))
        for k, card in enumerate(CARDS):
            stiffness = (8 + rank) * (1 + 0.1 * k) * (case.diameter / 150) ** 3
            limit = (180.0, (300.0, 400.0, buckling * 300.0)[rank])
            runs[case.name, card] = bending.Run(
                (0.06, 0.08, 0.10)[rank], stiffness, (40 * stiffness, None, None), limit, None,
                (0.999, 0.01), 1.2, 240.0, None,
            )  # fmt: skip
    return bending.Study(CYLINDERS, CARDS, runs)


def verdicts(study, runs=None):
    return [s.verdict for s in bending.statements(replace(study, runs=runs or study.runs))]


def test_statements():
    study = made_up()
    assert verdicts(study) == ["holds"] * 8 + ["not checked"] * 2  # nothing was measured
    off = {key: -3.0 if key[1] == "uniaxial" else 4.0 for key in study.runs}
    measured = {key: replace(run, mean_error=off[key]) for key, run in study.runs.items()}
    assert verdicts(study, measured) == ["holds"] * 10
    nothing = bending.statements(replace(study, runs={}))
    assert {s.verdict for s in nothing} == {"not checked"}
    assert all(s.runs.startswith("needs") for s in nothing)
    study = made_up(buckling=1.4)
    runs = {}
    for (case, card), run in study.runs.items():
        runs[case, card] = replace(
            run,
            straightness=(0.98, 0.01),
            pressure_rise=2.0,
            strain=run.strain + 0.011,
            loads=(1e4, None, None) if card == "uniaxial" else run.loads,
            stiffness=1.0 if case == "200 mm, 80 kPa" else run.stiffness,
        )
    assert verdicts(study, runs)[:8] == [
        "does not hold", "holds in 25 of 30", "holds in 4 of 5", "does not hold",
        "holds in 25 of 30", "does not hold", "does not hold", "does not hold",
    ]  # fmt: skip
    checked = bending.statements(replace(study, runs=runs))
    assert any("200 mm, 80 kPa" in s.runs for s in checked)


def test_the_example_s_folder_is_read(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(registry.SOLVERS, "formula", Formula)
    in_process(
        "bend", EXAMPLE, "--solver", "formula", "--out", "out", "--card", "uniaxial",
        "--card", "bubble 1", "--test", "150 mm, 90 kPa", "--test", "150 mm, 140 kPa",
        "--quiet", cwd=tmp_path,
    )  # fmt: skip
    study = bending.read_study(tmp_path / "out")
    assert [c.name for c in study.cylinders] == ["150 mm, 90 kPa", "150 mm, 140 kPa"]
    assert len(study.runs) == 4 and all(run.reached == 240.0 for run in study.runs.values())
    assert all(np.isfinite(run.loads).all() for run in study.runs.values())
    monkeypatch.setattr(sys, "argv", ["bending.py", str(tmp_path / "out")])
    monkeypatch.setattr(bending, "KNOWN", ("Stiffer with more",))
    bending.main()
    said = capsys.readouterr().out
    assert "4 runs in" in said
    (row,) = (line for line in said.splitlines() if "Stiffer with more pressure" in line)
    assert row.endswith("| holds |")
    (row,) = (line for line in said.splitlines() if "Stiffer with larger diameter" in line)
    assert row.endswith("| needs two diameters of Table 6.1 | not checked |")
