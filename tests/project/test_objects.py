"""Tests, laws and sheets as objects: every key is the same through objects and a project file."""

import re
import runpy
from dataclasses import fields, is_dataclass
from itertools import islice

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
import tomli_w
from bubblefit.errors import InputError
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.notes import GRAVE
from bubblefit.project.objects import plain
from bubblefit.project.schema import project_schema
from bubblefit.readers.sections import in_base_units

from ..builders.measured_arrays import FABRIC, PRESSURES, project_of
from ..builders.projects import (
    constant_strips,
    fit_setup,
    write_camera_arrays,
    write_two_camera_exports,
)
from ..support.paths import EXAMPLES, ROOT
from ..support.refusals import raised, refused

#: Of `constant_strips`.
ELONGATION = np.linspace(0.2, 3.0, 12)


def test_arrays_become_moduli_in_twelve_lines(camera, monkeypatch):
    script = ROOT / "tests" / "typed" / "first_fit.py"
    assert len(script.read_text().splitlines()) <= 12
    monkeypatch.chdir(camera.parent)
    at_rest = runpy.run_path(str(script))["moduli"].query("strain == 0").set_index("modulus")
    assert at_rest["MPa"].loc[["E1", "E2"]].tolist() == pytest.approx(
        [400.0, 200.0], rel=0.06
    )  # 48 quads
    assert {path.name for path in camera.parent.iterdir()} == {"camera.npz"}


def test_error_found_by_project_names_argument(arrays):
    def complaint(*tests, law="constant", **more):
        return refused(bf.fit, tests, bf.Law(law), fabric=FABRIC, starts=1, **more)

    odd = bf.Bubble(**arrays, radius=100.0, symmetry="quarter", sheet=bf.Sheet(modes=2))
    error = complaint(odd)
    assert (error.path, error.field) == ("bubble", "sheet.modes")
    error = complaint(odd, odd.with_keys(name="bubble"))
    assert (error.path, error.field) == ("bubble", "sheet.modes")
    flat = bf.Bubble(**{**arrays, "displacements": arrays["displacements"] * 1e200}, radius=100.0)
    assert "bubblefit-arrays" not in str(complaint(flat))
    good = bf.Bubble(**arrays, radius=100.0, elements=48, symmetry="quarter")
    assert complaint(good, startss=3).field == "startss"
    assert complaint(good, tolerance=-1.0).field == "tolerance"
    assert complaint(good, weights={"strips": 2}).field == "weights.strips"
    assert complaint(good, law="cubic").field == "law.strain_range"
    raised(InputError, r"^form: .*'spline'", bf.Law, "splin")
    raised(InputError, r"^knot: .*'knots'", bf.Law, "spline", knot=6)
    for missing in ("law", "fabric"):
        given = {"law": bf.Law("constant"), "fabric": FABRIC, missing: None}
        raised(InputError, f"^{missing}: ", bf.fit, [good], **given)


def test_strips_of_arrays_equal_those_of_files(tmp_path):
    read = bf.read_project(constant_strips(tmp_path))
    moduli = {"warp": (300.0, 360.0), "fill": (200.0, 180.0)}
    curves = {
        direction: [(ELONGATION, 20 * e * np.log1p(ELONGATION / 20)) for e in two]
        for direction, two in moduli.items()
    }
    keys = {"match": "points", "increments": 8, "name": "one", "width": 25.0}
    ends = {"warp": {"final_length": 22.9}, "fill": {"final_length": 22.9}}
    table = pd.DataFrame(
        [
            (direction, name, u, load)
            for direction, several in curves.items()
            for name, (us, loads) in zip("ab", several, strict=True)
            for u, load in zip(us, loads, strict=True)
        ],
        columns=["direction", "specimen", "elongation", "load"],
    )
    stacked = {d: [np.column_stack(curve) for curve in two] for d, two in curves.items()}
    law = bf.Law("constant", nu12=0.0, strain_range=[0.12, 0.14, 0.1])
    files = bf.Strips.read(tmp_path / "one.csv", gauge=20, **keys, **ends)
    own = read.tests["one"].strips
    for made in (curves, table, stacked, files):
        if not isinstance(made, bf.Strips):
            made = bf.Strips(made, gauge=20, **keys, **ends)
        project = bf.Project.of(made, law, fabric=FABRIC)
        for direction, strip in project.tests["one"].strips.items():
            for mine, theirs in zip(strip.points, own[direction].points, strict=True):
                np.testing.assert_array_equal(mine, theirs)
    with pytest.raises(InputError, match=r"^curves.warp\[1\]"):
        bf.Strips({"warp": [curves["warp"][0], (ELONGATION, ELONGATION[1:])]})
    raised(InputError, r"^curves.wrap: .*'warp'", bf.Strips, {"wrap": curves["warp"]})
    raised(InputError, "there is no file", bf.Strips.read, tmp_path / "none.csv")


