"""Cards on a bubble: numbers, lines, table and files of a made-up history."""

import re
from dataclasses import replace
from pathlib import Path

import bubblefit as bf
import numpy as np
import pytest
import scipy.sparse as sp
from bubblefit.errors import InputError
from bubblefit.experiments.base import Weighting
from bubblefit.experiments.bubble import sheet as shapes
from bubblefit.experiments.bubble.objective import OFFSETS, FieldObjective
from bubblefit.experiments.bubble.symmetry import folded, mirrored
from bubblefit.experiments.bubble.targets import FieldTarget, at_nodes, resampled
from bubblefit.experiments.bubble.test import quantities, responses
from bubblefit.inference.objective import Blocks
from bubblefit.inference.wrong_form import discrepancies
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh, elliptic_disk_mesh
from bubblefit.meshes.facets import Facet, FacetReading
from bubblefit.meshes.outline import Outline
from bubblefit.meshes.sampling import SmoothReading
from bubblefit.project.project import read_project
from bubblefit.readers.fields import DisplacementField
from bubblefit.runs.certainty import limit_of_meshes
from bubblefit.runs.fit import fit
from bubblefit.solvers.membrane.bubble import analyse, prepare
from bubblefit.solvers.membrane.loading import RunRequest
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.membrane.wall import Wall
from scipy.spatial.transform import Rotation

from ...builders.flat_bubbles import LAW, MESH, MODEL, QUARTER, history, history_of, stretched
from ...builders.projects import fit_setup, known_bubble, replaced_once
from ...inference.cases import MODEL as CASE
from ...inference.cases import reference, targets
from ...support.commands import in_process, result_in
from ...support.refusals import complaint, raised


def test_what_a_study_looks_at():
    assert quantities(MODEL, history()) == pytest.approx(
        {"apex at 22 kPa, mm": 10.0, "apex at 300 kPa, mm": 30.0,
         "largest in-plane displacement at 300 kPa, mm": 1.0}
    )  # fmt: skip
    assert responses(MODEL, history()) == pytest.approx(
        {"22 kPa": 10.0, "300 kPa": np.hypot(30.0, 1.0)}
    )


def direct_e(model, data, shift=0.0):
    """Return e by Eqs 4.5 to 4.8 as they are printed."""
    total = 0.0
    for frame, target in zip(model, data, strict=True):
        off = target.at(frame) + shift - target.displacement
        rms = np.sqrt(np.sum(off**2, axis=0) / len(off))
        total += np.sum(rms / np.max(np.abs(target.displacement), axis=0))
    return total


def test_e_against_a_direct_evaluation():
    data = targets()
    other = MembraneSolver().run(CASE, HypoelasticLaw.linear(400.0, 300.0, 15.0))
    objective = FieldObjective(data)
    blocks = Blocks(objective.sizes)
    e = blocks.value(objective.residual(other))
    assert e == pytest.approx(direct_e(other.displacement, data))
    assert blocks.value(objective.residual(reference())) == 0.0
    assert blocks.norms(objective.residual(other)).shape == (21,)
    doubled = FieldObjective(data, weight=2.0)
    assert blocks.value(doubled.residual(other)) == pytest.approx(2 * e)
    millimetres = (other.displacement - reference().displacement).transpose(0, 2, 1).ravel()
    assert doubled.residual(other) * doubled.scale == pytest.approx(millimetres)
    # In millimetres nothing is divided by.
    plain = FieldObjective(data, "mm")
    moved = reference().displacement + np.array([0.0, 0.0, 0.5])
    residual = plain.residual(replace(reference(), displacement=moved))
    assert Blocks(plain.sizes).value(residual) == pytest.approx(7 * 0.5)
    assert plain.mean_absolute(moved) == pytest.approx(0.5)
    fields = reference().displacement.copy()
    fields[2, :, 1] = 0.0
    assert "97 kPa: dy" in complaint(FieldObjective, targets(fields))


