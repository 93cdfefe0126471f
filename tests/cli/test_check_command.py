"""`bubblefit check`, and what fits do with data that are doubtful."""

from __future__ import annotations

import json
import re

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.biaxial import prepared as biaxial_doubts
from bubblefit.experiments.bubble import doubts as place
from bubblefit.experiments.kinds import ROUGH
from bubblefit.experiments.registry import kinds
from bubblefit.experiments.strips import doubts
from bubblefit.runs.fit import check, expected_of
from bubblefit.runs.setup import prepare_fit

from ..camera import camera_project
from ..commands import in_process, one_line, result_in
from ..complaints import complaint
from ..experiments.biaxial.test_biaxial_fit import TRAPS as BIAXIAL_TRAPS
from ..experiments.bubble.test_bubble_doubts import TRAPS as BUBBLE_TRAPS
from ..experiments.strips.test_strip_doubts import TRAPS as STRIP_TRAPS
from ..places import EXAMPLES, ROOT
from ..projects import small


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Good data in project.toml; the same with y flipped in the places in flipped.toml."""
    place = tmp_path_factory.mktemp("check")
    text, _ = camera_project(place, lambda x, u: (x, u))
    (place / "project.toml").write_text(text)
    (place / "flipped.toml").write_text(text.replace('y = "y"', 'y = "minus_y"'))
    for frame in place.glob("frame_*.csv"):
        table = np.loadtxt(frame, delimiter=",", skiprows=1)
        wide = np.column_stack([table, -table[:, 1]])
        names = "x,y,z,dx,dy,dz,minus_y"
        np.savetxt(frame, wide, delimiter=",", header=names, comments="", fmt="%.9g")
    return place


def test_good_data_are_said_to_be_fine(folder, golden):
    done = in_process("check", "project.toml", cwd=folder)
    golden("check", done.stdout, folder)
    out = folder / "out" / f"{folder.name}-check"
    page = (out / "report.html").read_text()
    assert "The data are fit to be fitted." in page and "Equilibrium of the apex" in page
    assert (out / "registration.png").is_file() and (out / "rises.png").is_file()


def test_a_fit_of_doubtful_data_does_not_begin(folder):
    done = in_process("bubble", "flipped.toml", "--starts", 1, "--out", "no", cwd=folder, code=2)
    one_line(done, "flipped.toml", "'bubble'", "y and dy have opposite senses", "[axis-flipped]")
    assert "--trust NAME" in done.stderr and not (folder / "no").exists()
    said = in_process("check", "flipped.toml", "--json", "--out", "c", cwd=folder, code=2)
    told = json.loads(said.stdout)
    (doubt,) = told["tests"]["bubble"]
    assert (doubt["name"], doubt["severity"], doubt["trusted"]) == ("axis-flipped", "error", False)
    assert not told["sound"]
    page = (folder / "c" / "report.html").read_text()
    assert "A fit would not begin." in page and "opposite senses" in page


def test_what_is_trusted_passes_and_is_kept(folder):
    trust = ("--trust", "axis-flipped")
    in_process(
        "bubble", "flipped.toml", "--starts", 1, "--jobs", 1, "--out", "t", *trust, cwd=folder
    )
    result = result_in(folder / "t")
    (note,) = [w for w in result["notes"] if "opposite senses" in w["note"]]
    assert "(trusted: axis-flipped)" in note["note"]
    assert (note["of"], note["kind"]) == ("bubble", "doubtful data")
    assert "opposite senses" in (folder / "t" / "notes.csv").read_text()
    assert "(trusted: axis-flipped)" in (folder / "t" / "report.html").read_text()
    # Trust in the project file is the same, and resumes the same fit.
    text = (folder / "flipped.toml").read_text()
    (folder / "t.toml").write_text(text.replace("[fit]", '[fit]\ntrust = ["axis-flipped"]'))
    again = in_process("bubble", "t.toml", "--starts", 1, "--resume", "--out", "t", cwd=folder)
    assert again.exit_code == 0


def test_only_doubts_that_there_are_can_be_trusted(folder):
    project = bf.read_project(folder / "project.toml")
    said = complaint(check, project, None, ["weather"])
    assert "fit.trust" in said and "weather" in said and "z-flipped" in said


def test_every_name_of_a_doubt_has_a_trap():
    trapped = {trap[1] for trap in BUBBLE_TRAPS.values()}
    assert trapped == set(kinds()["bubble"].doubts)
    assert {trap[2][0] for trap in STRIP_TRAPS.values()} == set(kinds()["strips"].doubts)


def test_what_is_expected_comes_from_the_bounds(tmp_path):
    """Of coefficients (their constants, or the margin) and of moduli."""
    project = bf.read_project(small(tmp_path))
    expected = expected_of(prepare_fit(project, [project.tests["bubble"]])).moduli
    assert expected["E1"] == pytest.approx((250.0, 1500.0))
    assert expected["E2"] == pytest.approx((50.0, 500.0))
    assert expected["G12"] == pytest.approx((7.0, 70.0))
    strips = bf.read_project(EXAMPLES / "uniaxial-valmex7318" / "project.toml")
    expected = expected_of(prepare_fit(strips, [strips.tests["strips"]])).moduli
    assert expected["E2"] == pytest.approx((20.0, 1000.0))


def test_strips_are_looked_at_too(tmp_path):
    path = EXAMPLES / "uniaxial-valmex7318" / "project.toml"
    done = in_process("check", path, "--out", tmp_path / "c", cwd=tmp_path)
    assert "strips: fine: nothing doubtful" in done.stdout
    page = (tmp_path / "c" / "report.html").read_text()
    assert "Load curves as read" in page and (tmp_path / "c" / "curves.png").is_file()


def test_the_document_lists_every_doubt_and_its_limits():
    text = (ROOT / "docs" / "reference" / "doubts.md").read_text()
    bubbles, strips = text.split("## Strips")
    row = re.compile(r"^\| `([\w-]+)` \| (.*?) \| (.*) \|$", re.M)
    told = {name: (severity, seen) for name, severity, seen in row.findall(bubbles)}
    assert set(told) == set(kinds()["bubble"].doubts)
    for _, name, sure, _ in BUBBLE_TRAPS.values():
        assert told[name][0].startswith("error" if sure else "warning"), name
    for value in (place.LEAST_REACH, place.MOST_REACH, place.LEAST_RISE, place.MOST_RISE):
        assert f"{value:g}" in told["length-unit"][1]
    assert f"{place.FAR_OFF:g} radii" in told["off-centre"][0]
    assert f"{place.STEEP:g} degrees" in told["tilted"][0]
    strips, biaxial = strips.split("## Biaxial tests")
    told = {name: (severity, seen) for name, severity, seen in row.findall(strips)}
    assert set(told) == set(kinds()["strips"].doubts)
    for _, _, (name, sure, _) in STRIP_TRAPS.values():
        assert told[name][0] == ("error" if sure else "warning"), name
    for value in (doubts.LEAST_END, doubts.MOST_END):
        assert f"{value:g}" in told["elongation-unit"][1]
    assert f"{doubts.FAILED:g}" in told["after-failure"][1]
    assert f"{doubts.PRELOAD:g}" in told["preload"][1]
    of_biaxial = {name: (severity, seen) for name, severity, seen in row.findall(biaxial)}
    assert set(of_biaxial) == set(kinds()["biaxial"].doubts)
    for _, traps in BIAXIAL_TRAPS.values():
        for name, (sure, _) in traps.items():
            assert ("error" if sure else "warning") in of_biaxial[name][0], name
    for value in (100 * biaxial_doubts.LEAST_END, 100 * biaxial_doubts.MOST_END):
        assert f"{value:g} %" in of_biaxial["strain-unit"][1]
    for value in (biaxial_doubts.LEAST_LOAD, biaxial_doubts.MOST_LOAD):
        assert f"{value:g}" in of_biaxial["load-unit"][1]
    assert f"{biaxial_doubts.OFF:g} degrees" in of_biaxial["ratio"][1]
    assert ROUGH == 4.0 and "four times" in told["load-unit"][1]