def test_strips_by_angle_are_alike_from_arrays_and_files(tmp_path):
    curve = ELONGATION, 5e3 * np.log1p(ELONGATION / 20)
    for angle in (0, 22.5, 75):
        rows = [f"{u!r},{load!r}" for u, load in zip(*map(np.ndarray.tolist, curve), strict=True)]
        head = "elongation (mm),load (N)"
        (tmp_path / f"s{angle}.csv").write_text("\n".join([head, *rows]))
    keys = {"gauge": 20, "width": 2.0, "side_by_side": 12}
    law = bf.Law("constant", nu12=0.0, strain_range=[0.12, 0.14, 0.1])
    files = {0: tmp_path / "s0.csv", 22.5: tmp_path / "s22.5.csv", 75: tmp_path / "s75.csv"}
    for test in (
        bf.Strips({0: curve, 22.5: curve, 75: curve}, **keys),
        bf.Strips.read(files, **keys),
    ):
        project = bf.Project.of(test, law, fabric=FABRIC)
        strips = project.tests["strips"].strips
        assert list(strips) == ["warp", "22.5 degrees", "75 degrees"]
        assert {strip.gauge_length for strip in strips.values()} == {20.0}
        assert project.tests["strips"].total_width == 24.0
    raised(InputError, "unknown direction '105 deg'", bf.Strips, {105: curve})


def objective(project):
    """The objective at the first point drawn that can be run: every residual counts."""
    problem = fit_setup(project).problem()
    for drawn in islice(problem.starts.candidates(problem.unknowns, 1, 0), 20):
        point = problem.evaluate(problem.unknowns.at(drawn), False)
        if point is not None:
            return point.value
    raise AssertionError("no point can be run")


def round_trip(project, folder, **how):
    """The project through objects, and these through a project file."""
    made = bf.Project.of(**project.objects, **how)
    path = made.to_toml(folder / "again.toml")
    again = bf.read_project(path, **how)
    assert again.to_toml(folder / "thrice.toml").read_text() == path.read_text()
    return made, again


def test_arrays_of_a_project_file_are_in_a_folder_beside_it(tmp_path):
    curve = ELONGATION, 5e3 * np.log1p(ELONGATION / 20)
    law = bf.Law("constant", strain_range=[0.12, 0.14, 0.1])
    project = bf.Project.of(bf.Strips({"warp": curve}, gauge=20), law, fabric=FABRIC)
    path = project.to_toml(tmp_path / "again.toml")
    (file,) = (tmp_path / "again-data").iterdir()
    assert f"again-data/{file.name}" in path.read_text()
    elongation, load = bf.read_project(path).tests["strips"].strips["warp"].points
    np.testing.assert_allclose([elongation, load], curve)


ALONE = sorted(
    str(file.relative_to(EXAMPLES))
    for file in EXAMPLES.glob("*/*.toml")
    if file.name != "pyproject.toml"
    and file.parent.name != "plug-in"
    # Those of tests 2 and 3 name other files and nothing else.
    and not file.name.startswith(("test2", "test3"))
)


#: Folders of the measured data of examples without a bubble.
FOLDERS = {
    "uniaxial-valmex7318": "uniaxial",
    "etfe-foil": "etfe",
    "strips-nylon": "strips_directions",
    "soft-membranes/artery.toml": "artery_ratios",
    "soft-membranes/tissue.toml": "tissue_biaxial",
}