def test_e_between_the_nodes_and_with_an_offset():
    random, data = np.random.default_rng(1), []
    for k, p in enumerate(CASE.pressures):
        sample = sp.random(10 + k, len(CASE.mesh.points), 0.1, "csr", random_state=k)
        data.append(FieldTarget(p, random.standard_normal((10 + k, 3)), sample))
    objective, shift = FieldObjective(data), [0.1, -0.2, 0.3]
    nuisance = dict(zip(OFFSETS, shift, strict=True))
    e = Blocks(objective.sizes).value(objective.residual(reference(), nuisance))
    assert e == pytest.approx(direct_e(reference().displacement, data, shift))


OWN, OTHER = disk_mesh(100.0, 48, "quarter"), disk_mesh(100.0, 192, "quarter")


def test_the_same_places_from_other_nodes():
    some = sp.csr_matrix(np.eye(len(OWN.points))[[0, 5, 9]])
    targets = tuple(
        FieldTarget(p, np.zeros((n, 3)), sample, place_numbers=np.arange(n))
        for p, n, sample in ((0.1, len(OWN.points), None), (0.2, 3, some), (0.3, 3, some))
    )
    every, one, two = resampled(targets, OWN, SmoothReading.of(OTHER))
    assert one.sample is two.sample is not every.sample
    assert [t.pressure for t in (every, one, two)] == [0.1, 0.2, 0.3]
    assert one.place_numbers is targets[1].place_numbers and targets[0].sample is None
    for moved, target in ((every, targets[0]), (one, targets[1])):
        here, there = moved.at(OTHER.points)[:, :2], target.at(OWN.points)[:, :2]
        np.testing.assert_allclose(here, there, atol=1.01e-2)
    inside = np.hypot(*OWN.points[:, :2].T) < 90.0
    np.testing.assert_allclose(every.at(OTHER.points)[inside], OWN.points[inside], atol=1e-9)


@pytest.mark.parametrize("factor", [2.0, 1.6])
def test_quads_and_increments_are_divided(tmp_path, factor):
    setup = fit_setup(known_bubble(tmp_path))
    (prepared,) = setup.tests
    (own,) = prepared.comparisons(setup.make_solver, Weighting())
    found = prepared._refined(own, factor)
    assert found.name == own.name and found.objective is not own.objective
    quads = len(found.model.mesh.quads) / len(own.model.mesh.quads)
    assert quads == (4.0 if factor == 2.0 else pytest.approx(factor**2, rel=0.35))
    assert len(found.model.increments) == 2 * len(own.model.increments)
    assert found.model.increments[1::2] == pytest.approx(own.model.increments)
    assert found.model.pressures == own.model.pressures
    # The objective of the fit is as it was.
    assert own.objective.targets[0].sample is None
    assert found.objective.targets[0].sample.shape[1] == len(found.model.mesh.points)
    # Data of this very model are asked of no other.
    (same,) = prepared.finer(setup.make_solver, Weighting(), factor)
    assert len(same.model.mesh.quads) == len(own.model.mesh.quads)


def test_an_even_stretch_in_closed_form():
    ends = [(1.01, 1.0), (1.02, 1.01), (1.05, 0.99)]
    told = history_of([stretched(*end) for end in ends])
    d = 1 - 0.25**2 * 200 / 500
    for found, found_stress, (warp, fill) in zip(
        told.strain(), told.stress(), ends[1:], strict=True
    ):
        e1, e2 = np.log([warp, fill])
        strain = np.tile([e1, e2, 0.0], (len(MESH.quads), 1))
        np.testing.assert_allclose(found, strain, atol=1e-12)
        stress = [(500 * e1 + 0.25 * 200 * e2) / d, (200 * e2 + 0.25 * 200 * e1) / d, 0.0]
        np.testing.assert_allclose(found_stress, np.tile(stress, (len(MESH.quads), 1)), atol=1e-9)
    # Without the increments the frames are taken.
    bare = history_of([stretched(by, 1.0) for by in (1.01, 1.02, 1.05)])
    bare = replace(bare, path=None)
    assert bare.strain()[0, 0, 0] == pytest.approx(np.log(1.02))
    assert bare.stress()[1, 0, 0] == pytest.approx(500 * np.log(1.05) / d)
    # A slack sheet is first unfolded.
    slack = replace(QUARTER, slack=(0.01, 0.0))
    unfolded = replace(history_of([stretched(1.0201, 1.0)] * 3), model=slack)
    np.testing.assert_allclose(unfolded.strain()[-1, :, 0], np.log(1.0201 / 1.01), atol=1e-12)


