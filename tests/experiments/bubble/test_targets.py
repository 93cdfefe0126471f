"""experiments/bubble/targets.py: fields at the places of the data, on any mesh."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from bubblefit.errors import InputError
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.experiments.bubble.targets import (
    FieldTarget,
    at_nodes,
    at_points,
    counted_from,
    resampled,
    with_place_numbers,
    with_unloaded_positions,
)
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.disk import Outline, disk_mesh
from bubblefit.meshes.sampling import Facet, FacetReading, SmoothReading
from bubblefit.project.project import read_project
from bubblefit.readers.fields import DisplacementField
from bubblefit.runs.certainty import limit_of_meshes
from bubblefit.runs.fit import fit
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...support.refusals import complaint, raised
from .cases import PLACE, PROJECT_FILTER, cubic_targets, zero_history

COARSE_DISK, FINE_DISK = disk_mesh(100.0, 48, "quarter"), disk_mesh(100.0, 192, "quarter")


def test_targets_keep_their_places_on_another_mesh():
    some = sp.csr_matrix(np.eye(len(COARSE_DISK.points))[[0, 5, 9]])
    targets = tuple(
        FieldTarget(p, np.zeros((n, 3)), sample, place_numbers=np.arange(n))
        for p, n, sample in ((0.1, len(COARSE_DISK.points), None), (0.2, 3, some), (0.3, 3, some))
    )
    every, one, two = resampled(targets, COARSE_DISK, SmoothReading.of(FINE_DISK))
    assert one.sample is two.sample is not every.sample
    assert [t.pressure for t in (every, one, two)] == [0.1, 0.2, 0.3]
    assert one.place_numbers is targets[1].place_numbers and targets[0].sample is None
    for moved, target in ((every, targets[0]), (one, targets[1])):
        here, there = (
            moved.at_places(FINE_DISK.points)[:, :2],
            target.at_places(COARSE_DISK.points)[:, :2],
        )
        np.testing.assert_allclose(here, there, atol=1.01e-2)
    inside = np.hypot(*COARSE_DISK.points[:, :2].T) < 90.0
    np.testing.assert_allclose(
        every.at_places(FINE_DISK.points)[inside], COARSE_DISK.points[inside], atol=1e-9
    )


def test_places_of_a_micrometre_are_one_and_have_its_number():
    nodes = COARSE_DISK.points[:, :2]
    one = FieldTarget(0.1, np.zeros((len(nodes), 3)))
    for shift, is_same in ((4e-4, True), (2e-3, False)):
        shifted = sp.csr_matrix(np.eye(len(nodes))[[7, 3]] * (1.0 + shift / nodes[7, 0]))
        targets = [one, FieldTarget(0.2, np.zeros((2, 3)), shifted)]
        first, second = (t.place_numbers for t in with_place_numbers(targets, np.round(nodes)))
        assert len(np.unique(first)) == len(nodes)
        assert bool(second[0] == first[7]) is is_same


FILTER = "[bubble.data.points.filter]\nfacet = 40.0\nsmoothing = 3\nstep = 10.0\n"
TRUE = {"E1": 800.0, "E2": 500.0, "G12": 80.0}


def project_in(folder: Path, filtered: str, symmetry: str = "") -> Path:
    path = folder / "project.toml"
    path.write_text(PROJECT_FILTER.replace("FILTER", filtered).replace("SYMMETRY", symmetry))
    return path


def write_filtered_fields(folder: Path) -> None:
    """Return what a camera of such facets sees of the true bubble, at points 12 mm apart."""
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


def test_fit_through_the_filter_of_the_camera_is_exact(tmp_path):
    write_filtered_fields(tmp_path)
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
def test_bad_filter_names_its_field(tmp_path, filtered, symmetry, said):
    for name in ("a", "b"):
        (tmp_path / f"{name}.csv").write_text("x,y,dx,dy,dz\n0,0,0,0,1\n")
    raised(InputError, said, read_project, project_in(tmp_path, filtered, symmetry))


def test_computed_fields_are_interpolated_at_nodes():
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


def test_places_at_rest_follow_two_thirds_of_the_pressure():
    """In-plane 8 to 27 kPa: 4 to 9 units; what has moved at 8 is 4/5 of what moves between."""
    points = np.array([[10.0, 0.0], [0.0, 20.0]])
    moved = np.array([[0.5, 0.0, 9.0], [0.0, 1.0, 9.0]])
    first = DisplacementField(0.008, points, np.zeros((2, 3)))
    other = DisplacementField(0.027, points[::-1], moved[::-1])
    for fields, reference_frame in (([first, other], 0), ([other, first], 1)):
        for found in with_unloaded_positions(fields, reference_frame):
            order = np.argsort(found.points[:, 1])
            assert found.points[order] == pytest.approx(np.array([[9.6, 0.0], [0.0, 19.2]]))
    seen = replace(first, displacement=np.full((2, 3), 1e-9))
    assert with_unloaded_positions([seen, other], 0) == [seen, other]


def test_places_of_a_loaded_picture_are_brought_to_rest_exactly():
    # Homogeneous stretch: the first estimate of the places is wrong, the model's motion is not.
    random = np.random.default_rng(0)
    at_rest = random.uniform(-90.0, 90.0, (300, 2))
    to_picture = np.array([0.05, 0.02])
    growths = np.array([[0.0, 0.0, 0.0], [0.03, 0.06, 0.1], [0.08, 0.07, 0.2]])

    def displacements(places, growth):
        return np.column_stack([places * growth[:2], places[:, 0] * growth[2]])

    in_picture = at_rest * (1 + to_picture)
    fields = [
        DisplacementField(pressure, in_picture, displacements(at_rest, growth))
        for pressure, growth in zip((0.02, 0.05, 0.09), growths, strict=True)
    ]
    targets = [
        FieldTarget(
            field.pressure,
            field.displacement,
            place_numbers=np.arange(len(at_rest)),
            positions=field.points,
        )
        for field in with_unloaded_positions(fields, 0)
    ]
    places = targets[0].positions
    assert np.abs(places - at_rest).max() > 0.5
    motion = np.column_stack([places * to_picture, np.zeros(len(places))])
    frames = np.array([motion + displacements(places, growth) for growth in growths])
    for number, target in enumerate(counted_from(targets, 0)):
        field = target.modelled_field(frames, number)
        assert field == pytest.approx(target.displacement, abs=1e-5)


def test_points_outside_of_the_disk_are_refused():
    mesh = disk_mesh(100.0, 48)
    test: Any = SimpleNamespace(outline=Outline.circle(100.0), place=PLACE, facet=None)

    def found(points):
        points = np.array(points, dtype=float)
        fields = [DisplacementField(0.2, points, np.zeros((len(points), 3)))]
        (target,), outside = at_points(test, fields, mesh)
        return len(target.displacement), outside

    far = [[900.0, k] for k in range(9)]
    assert found([[50.0, 0.0], *far]) == (1, 9)
    assert "200 kPa: 1 of 11 points" in complaint(found, [[50.0, 0.0], *far, [901.0, 0]])
    assert found([[10.0, 0.0], [0.0, -9.0]]) == (2, 0)
    assert "within 9.99 mm" in complaint(found, [[-9.99, 0.0], [0.0, 9.0]])


PRESSURES = (0.02, 0.09, 0.19)


def test_displacements_can_count_from_a_loaded_frame():
    some, nodes, frames = cubic_targets()
    fields = np.random.default_rng(9).standard_normal(frames.shape)
    some = [replace(t, displacement=t.at_places(u)) for t, u in zip(some, fields, strict=True)]
    relative = counted_from(some, 1)
    assert [(t.pressure, t.reference_frame) for t in relative] == [
        (PRESSURES[0], 1),
        (PRESSURES[2], 1),
    ]
    for number, (target, k) in enumerate(zip(relative, (0, 2), strict=True)):
        # Each frame misses a node of its own.
        assert len(target.displacement) == len(nodes) - 2
        np.testing.assert_allclose(target.displacement, target.at_places(fields[k] - fields[1]))
        np.testing.assert_allclose(
            target.modelled_displacement(frames, number), target.at_places(frames[k] - frames[1])
        )
    objective = FieldObjective(relative, "mm")
    once, again = (objective.residual(zero_history(f), {}) for f in (frames, frames + 1.0))
    np.testing.assert_allclose(again, once, atol=1e-12)

    def origin(count):
        which = np.arange(1, count + 1)
        return replace(some[1].subset(which), sample=some[1].sample[which])

    # A frame shares half of its places at least.
    count = len(some[0].displacement)
    half = -(-count // 2)
    (found,) = counted_from([some[0], origin(half)], 1)
    assert len(found.displacement) == half
    assert f"share {half - 1} of {count}" in complaint(counted_from, [some[0], origin(half - 1)], 1)
