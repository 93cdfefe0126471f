"""A computed bubble as image correlation exports it: registered before a fit, or fitted."""

import re
from types import SimpleNamespace
from typing import Any

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.bubble import KIND
from bubblefit.experiments.bubble.point_files import PointFiles
from bubblefit.experiments.bubble.section import CorrelationSection
from bubblefit.inference.moduli import moduli_error
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.facets import Facet
from bubblefit.reports.kinds.bubble import CORRELATION_NAMES, correlation_table
from bubblefit.runs.law_setup import law_of
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.spatial.transform import Rotation

from ...builders.projects import fit_setup, known_bubble, known_bubble_in_camera_frames
from ...support.commands import in_process, result_in
from ...support.refusals import complaint

ONE_START = ("--starts", 1, "--jobs", 1)


@pytest.fixture(scope="module")
def bubble(tmp_path_factory):
    path = known_bubble(tmp_path_factory.mktemp("computed"), ("elements = 48", "elements = 108"))
    text = path.read_text().replace('symmetry = "quarter"', 'symmetry = "full"')
    path.write_text(text)
    project = bf.read_project(path)
    test = project.tests["bubble"]
    fields = KIND.prepare(test, law_of(project, [test.reach]), MembraneSolver).fields
    points = np.column_stack([fields[0].points, np.zeros(len(fields[0].points))])
    return text, [(points, field.displacement) for field in fields]


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
    folder = tmp_path_factory.mktemp("registered")
    text, known = known_bubble_in_camera_frames(
        folder, lambda x, u: (x @ TURN.T + SHIFT, u @ TURN.T)
    )
    log = np.column_stack([5.0 + 2.0 * np.arange(len(SHOWN)), SHOWN])
    np.savetxt(folder / "valve.csv", log, "%g", ",", header="time (s),p (kPa)", comments="")
    text = re.sub("files = .*", 'files = ["frame_*.csv"]', text)
    # The data are those of the fit's own mesh.
    text = text.replace("[fit]\n", '[fit]\nmesh_error = "told"\n')
    return folder, text.replace(LAST, LAST + LOG + CAMERA + REGISTRATION), known


def project_of_registered_fit(seen, name: str, more: str = ""):
    folder, text, _ = seen
    path = folder / f"{name}.toml"
    path.write_text(text.replace(REGISTRATION, REGISTRATION + more))
    return path


def test_moduli_are_those_of_the_right_frame(seen):
    folder, _, known = seen
    path, out = project_of_registered_fit(seen, "found"), folder / "out"
    done = in_process("bubble", path, *ONE_START, "--out", out, cwd=folder)
    result = result_in(out)
    law = bf.read_card(out / "material.toml").law
    errors = moduli_error(law, known, np.array(list(result["strain_reached"].values())))
    assert max(errors.values()) < 0.01, errors
    said = result["registration"]
    assert said["warp_degrees"] == pytest.approx(12.0, abs=0.06)
    assert said["tilt_degrees"] == pytest.approx(3.0, abs=1e-3)
    np.testing.assert_allclose(said["origin_mm"], SHIFT, atol=0.02)
    page = (out / "report.html").read_text()
    for words in (
        "registration.png", "found by symmetry", "Frames taken", "clock.png", "5.00 s, given",
        '<td>camera</td><td class="text">two of 5 &lt;MP&gt;</td>',
        '<td>lens and aperture</td><td class="text">not given</td>',
        '<td>coordinates</td><td class="text">registered on the rim</td>',
        f'<td>images evaluated</td><td class="text">{len(SHOWN)}</td>',
    ):  # fmt: skip
        assert words in page, words
    taken = result["data"]["pressures"]["taken"]
    assert [one["pressure_kPa"] for one in taken] == pytest.approx(SHOWN)
    assert [one["frame"].split("_")[1][0] for one in taken] == [*"0123456"]
    assert "valve.csv: 7 of 7 frames taken" in done.output and "5.00 s, given" in done.output
    assert (out / "registration.png").stat().st_size > 20_000