def test_stresses_are_those_of_the_membrane():
    off = []
    for quads in (48, 192):
        model = replace(QUARTER, mesh=disk_mesh(100.0, quads))
        membrane = prepare(model, LAW, 1e-9, Wall())
        found, _ = analyse(membrane, model, RunRequest())
        last = replace(found, model=model, law=LAW).stress()[-1]
        own = membrane.stress_old.mean(axis=1)
        off.append(np.abs(last - own).max() / np.abs(own).max())
        assert (shapes.states(last) == shapes.TAUT).all() and np.abs(own[:, :2]).min() > 1.0
    assert off[0] < 0.02 and off[1] < 0.6 * off[0]


@pytest.mark.parametrize(
    ("stress", "state"),
    [
        ([2.0, 1.0, 0.0], 0), ([2.0, 1.0, 1.5], 1), ([2.0, -0.1, 0.0], 1), ([0.0, 3.0, 0.0], 1),
        ([-1.0, -2.0, 0.0], 2), ([0.0, 0.0, 0.0], 2), ([1.0, 1.0, 0.99], 0),
    ],
)  # fmt: skip
def test_states_by_the_principal_stresses(stress, state):
    """Taut, wrinkled, loose, in a sheet of 3 MPa at most."""
    assert shapes.states(np.array([stress, [3.0, 3.0, 0.0]]))[0] == state


def test_values_at_places_are_carried_to_the_nodes():
    places = np.mgrid[-50.0:51.0:5.0, -50.0:51.0:5.0].reshape(2, -1).T
    places = places[np.hypot(*(places - [20.0, 0.0]).T) > 16.0]
    values = np.column_stack([places[:, 0], 2 * places[:, 1], places.sum(axis=1)])
    nodes = np.array([[1.0, 2.0], [-33.3, 12.1], [20.0, 0.0], [90.0, 0.0]])
    found = shapes.interpolated_at_nodes(nodes, places, values)
    np.testing.assert_allclose(found[:2], [[1.0, 4.0, 3.0], [-33.3, 24.2, -21.2]])
    assert np.isnan(found[2:]).all()
    np.testing.assert_array_equal(shapes.interpolated_at_nodes(places, places, values), values)
    for few in (places[places[:, 1] == 50.0], places[:2]):
        assert np.isnan(shapes.interpolated_at_nodes(nodes, few, np.zeros((len(few), 3)))).all()


OUTLINE = Outline(120.0, 80.0, 30.0)


KILO = [40, 120, 250]


LAW_ELLIPTIC_FIT = HypoelasticLaw.linear(700.0, 300.0, 15.0)


PROJECT_FILTER = """
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
pressures = [30, 120]
elements = 108
SYMMETRY
[bubble.data.points]
files = ["a.csv", "b.csv"]
FILTER
[fit]
mesh_error = "told"
starts = 1
jobs = 1
"""