@pytest.mark.parametrize("example", ALONE)
def test_examples_are_the_same_through_objects_and_toml(example, tmp_path, request):
    data = None
    if "--data FOLDER" in (EXAMPLES / example).read_text():
        data = request.getfixturevalue("shared_data")
        folder = FOLDERS.get(example, FOLDERS.get(example.partition("/")[0]))
        data = {"bubble": data / "bubble"} if folder is None else data / folder
    project = bf.read_project(EXAMPLES / example, data)
    others = round_trip(project, tmp_path)
    if not project.chosen(None)[0].kind == "cylinder":
        assert [objective(other) for other in others] == [objective(project)] * 2
    for other in others:
        for name, test in project.tests.items():
            assert other.tests[name].settings() == test.settings()
        for name, card in project.cards.items():
            same = other.cards[name].card
            np.testing.assert_array_equal(same.law.beta, card.card.law.beta)
            assert same.thickness == card.card.thickness


SCHEMA = project_schema(with_plug_ins=False)


UNITS = {"modulus": "GPa", "pressure": "kPa", "length": "m"}


#: What each kind of test needs.
LEAST = {
    "bubble": {"radius": 0.1, "pressures": [20.0, 40.0], "data": {"points": {"files": ["a", "b"]}}},
    "strips": {"warp": {"gauge_length": 0.02, "final_length": 0.023}, "data": {"files": ["c"]}},
    "biaxial": {"data": {"files": ["d"]}},
    "cylinder": {"diameter": 0.15, "pressure": 100.0},
    "bending": {"diameter": 0.15, "pressure": 100.0, "measured": {"files": ["g"]}},
    "cycles": {"files": {"warp": ["e"]}},
    "tube": {"diameter": 0.2, "file": "f"},
}


def resolved(part):
    return SCHEMA["$defs"][part["$ref"].rsplit("/", 1)[1]] if "$ref" in part else part


def keys(part, at=()):
    """Every key below a part of the schema, with one valid value of each sort that it has."""
    part = resolved(part)
    for choice in map(resolved, part.get("anyOf", [part])):
        inner = resolved(choice.get("items", {})) if choice.get("type") == "array" else choice
        if inner.get("properties"):
            for key, own in inner["properties"].items():
                yield from keys(own, (*at, key))
        else:
            yield at, value(choice)


def value(part):
    part = resolved(part)
    if "anyOf" in part:
        return value(part["anyOf"][0])
    if "enum" in part or "const" in part:
        return part.get("enum", [part.get("const")])[-1]
    if part["type"] == "array":
        return [value(part["items"])] * part.get("minItems", 1)
    if part["type"] in ("number", "integer"):
        low = max(part.get("minimum", part.get("exclusiveMinimum", 0)), -2)
        high = part.get("maximum", part.get("exclusiveMaximum", 1e9))
        chosen = min(low + 1, (low + high) / 2)
        return int(chosen) if part["type"] == "integer" else low + (chosen - low) / 3
    return {"boolean": True, "string": "text", "object": {}}[part["type"]]


def nested(path, own):
    return {path[0]: nested(path[1:], own)} if path else own


def merged(one, other):
    both = {k: merged(one[k], other[k]) for k in one.keys() & other.keys()
            if isinstance(one[k], dict) and isinstance(other[k], dict)}  # fmt: skip
    return {k: v for k, v in {**one, **other, **both}.items() if v is not None}


def content(part):
    """All that a test is, in plain values, but its place."""
    if is_dataclass(part):
        every = {f.name: getattr(part, f.name) for f in fields(part)}
        return {k: content(v) for k, v in every.items() if k not in ("place", "section")}
    if isinstance(part, (list, tuple)):
        return [content(own) for own in part]
    if isinstance(part, dict):
        return {k: content(v) for k, v in part.items()}
    return part.tolist() if isinstance(part, np.ndarray) else str(part) if part is None else part


BEAM = {"model": "beam", "span": 3.0, "load_spacing": 1.0}


PLAIN = {**BEAM, "wall": {"axial": 20.0, "hoop": 60.0, "shear": 9.0}}


BRAID = {"angle": 65.0, "yarn_shear": 2.0, "bladder": 9.6, "bladder_shear": 3.3}


BRAID |= {"pressure": [60.0, 100.0], "yarn": [1e3, 2e3], "across": [0.1, 0.2]}


KNOWN = {"data": {"points": None, "known_solution": {"beta": [0.1] * 12}}}