def test_a_change_of_registration_is_another_fit(seen):
    marks = [bf.read_project(project_of_registered_fit(seen, "a", more)).tests["bubble"].settings()
             for more in ("", "warp = 12.0\n", 'warp_is = "soft"\n')]  # fmt: skip
    assert len({str(mark) for mark in marks}) == 3


@pytest.mark.parametrize(
    ("more", "key"),
    [
        ("warp = 1.0\nwarp_points = [[0, 0, 0], [1, 0, 0]]", ".warp"),
        ('plane = "floor"', ".plane"),
        ("warp = 400.0", ".warp"), ("centre = [1.0, 2.0]", ".centre"),
        ("centre = [500.0, 0.0, 600.0]\nplane = 'clamp'", ""),
    ],
)  # fmt: skip
def test_bad_settings_are_named(seen, more, key):
    def prepare():
        project = bf.read_project(project_of_registered_fit(seen, "bad", f"{more}\n"))
        test = project.tests["bubble"]
        KIND.prepare(test, law_of(project, [test.reach]), MembraneSolver)

    assert f"bubble[0].data.points.registration{key}" in complaint(prepare)


def read(seen, more: str) -> bf.Project:
    folder, text, _ = seen
    path = folder / "words.toml"
    path.write_text(text.replace(CAMERA, f"[bubble.data.points.correlation]\n{more}"))
    return bf.read_project(path)


def shown(correlation: dict[str, str], facet: Facet | None = None, **more: Any) -> dict[str, str]:
    usual = {"name": "one", "noise": None, "match_by": "points", "match_degree": 4}
    data = PointFiles((), None, correlation=correlation)
    test = SimpleNamespace(**(usual | {"data": data, "facet": facet} | more))
    field = SimpleNamespace(source=SimpleNamespace(format="matchid"), points=range(7))
    prepared: Any = SimpleNamespace(test=test, fields=[field], dropped=2, registration=None)
    (table,) = correlation_table(prepared)
    assert table.title == "Image correlation: one"
    return {str(name): str(words) for name, words in table.rows}


def test_what_is_not_given_is_said_to_be_not_given():
    rows = shown({})
    unknown = [name for name, words in rows.items() if words == "not given"]
    assert unknown == ["noise floor of a displacement", *CORRELATION_NAMES.values()]
    assert rows["software and format of the export"] == "matchid"
    assert rows["points in an image"] == "7 to 7" and rows["points left out as doubtful"] == "2"
    assert shown({}, noise=0.0123)["noise floor of a displacement"] == "0.0123 mm"
    assert "degree 4" in shown({}, match_by="surfaces")["smoothing"]
    # The filter gives subset and step where nobody else does.
    for own, facet, subset, step in (
        ({}, Facet(4.0, 1, 3, 1.5), "4 mm", "1.5 mm"), ({}, Facet(4.0), "4 mm", "not given"),
        ({"subset": "19 pixels"}, Facet(4.0, 1, 3, 1.5), "19 pixels", "1.5 mm"),
    ):  # fmt: skip
        rows = shown(own, facet)
        assert (rows["subset size"], rows["step size"]) == (subset, step)


def test_every_key_of_the_section_stands_on_the_page(seen):
    keys = list(CorrelationSection.model_fields)
    assert set(keys) == {"software", *CORRELATION_NAMES}
    said = {key: f"the {key}, 3 mm" for key in keys}
    lines = "".join(f'{key} = "{words}"\n' for key, words in said.items())
    ((test,), (plain,)) = (read(seen, more).tests.values() for more in (lines, ""))
    # Words change no result.
    assert test.data.correlation == said and test.settings() == plain.settings()
    rows = shown(test.data.correlation)
    assert {key: rows[name] for key, name in CORRELATION_NAMES.items()} == {
        key: said[key] for key in CORRELATION_NAMES
    }
    assert rows["software and format of the export"] == "the software, 3 mm; matchid"