OVAL = replaced_once(
    PROJECT_FILTER,
    ("[0.02, 0.3]", "[0.002, 0.1]"),
    ("radius = 100.0", "ellipse = { major = 120, minor = 80, angle = 30 }"),
    ("[30, 120]", "[40, 120, 250]"),
    ("108\nSYMMETRY", "112"),
    ('"a.csv", "b.csv"]', '"0.csv", "1.csv", "2.csv"]\ncolumns = { z = "z" }'),
    ("FILTER", "[bubble.data.points.registration]"),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A test on the mesh of the fit, seen by a camera whose x is 20 degrees from the warp."""
    place = tmp_path_factory.mktemp("oval")
    mesh = elliptic_disk_mesh(OUTLINE, 112)
    pressures = [1e-3 * p for p in KILO]
    model = BubbleModel(mesh, 0.8, pressures, default_increments(pressures))
    turn = Rotation.from_euler("z", 20.0, degrees=True).as_matrix().T
    line = np.linspace(-1, 1, 25)
    points = np.stack([axis.ravel() for axis in np.meshgrid(line, line)], axis=1)
    points = OUTLINE.places(points[np.hypot(*points.T) < 0.98])
    sample, inside = SmoothReading.of(mesh).matrix(points)
    places = np.column_stack([points[inside], np.zeros(inside.sum())]) @ turn + [2.0, -3.0, 600.0]
    for k, moved in enumerate(MembraneSolver().run(model, LAW_ELLIPTIC_FIT).displacement):
        table = np.hstack([places, (sample @ moved) @ turn])
        np.savetxt(place / f"{k}.csv", table, "%.7f", ",", header="x,y,z,dx,dy,dz", comments="")
    (place / "project.toml").write_text(OVAL)
    return place


def test_the_moduli_come_back(folder):
    in_process("bubble", folder / "project.toml", "--out", folder / "out", cwd=folder)
    result = result_in(folder / "out")
    law = bf.read_card(folder / "out" / "material.toml").law
    # The turn of the rim is told to a few tenths of a degree; G12 feels it.
    for name, modulus, within in (("E1", 700.0, 0.01), ("E2", 300.0, 0.01), ("G12", 15.0, 0.06)):
        assert float(law.modulus(name, 0.02)) == pytest.approx(modulus, rel=within), name
    assert result["registration"]["warp_degrees"] == pytest.approx(20.0, abs=0.6)
    assert result["registration"]["warp"]["clear"] is None


FILTER = "[bubble.data.points.filter]\nfacet = 40.0\nsmoothing = 3\nstep = 10.0\n"


TRUE = {"E1": 800.0, "E2": 500.0, "G12": 80.0}


def project_in(folder: Path, filtered: str, symmetry: str = "") -> Path:
    path = folder / "project.toml"
    path.write_text(PROJECT_FILTER.replace("FILTER", filtered).replace("SYMMETRY", symmetry))
    return path


def seen(folder: Path) -> None:
    """What a camera of such facets sees of the true bubble, at points 12 mm apart."""
    for name in ("a", "b"):
        (folder / f"{name}.csv").write_text("x,y,dx,dy,dz\n0,0,0,0,1\n")
    model = read_project(project_in(folder, "")).tests["bubble"].model()
    law = HypoelasticLaw.linear(TRUE["E1"], TRUE["E2"], TRUE["G12"])
    moved = MembraneSolver().run(model, law).displacement
    x, y = (a.ravel() for a in np.meshgrid(*[np.arange(-84.0, 85.0, 12.0)] * 2))
    points = np.column_stack([x, y])[np.hypot(x, y) < 85.0]
    facet = Facet(40.0, window=3, step=10.0)
    matrix, inside = FacetReading(SmoothReading.of(model.mesh), facet).matrix(points)
    assert inside.all()
    for name, frame in zip(("a", "b"), moved, strict=True):
        table = np.column_stack([points, matrix @ frame])
        np.savetxt(folder / f"{name}.csv", table, "%.12g", ",", header="x,y,dx,dy,dz", comments="")


def test_a_fit_through_the_same_filter_is_exact(tmp_path):
    seen(tmp_path)
    through = fit(read_project(project_in(tmp_path, FILTER)))
    plain = fit(read_project(project_in(tmp_path, "")))
    for name, true in TRUE.items():
        assert float(through.law.modulus(name, 0.0)) == pytest.approx(true, rel=1e-4), name
    off = {name: float(plain.law.modulus(name, 0.0)) / true - 1 for name, true in TRUE.items()}
    assert min(abs(off["E1"]), abs(off["E2"])) > 0.02, off
    assert through.objective < 1e-5 < 1e-2 < plain.objective
    # What the error of the mesh is found by is seen through the filter, too.
    limit = limit_of_meshes(through.setup, through.problem, through.best)
    assert limit is not None and np.abs(limit.step).max() < 0.2


@pytest.mark.parametrize(
    ("filtered", "symmetry", "said"),
    [
        (FILTER, 'symmetry = "quarter"', "data.points.filter: a facet reaches over the edge"),
        (FILTER, '[bubble.match]\nby = "surfaces"', "data.points.filter: surfaces are matched"),
        (FILTER.replace("3", "2"), "", "data.points.filter.smoothing: expected 1, 3, 5"),
        (FILTER.replace("step = 10.0", ""), "", "data.points.filter.step: this key is missing"),
    ],
)
def test_what_is_no_filter(tmp_path, filtered, symmetry, said):
    for name in ("a", "b"):
        (tmp_path / f"{name}.csv").write_text("x,y,dx,dy,dz\n0,0,0,0,1\n")
    raised(InputError, said, read_project, project_in(tmp_path, filtered, symmetry))


POINTS = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0], [5.0, 6.0]])


MOVED = np.array([[0, 0, 9.0], [0.1, 0, 8.0], [0, 0.2, 7.0], [0.3, 0.4, 6.0]])


def inflated(points: np.ndarray) -> np.ndarray:
    x, y = points.T
    height = 1.0 - 0.6 * x**2 - 0.8 * y**2
    return np.stack([0.3 * x * height, -0.2 * y * height**2, height], axis=1)


def test_a_field_is_turned_as_it_is_folded():
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (40, 2))
    assert {tuple(s) for s in np.sign(points)} == {(1, 1), (1, -1), (-1, 1), (-1, -1)}
    field = folded(DisplacementField(0.1, points, inflated(points)))
    assert (field.points == np.abs(points)).all()
    assert field.displacement == pytest.approx(inflated(np.abs(points)), abs=1e-15)


def test_a_quarter_mirrored_is_the_whole_and_folds_back():
    points = np.random.default_rng(2).uniform(0.0, 1.0, (10, 2))
    points[0], points[1] = (0.0, 0.5), (0.4, 0.0)  # on the axes once, not twice
    whole = mirrored(DisplacementField(0.1, points, inflated(points)))
    assert len(whole.points) == 4 * 8 + 2 * 2
    assert whole.displacement == pytest.approx(inflated(whole.points), abs=1e-15)
    again = folded(whole)
    assert again.displacement == pytest.approx(inflated(again.points), abs=1e-15)


def test_each_point_keeps_its_height_and_sigma():
    z, sigma = np.array([1.0, 2.0, 3.0, 4.0]), np.array([0.1, 0.2, 0.3, 0.4])
    whole = mirrored(DisplacementField(0.1, POINTS, MOVED, z=z, sigma=sigma))
    assert len(whole.points) == 1 + 2 + 2 + 4
    for point, height, error in zip(whole.points, whole.z, whole.sigma, strict=True):
        (which,) = np.flatnonzero((POINTS == np.abs(point)).all(axis=1))
        assert (height, error) == (z[which], sigma[which])
    back = folded(whole)
    np.testing.assert_array_equal(back.z, whole.z)
    assert (back.points >= 0).all() and (back.displacement >= 0).all()
    # A point beside the axis by rounding is on it; a whole field is not mirrored again.
    beside = DisplacementField(0.1, POINTS - [[0, 0], [0, 0], [1e-12, 0], [0, 0]], MOVED)
    assert len(mirrored(beside).points) == 1 + 2 + 2 + 4 and mirrored(beside).z is None
    whole = DisplacementField(0.1, POINTS * (-1, 1), MOVED * (-1, 1, 1))
    assert mirrored(whole) is whole


def test_computed_fields_at_the_nodes_of_a_model():
    mesh, other = disk_mesh(1.0, 48), disk_mesh(1.0, 192, "quarter")

    def field(points):
        round_ = 1 - (points[:, :2] ** 2).sum(axis=1, keepdims=True)
        return round_ * np.column_stack([points[:, 0], -points[:, 1], np.ones(len(points))])

    noisy = field(mesh.points) + np.random.default_rng(1).normal(0, 0.1, mesh.points.shape)
    same = DisplacementField(0.1, mesh.points[:, :2] + 1e-10, noisy)
    between = DisplacementField(0.2, other.points[:, :2], field(other.points))
    first, second = at_nodes([same, between], mesh)
    assert (first.pressure, second.pressure) == (0.1, 0.2) and first.displacement is noisy
    np.testing.assert_allclose(second.displacement, field(mesh.points), atol=0.01)
    np.testing.assert_array_equal(second.displacement[mesh.node_sets["rim"]], 0.0)


def given(name):
    """The field as measured: 1 mm beside the centre, turned by 3, or tilted by 1 degree."""
    turn = Rotation.from_euler("zy", {"turn": [3, 0], "tilt": [0, 1]}.get(name, [0, 0]), True)
    beside = np.array([1.0, -0.5]) if name == "centre" else np.zeros(2)

    def moved(one):
        at = np.column_stack([one.points[:, :2], np.zeros(len(one.points))])
        at = turn.apply(at)[:, :2] if name == "turn" else at[:, :2]
        return replace(one, points=at + beside, displacement=turn.apply(one.displacement))

    return moved


@pytest.fixture(scope="module")
def cubic(tmp_path_factory):
    """Cubic moduli on a full disk of 192 quads, and its fields inside 90 mm with 1 um of noise."""
    folder, random = tmp_path_factory.mktemp("causes"), np.random.default_rng(0)
    project = read_project(known_bubble(folder, ("elements = 48", "elements = 192"), FULL, FRAMES))
    (prepared,) = fit_setup(project).tests
    seen = []
    for one in prepared.matched:
        some = np.hypot(*one.points[:, :2].T) < 90
        noise = 1e-3 * random.standard_normal((some.sum(), 3))
        seen.append(
            replace(one, points=one.points[some], displacement=one.displacement[some] + noise)
        )
    return project, tuple(seen)


FULL = 'symmetry = "quarter"', 'symmetry = "full"'


FRAMES = "[22, 59, 97, 132, 186, 251, 300]", "[60, 120, 180, 240, 300]"


LATE = "[22, 59, 97, 132, 186, 251, 300]", "[65, 125, 185, 245, 305]"


STRETCHED = 'thickness_change = "constant"', 'thickness_change = "incompressible"'


@pytest.mark.parametrize(
    ("name", "change", "words", "amounts"),
    [
        ("radius", ("radius = 100.0", "radius = 101.0"), "radius", [-1.0]),
        ("centre", FULL, "centre", [1.0, -0.5]),
        ("turn", FULL, "axes", [3.0]),
        ("tilt", FULL, "tilt", [0.0, 1.0]),
        ("pressure", LATE, "pressures", [5.0]),
        ("thickness", STRETCHED, "thickness_change", [100.0]),
    ],
)
def test_the_residual_points_to_its_cause(cubic, tmp_path, name, change, words, amounts):
    _, seen = cubic
    frames = () if change is LATE else (FRAMES,)
    changes = (FULL, *frames) if change is FULL else (FULL, *frames, change)
    setup = fit_setup(known_bubble(tmp_path, ("elements = 48", "elements = 192"), *changes))
    (own,) = setup.tests
    fields = [
        replace(given(name)(one), pressure=p)
        for one, p in zip(seen, own.test.pressures, strict=True)
    ]
    measured = replace(own, fields=tuple(fields), known=None, by_this_model=False)
    problem = replace(setup, tests=(measured,)).problem()
    beta = own.known.beta[list(problem.unknowns.free)]
    point = problem.evaluate(problem.unknowns.at(beta), True)
    found = discrepancies(problem, point.residual, None, point, lambda step: 0.0)["bubble"]
    assert found.is_significant
    first = found.causes[0]
    assert words in first.description and first.explained_share > 0.8, found.causes
    assert all(one.explained_share < 0.5 * first.explained_share for one in found.causes[1:]), (
        found.causes
    )
    said = [float(n) for n in re.findall(r"[-+]?\d+\.?\d*(?:e-\d+)?", first.description)]
    assert said == pytest.approx(amounts, abs=0.1, rel=0.2)
