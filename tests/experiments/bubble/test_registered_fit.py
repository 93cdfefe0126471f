"""A fit of what a camera saw from anywhere, beside one of the same data in the test's own frame."""

from __future__ import annotations

import re

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.inference.assessment import moduli_error
from bubblefit.runs.setup import law_of
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.spatial.transform import Rotation

from ...camera import camera_project
from ...commands import in_process, result_in
from ...complaints import complaint

#: Warp turned by 12 degrees, the sheet tilted by 3, 600 mm away and 5 mm off the middle.
TURN = Rotation.from_euler("zx", [12.0, 3.0], degrees=True).as_matrix()
SHIFT = np.array([3.0, -4.0, 600.0])
#: kPa.
SHOWN = [22, 59, 97, 132, 186, 251, 300]
LAST = 'length_unit = "mm"\n'
CAMERA = '[bubble.data.points.correlation]\ncamera = "two of 5 <MP>"\n'
LOG = "[bubble.data.points.pressure.log]\nfile = 'valve.csv'\nrate = 0.5\noffset = 5\n"
REGISTRATION = "[bubble.data.points.registration]\n"


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """A folder with frames and a log of their pressures, the text of a project, the law behind."""
    folder = tmp_path_factory.mktemp("registered")
    text, known = camera_project(folder, lambda x, u: (x @ TURN.T + SHIFT, u @ TURN.T))
    log = np.column_stack([5.0 + 2.0 * np.arange(len(SHOWN)), SHOWN])
    np.savetxt(folder / "valve.csv", log, "%g", ",", header="time (s),p (kPa)", comments="")
    text = re.sub("files = .*", 'files = ["frame_*.csv"]', text)
    return folder, text.replace(LAST, LAST + LOG + CAMERA + REGISTRATION), known


def project_of(seen, name: str, more: str = ""):
    folder, text, _ = seen
    path = folder / f"{name}.toml"
    path.write_text(text.replace(REGISTRATION, REGISTRATION + more))
    return path


def test_moduli_are_those_of_the_right_frame(seen):
    """Within 1 % over the strain reached."""
    folder, _, known = seen
    path = project_of(seen, "found")
    done = in_process(
        "bubble", path, "--starts", 1, "--jobs", 1, "--out", folder / "out", cwd=folder
    )
    result = result_in(folder / "out")
    law = bf.read_card(folder / "out" / "material.toml").law
    errors = moduli_error(law, known, np.array(list(result["strain_reached"].values())))
    assert max(errors.values()) < 0.01, errors
    said = result["registration"]
    assert said["warp_degrees"] == pytest.approx(12.0, abs=0.06)
    assert said["tilt_degrees"] == pytest.approx(3.0, abs=1e-3)
    np.testing.assert_allclose(said["origin_mm"], SHIFT, atol=0.02)
    page = (folder / "out" / "report.html").read_text()
    assert "registration.png" in page and "found by symmetry" in page
    # What the lens was nobody said; what was made of the frames is known.
    record = page[page.index("Image correlation: ") : page.index("Files of the folder")]
    assert '<td>camera</td><td class="text">two of 5 &lt;MP&gt;</td>' in record
    assert '<td>lens and aperture</td><td class="text">not given</td>' in record
    assert '<td>coordinates</td><td class="text">registered on the rim</td>' in record
    assert f'<td>images evaluated</td><td class="text">{len(SHOWN)}</td>' in record
    assert "Frames taken" in page and "clock.png" in page and "5.00 s, given" in page
    taken = result["data"]["pressures"]["taken"]
    assert [one["pressure_kPa"] for one in taken] == pytest.approx(SHOWN)
    assert [one["frame"].split("_")[1][0] for one in taken] == [*"0123456"]
    assert "pressures from the log valve.csv: 7 of 7 frames taken" in done.output
    assert "clock of the log less that of the frames: 5.00 s, given" in done.output
    assert (folder / "out" / "registration.png").stat().st_size > 20_000


def test_a_change_of_registration_is_another_fit(seen):
    """--resume must not take a fit of other coordinates for this one."""
    marks = [bf.read_project(project_of(seen, "a", more)).tests["bubble"].settings()
             for more in ("", "warp = 12.0\n", 'warp_is = "soft"\n')]  # fmt: skip
    assert len({str(mark) for mark in marks}) == 3


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("warp = 1.0\nwarp_points = [[0, 0, 0], [1, 0, 0]]\n", ["warp", "not both"]),
        ('plane = "floor"\n', ["plane"]),
        ("warp = 400.0\n", ["warp", "180"]),
        ("centre = [1.0, 2.0]\n", ["centre"]),
    ],
)
def test_bad_settings_are_named(seen, more, words):
    said = complaint(bf.read_project, project_of(seen, "bad", more))
    assert all(word in said for word in ["bubble[0].data.points.registration", *words]), said


def test_what_cannot_be_found_names_the_key(seen):
    path = project_of(seen, "far", "centre = [500.0, 0.0, 600.0]\nplane = 'clamp'\n")
    project = bf.read_project(path)
    test = project.tests["bubble"]
    said = complaint(test.prepare, law_of(project, [test.reach]), MembraneSolver)
    assert "bubble[0].data.points.registration" in said