#: What stands beside a key, or in place of its value, so that the whole makes sense.
GAUGES = {
    "data": {
        "points": None,
        "heights": {
            "places": [[0.01, 0.02]],
            "values": {"pressure": [20.0, 40.0], "height": [0.01, 0.02], "specimen": [1, 1]},
        },
    }
}
PROFILES = {
    "data": {
        "points": None,
        "profiles": {
            "values": {
                "pressure": [20.0, 40.0],
                "coordinate": [0.01, 0.01],
                "height": [0.01, 0.02],
                "axis": ["x", "x"],
            },
        },
    }
}
APEX = {
    "data": {
        "points": None,
        "apex": {
            "span": 0.01,
            "values": {
                "pressure": [20.0, 40.0],
                "curvature_warp": [0.001, 0.002],
                "curvature_fill": [0.001, 0.002],
                "strain_warp": [0.001, 0.002],
                "strain_fill": [0.001, 0.002],
                "specimen": [1, 1],
            },
        },
    }
}
NAMED = {"columns": {"curvature_warp": "k", "strain_warp": "e"}}
#: Units are of tables in files.
TABLES_IN_FILES = {
    f"bubble.data.{table}.{unit}_unit": {
        "data": {"points": None, table: {"files": ["a"], **(NAMED if table == "apex" else {})}}
    }
    for table in ("heights", "profiles", "apex")
    for unit in ("pressure", "length", "curvature", "strain")
}
COMPANIONS = {
    **TABLES_IN_FILES,
    "cycles.files.bias": {"gauge_length": 0.02},
    "biaxial.data.files": {"data": {"files": {"1:1": ["d"]}}},
    "bubble.ellipse": {"radius": None, "ellipse": {"major": 0.1, "minor": 0.08}},
    "bubble.cord": {"cord": [
        {"ends": [[-0.1, 0.0], [0.1, 0.0]], "stiffness": 1e5, "tension_only": False},
        {"ends": [[0.02, 0.01], [0.05, -0.03]], "strain": [0.0, 0.02], "force": [0.0, 9e3],
         "prestrain": 1e-3},
    ]},
    "bubble.pressures": {"data": {"points": {"files": ["a"]}}},
    "bubble.inflation": {
        "pressures": [10.0, 30.0, 50.0] * 2, "data": {"points": {"files": [*"abcdef"]}}
    },
    "bubble.radius": {"radius": 0.2},
    "bubble.increments": {"increments": [30.0]},
    "bubble.sheet.prior": {"sheet": {"modes": 3}},
    "bubble.sheet.misfit": {"sheet": {"modes": 3}},
    "bubble.sheet.slack_prior": {"sheet": {"slack": True}},
    "bubble.sheet.metric_prior": {"sheet": {"metric": 3}},
    "bubble.sheet.from_pressure": {"sheet": {"from_pressure": 20.0}},
    "bubble.nuisance.height_offset": GAUGES,
    "bubble.nuisance.height_scale": GAUGES,
    "bubble.data.heights": GAUGES,
    "bubble.data.profiles": PROFILES,
    "bubble.data.apex": APEX,
    "bubble.data.known_solution": KNOWN,
    "bubble.data.known_solution.increments": {
        "data": {"points": None, "known_solution": {"beta": [0.1] * 12, "increments": [30.0]}}
    },
    "bubble.data.points.pattern": {
        "data": {"points": {"files": None, "pattern": "{index}", "indices": [1, 2]}}
    },
    "bubble.data.points.indices": {
        "data": {"points": {"files": None, "pattern": "{index}", "indices": [1, 2]}}
    },
    "bubble.data.points.format": {"data": {"points": {"format": "csv"}}},
    "bubble.data.points.filter": {"data": {"points": {"filter": {"facet": 0.002}}}},
    "bubble.data.points.pressure.log": {"data": {"points": {"pressure": {"log": {"file": "log"}}}}},
    "strips.warp": {"warp": {"gauge_length": 0.1, "final_length": 0.12}},
    "strips.fill": {"fill": {"gauge_length": 0.1, "final_length": 0.12}},
    "strips.bias": {"bias": {"gauge_length": 0.03, "final_length": 0.04}},
    "strips.grip_distance": {"grip_distance": 0.1},
    "strips.data.polynomials": {"data": {"files": None}},
    "strips.data.directions": {"data": {"files": None, "directions": {"0": ["c"]}}},
    "biaxial.data.pairs": {"data": {"files": None, "pairs": {"2:1": ["d", "e"]}}},
    "strips.data.format": {"data": {"format": None}},
    "cylinder.diameter": {"diameter": 0.2},
    "cylinder.length": {"length": 2.5},
    "cylinder.element_size": {"element_size": 0.03},
    "cylinder.seam_width": {"seam_width": 0.03},
    "cylinder.cord": {"cord": [
        {"angle": 30.0, "stiffness": 1e5, "initial_force": 5.0, "tension_only": False},
        {"angle": 90.0, "strain": [0.0, 0.02], "force": [0.0, 9e3], "prestrain": 1e-3},
    ]},
    "cylinder.wall": {**BEAM, "wall": BRAID, "cord": [{"angle": 0.0, "stiffness": 8e5}]},
    **{f"cylinder.wall.{key}": PLAIN for key in ("axial", "hoop", "shear", "poisson", "wrinkles")},
    **{f"cylinder.{key}": PLAIN for key in ("model", "load_spacing", "load_width", "friction",
                                            "roller_below_axis", "mass_per_length")},
    "cylinder.saddle": {"saddle": {"inner_diameter": 0.24, "length": 0.15, "fillet": 0.01}},
    "cylinder.collar": {"collar": {"inner_diameter": 0.24, "length": 0.15, "fillet": 0.01}},
}  # fmt: skip


