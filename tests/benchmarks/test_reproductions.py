"""What the scripts of benchmarks/reproduction say of published figures and statements."""

import subprocess
import sys

import numpy as np
import pytest
from bubblefit.experiments.cylinder import report
from bubblefit.materials.designers import RATIOS, DesignersConstants, shares
from bubblefit.reports.content import Exhibit
from bubblefit.solvers import registry

from ..biaxial_files import cycle, write_rows
from ..commands import in_process
from ..cylinder_cases import Formula
from ..places import EXAMPLES, ROOT
from ..scripts import script

EXAMPLE = EXAMPLES / "bend-valmex7318" / "project.toml"


bending = script("benchmarks/reproduction/bending.py")


def test_the_example_s_folder_is_read(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(registry.SOLVERS, "formula", Formula)
    monkeypatch.setattr(report, "show_outcome", lambda *_: Exhibit())
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


def test_figure_4_2():
    """Largest displacement of the known solution at 300 kPa, relative to the mean of five nu12.

    Published: 1.029 to 0.967. With pressure that follows the surface ours are 1.036 to 0.960, at
    most 0.0070 off; with dead pressure, as the published profiles show Marc's to be, they are
    within 0.0005 (docs/how-to/studies.md). The published numbers carry three decimals.
    """
    figure = script("benchmarks/reproduction/nu12_figure_4_2.py")
    ours = figure.ratios()
    most, slope = figure.compare(ours)
    assert most < 0.0075
    # Same curve, steeper: falling, nearly straight, and by the same factor at both ends.
    assert (np.diff(ours.to_mean) < 0).all()
    assert slope == pytest.approx(figure.STEEPER, abs=figure.NEAR)
    published = np.array([*figure.FIGURE.values()])
    assert ours.to_mean - 1 == pytest.approx(slope * (published - 1), abs=1e-3)


SCRIPT = ROOT / "benchmarks" / "reproduction" / "biaxial_t2.py"
#: Published for eight paths with free Poisson's ratios.
FREE = DesignersConstants(1188.0, 864.0, 0.73, 0.69)


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    rows = []
    for ratio in RATIOS:
        loads = np.outer(cycle(), shares(ratio))
        strain = 100 * FREE.strain(loads)
        rows += [(ratio, *n, *e) for n, e in zip(loads.tolist(), strain.tolist(), strict=True)]
    path = write_rows(tmp_path_factory.mktemp("t2") / "t2.csv", rows)
    return subprocess.run(
        [sys.executable, str(SCRIPT), str(path)], capture_output=True, text=True, timeout=120
    )


def test_what_is_met_and_what_is_missed_is_said_choice_by_choice(printed):
    assert printed.returncode == 1, printed.stderr
    lines = printed.stdout.splitlines()
    assert len(lines) == 10
    ours = {line[:22].strip(): line for line in lines if "ours" in line}
    assert ours["8 paths, free"].split()[-5:] == ["1188", "864", "0.73", "0.69", "0.00"]
    # The paths are computed with the constants of this choice alone.
    assert [name for name, line in ours.items() if "missed" not in line] == ["8 paths, free"]
    published = next(line for line in lines if line.startswith("10 paths, reciprocal"))
    assert published.split()[-5:] == ["914", "610", "0.83", "1.24", "637.19"]
