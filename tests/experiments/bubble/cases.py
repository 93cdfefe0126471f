"""Builders of the tests of bubbles."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bubblefit as bf
import numpy as np
import scipy.sparse as sp
from bubblefit.experiments.bubble import BubbleTest
from bubblefit.experiments.bubble.field_shape import Apex
from bubblefit.experiments.bubble.measured_view import MeasuredView
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.experiments.bubble.section import SheetSettings
from bubblefit.experiments.bubble.targets import FieldTarget, with_place_numbers
from bubblefit.experiments.sections import Fabric, Place
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.nuisance import Nuisance
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import Outline, disk_mesh, metric_modes
from bubblefit.project.project import Project
from bubblefit.readers.fields import DisplacementField
from bubblefit.readers.frames import Frame
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.spatial.transform import Rotation

from ...builders.bubbles import CIRCLE, FABRIC

CLAMP_RADIUS = 100.0


def rotation_by(axes: str, angles) -> np.ndarray:
    return Rotation.from_euler(axes, angles, degrees=True).as_matrix()


def camera_grid(step: float = 10.0, reach: float = 1.0) -> np.ndarray:
    line = np.arange(-reach * CLAMP_RADIUS, reach * CLAMP_RADIUS + step, step) + step / 3
    x, y = (axis.ravel() for axis in np.meshgrid(line, line))
    near = np.hypot(x, y) < reach * CLAMP_RADIUS
    return np.stack([x[near], y[near], np.zeros(near.sum())], axis=1)


def orthotropic_shape(points: np.ndarray, rise: float) -> Frame:
    """An orthotropic shape: symmetric about x and y, still on the rim and beyond."""
    x, y = points[:, :2].T / CLAMP_RADIUS
    on = np.clip(1 - x**2 - y**2, 0.0, None)
    square = (rise / CLAMP_RADIUS) ** 2
    moved = np.stack(
        [
            CLAMP_RADIUS * square * on * x * (0.3 + 0.1 * y**2),
            CLAMP_RADIUS * square * on * y * (0.5 - 0.2 * x**2),
            rise * on * (1 - 0.1 * x**2 + 0.05 * y**2 + 0.1 * x**2 * y**2),
        ],
        axis=1,
    )
    return Frame(points, moved)


def seen_by_camera(frame: Frame, turn: np.ndarray, shift) -> Frame:
    return Frame(frame.points @ turn.T + np.asarray(shift), frame.displacement @ turn.T)


def noisy_frames(frames, sigma: float, rng) -> list[Frame]:
    noise = (sigma * rng.standard_normal(f.points.shape) for f in frames)
    return [Frame(f.points, f.displacement + one) for f, one in zip(frames, noise, strict=True)]


BUBBLE_FRAMES = [orthotropic_shape(camera_grid(), rise) for rise in (8.0, 20.0, 30.0)]
FRAMES_BEYOND_CLAMP = [
    orthotropic_shape(camera_grid(10.0, 1.2), rise) for rise in (8.0, 20.0, 30.0)
]


def elliptic_frames(angle: float, reach: float = 1.0) -> list[Frame]:
    """Frames of a sheet whose edge is an ellipse (100 by 70 mm) at an angle from its x, the warp.

    Its shape follows the edge and nothing else: it has no other axes.
    """
    points = camera_grid(7.0, reach)
    u, v = (points @ rotation_by("z", angle))[:, :2].T / [[100.0], [70.0]]
    on = np.clip(1 - u**2 - v**2, 0.0, None)
    kept = (on > 0) | (reach > 1)
    frames = []
    for rise in (8.0, 20.0, 30.0):
        along = on * (0.1 * u + 0.05 * v)
        moved = np.stack([along, 0.1 * on * v, rise * on * (1 + 0.1 * u**2)], axis=1)
        frames.append(Frame(points[kept], moved[kept]))
    return frames


FIVE_POINTS = np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 20.0], [-30.0, 0.0], [0.0, -40.0]])


def field_of(pressure, moved, points=FIVE_POINTS, z=None):
    moved = np.broadcast_to(np.asarray(moved, dtype=float), (len(points), 3))
    return DisplacementField(pressure, np.asarray(points, dtype=float), moved, z=z)


def doubts_said(check, expected=FABRIC, **seen):
    whole = MeasuredView(seen.pop("fields", (field_of(0.2, [0, 0, 30.0]),)), CIRCLE, 0.8, False)
    names = "outline highest_pressure last fields thickness inner rises is_flat"
    names += " mean_motion is_registered counts_from_pressure"
    if len(seen.get("centre_motions", ())) > 1:
        seen["fields"] = whole.fields * 2
    of_view = {name: getattr(whole, name) for name in names.split()}
    view = SimpleNamespace(clamp=None, expected=expected, **(of_view | seen))
    return [(doubt.name, doubt.sure, doubt.text) for doubt in check(view)]


def assert_doubted(check, count, name, sure, *words, **seen):
    found = doubts_said(check, **seen)
    assert [one[:2] for one in found] == [(name, sure)] * count
    assert all(word in one[2] for one in found for word in words), found


def apex(*strain, force=20.0):
    return Apex(0.2, 30.0, 0.01, force, 0.1, strain)


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
R, ELLIPSE = "radius = 100.0", "ellipse = { major = %s }"


def bubble_of_project(project: Project) -> BubbleTest:
    (test,) = project.tests.values()
    assert isinstance(test, BubbleTest)
    return test


PLACE = Place(Path("p.toml"), "bubble[0]", Fabric("a fabric", 0.8))
CAMERA = '[bubble.data.points.correlation]\ncamera = "two of 5 <MP>"\n'


def read_camera_bubble(seen, more: str) -> bf.Project:
    folder, text, _ = seen
    path = folder / "words.toml"
    path.write_text(text.replace(CAMERA, f"[bubble.data.points.correlation]\n{more}"))
    return bf.read_project(path)


PRESSURES = (0.02, 0.09, 0.19)


def cubic_targets() -> tuple[list[FieldTarget], np.ndarray, np.ndarray]:
    random = np.random.default_rng(5)
    nodes = disk_mesh(100.0, 16).points[:, :2]
    frames = random.standard_normal((3, len(nodes), 3))
    some = []
    for k, p in enumerate(PRESSURES):
        keep = np.delete(np.arange(len(nodes)), k)
        sample = sp.csr_matrix(np.eye(len(nodes))[keep])
        some.append(FieldTarget(p, random.standard_normal((len(keep), 3)), sample))
    return with_place_numbers(some, nodes), nodes, frames


def zero_history(frames: np.ndarray) -> History:
    return History(np.array(PRESSURES), frames, np.zeros(3), np.zeros(3))


TWO = (0.02, 0.2)
MESH = disk_mesh(100.0, 16)
#: mm, the surface in the reference picture; that of the two modes is 1 and x in radii.
Z0 = 0.02 * MESH.points[:, 0] - 0.5
MODES = {"z0_1": np.ones(len(Z0)), "z0_x": MESH.points[:, 0] / 100}
METRIC = {"metric_warp_1": 0.1, "metric_fill_1": 0.2, "metric_shear_1": 0.3}
SURFACE = SimpleNamespace(rms=np.array([0.0456]))


def fitted_sheet(sheet: SheetSettings) -> tuple[Any, Any]:
    model = BubbleModel(MESH, 0.8, TWO, TWO)
    nuisance, values = [], {}
    if sheet.measured:
        points = np.column_stack([MESH.points[:, :2], Z0])
        model = replace(model, mesh=replace(MESH, points=points))
    if sheet.modes:
        model = replace(model, modes=MODES)
        nuisance += [Nuisance(name, -9.0, 9.0, "mm", name, 1.0) for name in MODES]
        values |= {"z0_1": 2.0, "z0_x": 3.0}
    if sheet.slack:
        names = ("slack_warp", "slack_fill")
        nuisance += [Nuisance(name, -1.0, 1.0, "%", name, 0.01) for name in names]
        values |= {"slack_warp": 0.05, "slack_fill": -0.1}
    if sheet.metric:
        strains = metric_modes(MESH.points[:, :2] / 100.0, 1)
        nuisance += [Nuisance(name, -1.0, 1.0, "%", name, 0.01) for name in strains]
        model, values = replace(model, strains=strains), values | METRIC
    if sheet.moving_rim:
        motion = np.zeros((2, len(MESH.node_sets["rim"]), 3))
        motion[1, 3] = 0.3, 0.4, 1.2
        model = replace(model, rim_motion=motion)
    moved = np.zeros((2, len(Z0), 3))
    at_nodes = [FieldTarget(p, moved[k] + [0.3, 0.0, -0.4]) for k, p in enumerate(TWO)]
    targets = with_place_numbers(at_nodes, MESH.points[:, :2])
    objective = FieldObjective(targets, "mm", constant=sheet.constant)
    comparison = Comparison("b", model, MembraneSolver(), objective, tuple(nuisance))
    history = History(np.array(TWO), moved, np.zeros(3), np.zeros(3))
    test = SimpleNamespace(name="b", sheet=sheet, pressures=TWO, outline=Outline.circle(100.0))
    surface = SimpleNamespace(surface=SURFACE if sheet.measured else None)
    fit = SimpleNamespace(
        comparisons=[comparison],
        nuisance=values,
        reported_nuisance=values,
        histories=[history],
    )
    return SimpleNamespace(test=test, sheet=surface, known=None), fit