def companion(path):
    """Return what belongs to a key, else to the table that it is in."""
    path = ("cylinder", *path[1:]) if path[0] == "bending" else path
    whole = next((".".join(path[:k]) for k in range(len(path), 0, -1)
                  if ".".join(path[:k]) in COMPANIONS), "")  # fmt: skip
    return COMPANIONS.get(whole, {})


@pytest.mark.parametrize("kind", LEAST)
def test_every_key_of_a_test_is_the_same_through_objects_and_toml(kind, tmp_path):
    count = 0
    for path, own in keys(SCHEMA["properties"][kind], (kind,)):
        section = merged(merged(LEAST[kind], nested(path[1:], own)), companion(path))
        file = tmp_path / "project.toml"
        said = {"fabric": {"thickness": 8e-4}, "units": UNITS, kind: [section]}
        file.write_text(tomli_w.dumps(said))
        project = bf.read_project(file, need_data=False)
        ours = content(list(project.tests.values()))
        for other in round_trip(project, tmp_path, need_data=False):
            assert content(list(other.tests.values())) == ours, path
            (mine, theirs) = (list(one.definitions.values()) for one in (project, other))
            assert mine[0].section == theirs[0].section, path
        count += 1
    assert count > {"tube": 5, "cycles": 15}.get(kind, 20)


#: Settings that go with each other, or name something that is there.
VALUES = {
    "fabric.thickness": 7e-4,
    "card.thickness": 7e-4,
    "law.form": "spline", "fit.method": "slsqp", "fit.constraints": "margin",
    "fit.trust": ["radius"], "fit.solver": "calculix", "fit.unknowns.nu12.bounds": [0.1, 0.4],
    "fit.unknowns.thickness.bounds": [6e-4, 9e-4], "card.beta": [0.1] * 12, "card.form": "cubic",
    "fit.cache": "/runs",
    "law.bounds.E1": [0.1, 0.4], "law.bounds.E2": [0.1, 0.4], "law.bounds.G12": [0.1, 0.4],
    "solver.marc.version": "2023.1",
}  # fmt: skip


def test_every_key_beside_tests_is_the_same_through_objects_and_toml(tmp_path):
    count = 0
    bend = bf.read_project(EXAMPLES / "bend-valmex7318" / "project.toml")
    bend.cards["bubble 1"].card.write(tmp_path / "a.toml")
    for table in ("fabric", "law", "fit", "card", "solver"):
        for path, own in keys(SCHEMA["properties"][table], (table,)):
            said = {"fabric": {"thickness": 8e-4}, "units": UNITS, "cylinder": [LEAST["cylinder"]]}
            if table == "card":
                said["card"] = {"name": "a", "beta": [0.2] * 12}
            if "margin" in path:
                said["law"] = {"margin": {"E": 5e-3, "G12": 5e-4}}
            else:
                said = merged(said, nested(path, VALUES.get(".".join(path), own)))
            if table == "card":
                said["card"] = [{"file": "a.toml"} if path[-1] == "file" else said["card"]]
            file = tmp_path / "project.toml"
            file.write_text(tomli_w.dumps(said))
            project = bf.read_project(file, need_data=False)
            whole = plain_objects(project)
            for other in round_trip(project, tmp_path, need_data=False):
                assert plain_objects(other) == whole, path
            count += 1
    assert count > 80


