"""What the scripts of benchmarks/reproduction say of published figures and statements."""

import sys

import numpy as np
from bubblefit.reports.content import Exhibit
from bubblefit.reports.kinds.cylinder import CylinderPresenter
from bubblefit.solvers import registry

from ..builders.bent_cylinders import ClosedFormCylinder
from ..support.commands import in_process
from ..support.paths import EXAMPLES, load_script

EXAMPLE = EXAMPLES / "bend-valmex7318" / "project.toml"


bending = load_script("benchmarks/reproduction/bending.py")


def test_folder_of_bending_example_is_read(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(registry.SOLVERS, "formula", ClosedFormCylinder)
    monkeypatch.setattr(CylinderPresenter, "show_outcome", lambda *_: Exhibit())
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
