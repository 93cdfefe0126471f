"""One computed bubble in every export of image correlation: the same data and the same fit."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.bubble import KIND, report
from bubblefit.experiments.bubble.findings import registration_line, registration_numbers
from bubblefit.experiments.bubble.point_files import PointFiles
from bubblefit.experiments.bubble.report import ASKED, correlation_table, registration_table
from bubblefit.experiments.bubble.section import CorrelationSection
from bubblefit.experiments.kinds import Output, Weighting
from bubblefit.inference.assessment import moduli_error
from bubblefit.meshes.disk import Outline
from bubblefit.meshes.reading import Facet
from bubblefit.readers.fields import DisplacementField
from bubblefit.runs.setup import law_of
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.spatial.transform import Rotation

from ...camera import camera_project
from ...commands import in_process, result_in
from ...complaints import complaint
from ...dic_exports import EXPORTS
from ...drawings import caught
from ...projects import EASY, small

DATA = re.compile(r"(?m)^\[bubble\.data\.known_solution\].*?(?=^\[fit\])", re.S)


@pytest.fixture(scope="module")
def bubble(tmp_path_factory):
    """The text of a project of computed data, and its frames."""
    return computed(tmp_path_factory.mktemp("computed"), ("elements = 48", "elements = 108"))


@pytest.fixture(scope="module")
def coarse(tmp_path_factory):
    """The same of two pressures and a law of constant moduli, for whole fits."""
    changes = (("[22, 59, 97, 132, 186, 251, 300]", "[59, 186]"),)
    text, frames = computed(tmp_path_factory.mktemp("coarse"), *changes)
    first, last = text.index("# Table 4.2. Order"), text.index("[[bubble]]")
    margin = next(line for line in text.splitlines() if line.startswith("margin"))
    text = (text[:first] + EASY + text[last:]).replace(margin, "")
    return text.replace('form = "cubic"', 'form = "constant"'), frames


def computed(folder, *changes):
    """The text of the known-solution example, whole, and its frames."""
    path = small(folder, *changes)
    path.write_text(path.read_text().replace('symmetry = "quarter"', 'symmetry = "full"'))
    project = bf.read_project(path)
    test = project.tests["bubble"]
    fields = KIND.prepare(test, law_of(project, [test.reach]), MembraneSolver).fields
    points = np.column_stack([fields[0].points, np.zeros(len(fields[0].points))])
    return path.read_text(), [(points, field.displacement) for field in fields]


def project_of(bubble, folder, case: str):
    text, frames = bubble
    files = [file.name for file in EXPORTS[case][1](folder, frames)]
    path = folder / "project.toml"
    path.write_text(DATA.sub(f"[bubble.data.points]\nfiles = {files}\n\n", text))
    return path


def targets(path) -> list[np.ndarray]:
    project = bf.read_project(path)
    test = project.tests["bubble"]
    prepared = KIND.prepare(test, law_of(project, [test.reach]), MembraneSolver)
    (comparison,) = prepared.comparisons(MembraneSolver, Weighting(False, 1.0))
    return [target.displacement for target in comparison.objective.targets]


@pytest.mark.parametrize("case", [case for case in EXPORTS if case != "plain"])
def test_a_fit_gets_the_same_data_from_every_export(bubble, tmp_path, case):
    (tmp_path / "plain").mkdir()
    expected = targets(project_of(bubble, tmp_path / "plain", "plain"))
    for one, other in zip(targets(project_of(bubble, tmp_path, case)), expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)


def constant_fit(coarse, folder, case: str) -> np.ndarray:
    """Moduli of a whole fit, one start."""
    result = bf.fit(bf.read_project(project_of(coarse, folder, case)), starts=1, jobs=1)
    return np.array([float(result.law.modulus(name, 0.0)) for name in ("E1", "E2", "G12")])


@pytest.fixture(scope="module")
def plain_moduli(coarse, tmp_path_factory):
    return constant_fit(coarse, tmp_path_factory.mktemp("plain"), "plain")


@pytest.mark.parametrize("case", [case for case in EXPORTS if case != "plain"])
def test_the_moduli_are_the_same_from_every_export(coarse, plain_moduli, tmp_path, case):
    moduli = constant_fit(coarse, tmp_path, case)
    np.testing.assert_allclose(moduli, plain_moduli, rtol=1e-9)


def test_the_fit_is_the_same_and_says_what_was_read(bubble, tmp_path):
    results = []
    for case in ("plain", "pyaldic"):
        folder = tmp_path / case
        folder.mkdir()
        path = project_of(bubble, folder, case)
        done = in_process(
            "bubble", path, "--starts", 1, "--jobs", 1, "--out", folder / "out", cwd=folder
        )
        results.append(result_in(folder / "out"))
    assert "data: y and z are turned over" in done.output
    assert "data: x, y, z are places in the deformed state" in done.output
    plain, other = results
    np.testing.assert_allclose(other["beta"]["values"], plain["beta"]["values"], rtol=1e-6)
    assert plain["data"]["dropped"] == {} and plain["data"]["read"]["format"] == "csv"
    assert other["data"]["dropped"] == {"without a value": 7}
    assert other["data"]["read"]["columns"]["dz"] == "W"


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


def project_of_registered_fit(seen, name: str, more: str = ""):
    folder, text, _ = seen
    path = folder / f"{name}.toml"
    path.write_text(text.replace(REGISTRATION, REGISTRATION + more))
    return path


def test_moduli_are_those_of_the_right_frame(seen):
    """Within 1 % over the strain reached."""
    folder, _, known = seen
    path = project_of_registered_fit(seen, "found")
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
    marks = [bf.read_project(project_of_registered_fit(seen, "a", more)).tests["bubble"].settings()
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
    said = complaint(bf.read_project, project_of_registered_fit(seen, "bad", more))
    assert all(word in said for word in ["bubble[0].data.points.registration", *words]), said


def test_what_cannot_be_found_names_the_key(seen):
    path = project_of_registered_fit(seen, "far", "centre = [500.0, 0.0, 600.0]\nplane = 'clamp'\n")
    project = bf.read_project(path)
    test = project.tests["bubble"]
    said = complaint(KIND.prepare, test, law_of(project, [test.reach]), MembraneSolver)
    assert "bubble[0].data.points.registration" in said


MOTIONS = (
    SimpleNamespace(points=9, shift=np.array([0.3, 0.4, 0.0]), angle=0.25),
    SimpleNamespace(points=0, shift=np.array([9.0, 9.0, 9.0]), angle=9.0),
    SimpleNamespace(points=4, shift=np.array([0.0, 0.0, 0.1]), angle=0.75),
)


def found(**other: Any) -> Any:
    said = {
        "placement": SimpleNamespace(
            origin=np.array([1.234, -5.678, 600.0]), axes=np.eye(3), tilt=1.456
        ),
        "rim": SimpleNamespace(error=0.123), "warp": SimpleNamespace(error=0.456, clear=0.87),
        "warp_angle": 12.346, "plane_of": "clamp", "flatness": 0.0678, "motions": MOTIONS,
        "options": SimpleNamespace(remove_clamp_motion=True, warp_is_stiff=True),
    }  # fmt: skip
    return SimpleNamespace(**(said | other))


def test_numbers():
    assert registration_numbers(found()) == {
        "origin_mm": [1.234, -5.678, 600.0], "axes": np.eye(3).tolist(),
        "plane": {"of": "clamp", "deviation_mm": 0.0678}, "tilt_degrees": 1.456,
        "centre": {"error_mm": 0.123}, "warp_degrees": 12.346,
        "warp": {"error_degrees": 0.456, "clear": 0.87},
        "clamp_motion": {
            "removed": True, "shift_mm": [pytest.approx(0.5), pytest.approx(0.1)],
            "turn_degrees": [0.25, 0.75],
        },
    }  # fmt: skip
    left = SimpleNamespace(remove_clamp_motion=False, warp_is_stiff=True)
    bare = registration_numbers(found(rim=None, warp=None, options=left))
    assert (bare["centre"], bare["warp"]) == ("given", "given")
    assert bare["clamp_motion"]["removed"] is False
    assert registration_numbers(found(motions=MOTIONS[1:2]))["clamp_motion"] == {
        "removed": False, "shift_mm": [], "turn_degrees": []
    }  # fmt: skip


def test_table_and_line():
    numbers = ("1.46", "0.068 mm"), ("1.23, -5.68, 600.00", "0.12"), ("12.35", "0.46"), ("0.5 mm",)
    rows = registration_table(found()).rows
    for row, words in zip(rows, numbers, strict=True):
        assert all(word in " ".join(row) for word in words), row
    assert "87%" in rows[2][2] and "stiffer" in rows[2][2] and rows[3][2] == "removed"
    soft = SimpleNamespace(remove_clamp_motion=False, warp_is_stiff=False)
    other = registration_table(found(options=soft, plane_of="camera", rim=None)).rows
    assert "camera" in other[0][2] and other[1][2] == "given"
    assert "softer" in other[2][2] and other[3][2] == "left in"
    turned = SimpleNamespace(error=0.456, clear=None)
    bare = registration_table(found(warp=turned, plane_of="edge", motions=())).rows
    assert "edge" in bare[0][2] and "elliptic" in bare[2][2] and bare[3][1] == "not known"
    assert registration_table(found(warp=None)).rows[2][2] == "given"
    for warp, end in ((found().warp, "(+- 0.5)"), (None, "(given)")):
        line = registration_line(found(warp=warp))
        assert "1.23, -5.68, 600.00 mm, tilt 1.46, warp 12.35" in line and line.endswith(end)


def test_maps(tmp_path, monkeypatch):
    drawn = caught(monkeypatch, report, "registration_charts")
    points, edge = np.ones((3, 2)), Outline.circle(100.0)
    moved = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 3.0]])
    first = DisplacementField(0.01, points, 0 * moved)
    for z in (None, np.array([4.0, 5.0, 6.0])):
        last = DisplacementField(0.2, points, moved, z=z)
        shown = report.registration_picture([first, last], edge, Output(tmp_path, "b-"))
        assert shown == (
            "b-registration.png",
            "measured points in the test's coordinates, the rim, warp and fill",
        )
    (_, _, (rise,), outline), (path, places, (height, again), _) = drawn
    assert path == tmp_path / "b-registration.png" and places is points
    assert rise[0] == again[0] == "rise at 200 kPa, mm" and rise[1].tolist() == [1.0, 2.0, 3.0]
    assert height[0] == "reference height z, mm" and height[1].tolist() == [4.0, 5.0, 6.0]
    np.testing.assert_array_equal(outline, edge.edge())


PROJECT = """
[fabric]
thickness = 0.8
[law]
form = "constant"
[law.bounds]
E1 = [0.2, 1.5]
E2 = [0.2, 1.5]
G12 = [0.02, 0.3]
[[bubble]]
radius = 100.0
pressures = [30]
[bubble.data.points]
files = ["a.csv"]
[bubble.data.points.correlation]
"""


def read(folder, more: str) -> bf.Project:
    path = folder / "project.toml"
    path.write_text(PROJECT + more)
    (folder / "a.csv").write_text("x,y,dx,dy,dz\n0,0,0,0,1\n")
    return bf.read_project(path)


def shown(correlation: dict[str, str], facet: Facet | None = None, **more: Any) -> dict[str, str]:
    test = SimpleNamespace(
        name="one", data=PointFiles((), None, correlation=correlation), facet=facet,
        **({"noise": None, "match_by": "points", "match_degree": 4} | more),
    )  # fmt: skip
    field = SimpleNamespace(source=SimpleNamespace(format="matchid"), points=range(7))
    prepared: Any = SimpleNamespace(test=test, fields=[field], dropped=2, registration=None)
    (table,) = correlation_table(prepared)
    assert table.title == "Image correlation: one"
    rows = {str(name): str(words) for name, words in table.rows}
    assert len(rows) == len(table.rows)
    return rows


def test_what_is_not_given_is_said_to_be_not_given():
    rows = shown({})
    assert [name for name, words in rows.items() if words == "not given"] == [
        "noise floor of a displacement", *ASKED.values()
    ]  # fmt: skip
    assert rows["software and format of the export"] == "matchid"
    assert rows["points in an image"] == "7 to 7" and rows["points left out as doubtful"] == "2"
    assert shown({}, noise=0.0123)["noise floor of a displacement"] == "0.0123 mm"
    surfaces = shown({}, match_by="surfaces")
    assert surfaces["smoothing"] == "polynomial surfaces of degree 4"


def test_every_key_of_the_section_stands_on_the_page(tmp_path):
    keys = list(CorrelationSection.model_fields)
    assert set(keys) == {"software", *ASKED}
    said = {key: f"the {key}, 3 mm" for key in keys}
    project = read(tmp_path, "".join(f'{key} = "{words}"\n' for key, words in said.items()))
    (test,) = project.tests.values()
    assert test.data.correlation == said
    rows = shown(test.data.correlation)
    assert {key: rows[name] for key, name in ASKED.items()} == {key: said[key] for key in ASKED}
    assert rows["software and format of the export"] == "the software, 3 mm; matchid"


def test_the_filter_tells_subset_and_step_where_nobody_else_does():
    facet = Facet(4.0, 1, 3, 1.5)
    rows = shown({}, facet)
    assert (rows["subset size"], rows["step size"]) == ("4 mm", "1.5 mm")
    rows = shown({"subset": "19 pixels"}, facet)
    assert (rows["subset size"], rows["step size"]) == ("19 pixels", "1.5 mm")
    assert shown({}, Facet(4.0))["step size"] == "not given"


def test_words_change_no_result(tmp_path):
    one, other = (
        next(iter(read(tmp_path, more).tests.values())).settings()
        for more in ("", 'lens = "35 mm, f/8"\n')
    )
    assert one == other


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('lense = "35 mm"\n', ["lense"]), ("lens = 35\n", ["lens"]), ('lens = ""\n', ["lens"]),
        ('lens = "35 mm\\nf/8"\n', ["lens"]), (f'lens = "{301 * "m"}"\n', ["lens"]),
    ],
)  # fmt: skip
def test_bad_words_are_named(tmp_path, more, words):
    said = complaint(read, tmp_path, more)
    assert all(w in said for w in ["bubble[0].data.points.correlation", *words]), said
    assert "\n" not in said