@pytest.mark.parametrize(
    "more",
    ['lense = "35 mm"', "lens = 35", 'lens = ""', 'lens = "35\\nmm"', 'lens = "%s"' % (301 * "m")],
)
def test_bad_words_are_named(seen, more):
    said = complaint(read, seen, f"{more}\n")
    assert f"bubble[0].data.points.correlation.{more.split()[0]}" in said and "\n" not in said


TRUE = {"E1": 600.0, "E2": 300.0, "G12": 14.0}
PRESSURES = (0.03, 0.09, 0.15, 0.2)
LAW = bf.Law("constant", bounds={"E1": [100, 2000], "E2": [50, 1500], "G12": [1, 100]})
YARNS_TURN, TILT, ASIDE, NOISE = 8.0, 2.0, (1.5, -0.8), 0.01


def camera():
    """Return points and displacements of a disk whose yarns are turned, as a camera askew sees."""
    mesh = disk_mesh(100.0, 300)
    model = BubbleModel(mesh, 0.81, PRESSURES).with_parameters({"turn": np.radians(YARNS_TURN)})
    moved = MembraneSolver().run(model, HypoelasticLaw.linear(*TRUE.values())).displacement
    c, s = np.cos(np.radians(TILT)), np.sin(np.radians(TILT))
    seen = moved @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T
    seen = seen + NOISE * np.random.default_rng(4).standard_normal(seen.shape)
    inside = np.hypot(*mesh.points[:, :2].T) < 96
    return mesh.points[inside] + (*ASIDE, 0.0), seen[:, inside]


def fitted(**nuisance):
    points, seen = camera()
    bubble = bf.Bubble(
        points, seen, PRESSURES, radius=100.0, elements=300, objective="mm", noise=NOISE,
        nuisance=nuisance,
    )  # fmt: skip
    trusted = ["off-centre", "turned", "tilted", "radius", "camera-frame"]
    fabric = bf.Fabric("turned", 0.81)
    return bf.fit([bubble], LAW, fabric=fabric, starts=3, jobs=1, trust=trusted, mesh_error="told")


def test_turn_tilt_and_shift_are_found_with_their_sigma():
    found = fitted(registration="fitted")
    table = found.coefficients().set_index("unknown")
    known = {"turn": YARNS_TURN, "tilt_x": TILT, "tilt_y": 0.0}
    known |= {"shift_x": -ASIDE[0], "shift_y": -ASIDE[1]}
    for name, value in known.items():
        assert table.value[name] == pytest.approx(value, abs=0.1), name
        assert abs(table.value[name] - value) < 4 * table.sigma[name] + 0.01, name
    for name, value in TRUE.items():
        assert found.law.modulus(name, 0.0) == pytest.approx(
            value, rel=0.1 if name == "G12" else 0.01
        )


def test_a_fit_begins_where_the_fields_are_symmetric_and_rise():
    points, seen = camera()
    bubble = bf.Bubble(points, seen, PRESSURES, radius=100.0, elements=300, noise=NOISE,
                       nuisance={"registration": "fitted"})  # fmt: skip
    setup = fit_setup(bf.Project.of([bubble], LAW, fabric=bf.Fabric("turned", 0.81)))
    unknowns = setup.problem().unknowns
    begin = dict(zip(unknowns.nuisance.names, unknowns.nuisance.begin, strict=True))
    assert begin["turn"] == pytest.approx(YARNS_TURN, abs=1.5)
    assert begin["tilt_x"] == pytest.approx(TILT, abs=0.3) and abs(begin["tilt_y"]) < 0.3
    assert begin["shift_x"] == pytest.approx(-ASIDE[0], abs=0.5)
    assert begin["shift_y"] == pytest.approx(-ASIDE[1], abs=0.5)
    assert not unknowns.nuisance.start.any()


def test_a_quarter_cannot_be_turned():
    points, seen = camera()
    bubble = bf.Bubble(
        points, seen, PRESSURES, radius=100.0, symmetry="quarter", nuisance={"turn": 5.0}
    )
    assert "nuisance.turn" in complaint(bf.fit, [bubble], LAW, fabric=bf.Fabric("turned", 0.81))
