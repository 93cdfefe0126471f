"""The command `check`: doubts about data, which keep a fit from beginning unless trusted."""

import json
import re

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.registry import kinds
from bubblefit.reports.content import read_page_data
from bubblefit.runs.check import check

from ..builders.bubbles import BUBBLE_MISTAKES as BUBBLE_TRAPS
from ..builders.bubbles import MISTAKES_WITH_OWN_TESTS as BUBBLE_TESTS
from ..builders.projects import EASY, known_bubble_in_camera_frames
from ..experiments.biaxial.test_prepared import TRAPS as BIAXIAL_TRAPS
from ..field.test_strip_mistakes import TRAPS as STRIP_TRAPS
from ..support.commands import in_process, one_line, result_in
from ..support.paths import ROOT
from ..support.refusals import complaint


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Good data in project.toml; the same with y flipped in the places in flipped.toml."""
    place = tmp_path_factory.mktemp("check")
    text, _ = known_bubble_in_camera_frames(place, lambda x, u: (x, u))
    (place / "project.toml").write_text(text)
    (place / "flipped.toml").write_text(text.replace('y = "y"', 'y = "minus_y"'))
    (place / "exchanged.toml").write_text(
        text.replace('dx = "dx", dy = "dy"', 'dx = "dy", dy = "dx"')
    )
    for frame in place.glob("frame_*.csv"):
        table = np.loadtxt(frame, delimiter=",", skiprows=1)
        wide = np.column_stack([table, -table[:, 1]])
        names = "x,y,z,dx,dy,dz,minus_y"
        np.savetxt(frame, wide, delimiter=",", header=names, comments="", fmt="%.9g")
    return place


def test_check_of_good_data_finds_no_doubt(folder, golden):
    golden("check", in_process("check", "project.toml", cwd=folder).stdout, folder)
    out = folder / "out" / f"{folder.name}-check"
    page = (out / "report.html").read_text()
    assert json.loads((out / "check.json").read_text())["verdict"]["state"] == "usable"
    assert "the data are fit to be fitted." in page and "Equilibrium of the apex" in page
    assert (out / "registration.png").is_file() and (out / "rises.png").is_file()
    said = complaint(check, bf.read_project(folder / "project.toml"), None, ["weather"])
    assert "fit.trust" in said and "weather" in said and "z-flipped" in said


def test_fit_of_exchanged_displacements_does_not_begin(folder):
    done = in_process("bubble", "exchanged.toml", "--starts", 1, "--out", "no", cwd=folder, code=2)
    one_line(done, "the centre is strained by", "calls for about", "take dy for dx and dx for dy")
    assert "[exchanged]" in done.stderr and not (folder / "no").exists()


def test_shape_out_of_equilibrium_is_a_warning(folder):
    """The shape of which y is flipped is no equilibrium of any law."""
    run = ("check", "flipped.toml", "--trust", "axis-flipped", "--out", "gap")
    said = " ".join(in_process(*run, cwd=folder).stdout.split())
    assert "bubble: warning: no law within the bounds keeps the measured shape in eq" in said
    assert "nothing doubtful" not in said
    page = (folder / "gap" / "report.html").read_text()
    assert "carry 2 doubts with it" in page


LAB = f"""
[fabric]
name = "lab"
thickness = 0.8
[law]
form = "constant"
nu12 = 0.2
{EASY}
[[strips]]
width = 25.0
rate = 100.0
warp.gauge_length = 20.0
fill.gauge_length = 16.0
data.files = ["loads.csv"]
"""


def test_check_of_strips_writes_table_of_en_iso_1421(tmp_path):
    """Warp: 1600 N (1 + 0.02 i) at 6 mm, a little less after it; fill: a single specimen."""
    rows, u = ["direction,specimen,elongation_mm,load_N"], np.linspace(0.0, 6.0, 25)
    for direction, i, most in (
        ("warp", 0, 1600),
        ("warp", 1, 1632),
        ("warp", 2, 1664),
        ("fill", 0, 400),
    ):
        own = [*zip(u, most * u / 6, strict=True), (6.2, 0.995 * most)]
        rows += [f"{direction},{direction}{i},{a},{b}" for a, b in own]
    (tmp_path / "loads.csv").write_text("\n".join(rows))
    (tmp_path / "lab.toml").write_text(LAB)
    in_process("check", "lab.toml", "--out", "out", cwd=tmp_path)
    table = pd.read_csv(tmp_path / "out" / "en-iso-1421.csv").set_index("specimen")
    one = table.loc["warp1"]
    assert one.iloc[1:5].tolist() == pytest.approx([1632, 3264, 65.28, 30.0])
    assert (one.width_mm, one.gauge_length_mm, one.rate_mm_per_min) == (25, 20, 100)
    assert table.conditioning.isna().all() and table.loc["fill0"].iloc[4] == pytest.approx(37.5)
    assert table.max_force_N["mean"] == pytest.approx(1632)
    assert table.max_force_N["standard deviation"] == pytest.approx(32)
    varied = table.loc["coefficient of variation, %"]
    assert varied.iloc[1:5].tolist() == pytest.approx([100 / 51] * 3 + [0], abs=1e-6)
    assert len(table) == 7
    page = read_page_data(tmp_path / "out")
    shown = next(p for p in page.parts if "1421" in getattr(p, "title", ""))
    assert len(shown.rows) == 7 and "100 mm/min" in shown.note


def test_fit_of_doubtful_data_does_not_begin(folder):
    done = in_process("bubble", "flipped.toml", "--starts", 1, "--out", "no", cwd=folder, code=2)
    one_line(done, "flipped.toml", "'bubble'", "y and dy have opposite senses", "[axis-flipped]")
    assert "--trust NAME" in done.stderr and not (folder / "no").exists()
    said = in_process("check", "flipped.toml", "--json", "--out", "c", cwd=folder, code=2)
    told = json.loads(said.stdout)
    (doubt,) = told["tests"]["bubble"]
    assert (doubt["name"], doubt["severity"], doubt["trusted"]) == ("axis-flipped", "error", False)
    assert not told["sound"]
    page = (folder / "c" / "report.html").read_text()
    assert "a fit would not begin." in page and "opposite senses" in page


def test_trusted_doubt_passes_and_is_recorded(folder):
    run = ("bubble", "flipped.toml", "--starts", 1, "--jobs", 1, "--out", "t")
    in_process(*run, "--trust", "axis-flipped", cwd=folder)
    (note,) = [w for w in result_in(folder / "t")["notes"] if "opposite senses" in w["note"]]
    assert "(trusted: axis-flipped)" in note["note"]
    assert (note["of"], note["kind"]) == ("bubble", "doubtful data")
    assert "opposite senses" in (folder / "t" / "notes.csv").read_text()
    assert "(trusted: axis-flipped)" in (folder / "t" / "report.html").read_text()
    # Trust in the project file is the same, and resumes the same fit.
    text = (folder / "flipped.toml").read_text()
    (folder / "t.toml").write_text(text.replace("[fit]", '[fit]\ntrust = ["axis-flipped"]'))
    in_process("bubble", "t.toml", "--starts", 1, "--resume", "--out", "t", cwd=folder)


#: Doubts about specimens beside their twins: tests/experiments/strips/test_doubts.py provokes them.
STRIP_TWINS = {"repeated-specimen": True, "odd-specimen": False}


def test_document_lists_every_doubt_and_its_limits():
    text = (ROOT / "docs" / "reference" / "doubts.md").read_text()
    parts = re.split("## Strips|## Biaxial tests", text)
    row = re.compile(r"^\| `([\w-]+)` \| (.*?) \| (.*) \|$", re.M)
    told = [{name: rest for name, *rest in row.findall(part)} for part in parts]
    traps = (
        {name: sure for _, name, sure, _ in BUBBLE_TRAPS.values()} | BUBBLE_TESTS,
        {name: sure for _, _, (name, sure, _) in STRIP_TRAPS.values()} | STRIP_TWINS,
        {name: sure for _, own in BIAXIAL_TRAPS.values() for name, (sure, _) in own.items()},
    )
    for kind, rows, own in zip(("bubble", "strips", "biaxial"), told, traps, strict=True):
        assert set(rows) == set(kinds()[kind].doubts)
        assert kind == "biaxial" or set(own) == set(rows)
        for name, sure in own.items():
            assert ("error" if sure else "warning") in rows[name][0], name