def plain_objects(project):
    """All but the tests, in mm, N and MPa, with every default."""
    law, fit = (
        in_base_units(type(own), plain(own.model_dump()), project.scales)
        for own in (project.law, project.fit)
    )
    options = {k: v for k, v in project.objects["solver_options"].items() if v}
    return [law, fit, options, content(project.cards), content(project.fabric)]


def test_code_of_python_document_runs(tmp_path, monkeypatch):
    write_camera_arrays(tmp_path, pressures=PRESSURES[::5], elements=48)
    write_two_camera_exports(tmp_path)
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "how-to" / "python.md").read_text()
    assert len(text.split()) <= 600
    (tmp_path / "code.py").write_text(
        "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))
    )
    found = runpy.run_path("code.py")
    assert objective(found["same"]) == objective(found["project"])
    assert set(found["again"].tests) == {"bubble", "strips"} and found["other"].fit.starts == 8


def test_results_of_arrays_are_run_again_and_resumed(arrays, tmp_path):
    bubble = bf.Bubble(**arrays, radius=100.0, elements=48, symmetry="quarter")
    how = {"fabric": FABRIC, "starts": 1, "jobs": 1}
    fit = bf.fit(bubble, bf.Law("constant"), **how)
    fit.report(tmp_path / "page")
    for name in ("as-run.toml", "provenance.json"):
        assert "bubblefit-arrays" not in (tmp_path / "page" / name).read_text()
    again = bf.read_project(tmp_path / "page" / "as-run.toml")
    assert objective(again) == objective(fit.setup.project)

    out = tmp_path / "out"
    bf.fit(bubble, bf.Law("constant"), out=out, **how)
    made = sorted((out / "data").rglob("*.csv"))
    more = bf.fit(bubble, bf.Law("constant"), out=out, resume=True, **{**how, "starts": 2})
    assert len(made) == 20 and made == sorted((out / "data").rglob("*.csv"))
    assert objective(more.setup.project) == objective(again)
    arrays["displacements"][0, 0, 0] += 0.1
    other = bf.Bubble(**arrays, radius=100.0, elements=48, symmetry="quarter")
    with pytest.raises(InputError, match="something else"):
        bf.fit(other, bf.Law("constant"), out=out, resume=True, **how)
    assert objective(bf.read_project(out / "as-run.toml")) == objective(again)


def test_test_copies_its_arrays(arrays):
    bubble = bf.Bubble(**arrays, radius=100.0, elements=48)
    before = arrays["displacements"].copy()
    arrays["displacements"][:] = 0.0
    fields = fit_setup(project_of(bubble)).tests[0].fields
    for field, displacement in zip(fields, before, strict=True):
        np.testing.assert_array_equal(field.displacement, displacement)


def test_forward_runs_need_no_data():
    card = bf.MaterialCard(HypoelasticLaw.linear(300.0, 200.0, 10.0), 0.8, "known")
    keys = {"radius": 100.0, "pressures": [0.02, 0.05], "elements": 48, "symmetry": "quarter"}
    computed = bf.Bubble.of(**keys, data={"known_solution": {"beta": card.law.beta}})
    test = bf.Project.of(computed, fabric=FABRIC, need_data=False).tests["bubble"]
    same = bf.simulate(test, card)["bubble"]
    run = bf.simulate(bf.Bubble(**keys), card)["bubble"]
    np.testing.assert_array_equal(run.displacement, same.displacement)
    ends = {"gauge_length": 20.0, "final_length": 22.0}
    pulled = bf.simulate(bf.Strips(width=25.0, increments=5, warp=ends, bias=ends), card)
    assert set(pulled) == {"warp", "bias"} and len(pulled["warp"].load) == 5
    wall = {"axial": 400.0, "hoop": 400.0, "shear": 9.0}
    supports = {"model": "beam", "span": 3000.0, "load_spacing": 1000.0}
    bent = bf.simulate(bf.Cylinder(150.0, 0.09, frames=3, wall=wall, **supports), card)
    assert len(bent["cylinder"].load) == 1 + 3


def test_keys_of_files_are_refused_beside_arrays(arrays):
    error = refused(bf.Bubble, **arrays, radius=100.0, columns={"x": "X"})
    assert error.field == "columns" and "arrays" in error.problem
    curve = [(ELONGATION, 10 * ELONGATION)]
    assert refused(bf.Strips, {"warp": curve}, gauge=20.0, load_unit="kN").field == "load_unit"
    assert refused(bf.Biaxial, {"1:1": np.ones((3, 4))}, files=["a.csv"]).field == "files"
    assert refused(bf.Cylinder, 150.0, 0.09, curves=curve, decimal=",").field == "decimal"
    bf.Biaxial({"1:1": np.ones((3, 4))}, load_unit="kN/m")  # as the arrays are


@pytest.mark.parametrize("factor", [1e3, 1e6])
def test_pressures_in_kpa_or_pa_are_doubted_with_their_factor(arrays, factor):
    arrays["pressures"] *= factor
    error = refused(bf.Bubble, **arrays, radius=100.0)
    assert error.field.startswith("pressures[") and f"Divide by {factor:g}" in error.problem


@pytest.mark.parametrize("unit", [{"length_unit": "m"}, {"pressure_unit": "bar"}])
def test_units_of_arrays_are_refused(arrays, unit):
    (name,) = unit
    error = refused(bf.Bubble, **arrays, radius=100.0, **unit)
    assert error.field == name and "mm, N and MPa: convert them" in error.problem
    bf.Bubble(**arrays, radius=100.0, length_unit="mm")


def test_printed_objects_have_three_lines_and_whole_numbers(arrays):
    bounds = {"E1": [20.0, 2000.0], "E2": [20.0, 1000.0], "G12": [1.0, 200.0]}
    assert repr(bf.Law("constant")) == f"Law(form='constant', bounds={bounds})"
    bubble = bf.Bubble(**arrays, radius=100.0, increments=np.linspace(0.0123456789, 0.1, 400))
    for thing in (bubble, bf.Law("constant", nu12=0.123456789), bf.Sheet(modes=2)):
        text = repr(thing)
        assert len(text.splitlines()) <= 3
        numbers = re.findall(r"\d+\.\d+", text)
        values = {
            *map(repr, arrays["pressures"].tolist()),
            *map(repr, bubble.section["increments"]),
        }
        values |= {"100.0", "0.123456789", *map(str, np.ravel(list(bounds.values())))}
        assert {*numbers} <= values
    assert "20 Frame in memory" in repr(bubble)


def test_grave_notes_are_warnings_at_the_line_of_the_user(arrays):
    bubble = bf.Bubble(**arrays, radius=100.0, elements=48, symmetry="quarter")
    with pytest.warns(bf.BubblefitWarning, match="not to be believed") as caught:
        fit = bf.fit([bubble], bf.Law("constant"), fabric=FABRIC, starts=1, jobs=1)
    ours = [warning for warning in caught if warning.category is bf.BubblefitWarning]
    assert {warning.filename for warning in ours} == {__file__}
    grave = [note.line for note in fit.notes if note.kind.weight >= GRAVE]
    assert [str(warning.message) for warning in ours] == grave


def test_prepared_test_of_another_project_is_refused_and_not_left_out():
    bubble = bf.Bubble.heights([0.01, 0.02, 0.03], [5.0, 7.0, 9.0], radius=100.0)
    law = bf.Law("constant", bounds={"E1": [1, 9], "E2": [1, 9], "G12": [1, 9]})
    fabric = bf.Fabric("film", 0.1)
    (test,) = bf.Project.of(bubble, law=law, fabric=fabric).tests.values()
    with pytest.raises(InputError, match=r"tests: expected bf.Bubble.* got BubbleTest"):
        bf.Project.of([test, bubble], law=law, fabric=fabric)
