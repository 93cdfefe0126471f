"""Bubbles computed by the membrane, as measured fields: clean, with a clamp, seen by a camera."""

from dataclasses import replace
from functools import partial

import numpy as np
from bubblefit.experiments.bubble.doubts import doubts_of
from bubblefit.experiments.bubble.field_shape import mirrored
from bubblefit.experiments.bubble.measured_view import MeasuredView
from bubblefit.experiments.doubts import Expected
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import Outline, elliptic_disk_mesh
from bubblefit.readers.fields import DisplacementField
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.interpolate import CloughTocher2DInterpolator
from scipy.spatial.transform import Rotation

CIRCLE, THICKNESS = Outline.circle(100.0), 0.81
PRESSURES = (0.02, 0.06, 0.15, 0.3)
FABRIC = Expected({"E1": (250.0, 1500.0), "E2": (50.0, 500.0), "G12": (7.0, 70.0)})
DOUBTED_LAW = HypoelasticLaw.linear(700.0, 300.0, 15.0)


def points_on(outline):
    line = np.linspace(-1, 1, 29)[1:-1] + 0.01
    points = np.stack([axis.ravel() for axis in np.meshgrid(line, line)], axis=1)
    return outline.places(points[np.hypot(*points.T) < 0.97])


def inflated_bubble(law, outline=CIRCLE, thickness=THICKNESS, pressures=PRESSURES):
    mesh = elliptic_disk_mesh(outline, 192, "quarter" if outline.round else "full")
    history = MembraneSolver().run(BubbleModel(mesh, thickness, pressures), law)
    points, fields = points_on(outline), []
    for pressure, moved in zip(pressures, history.displacement, strict=True):
        whole = DisplacementField(pressure, mesh.points[:, :2], moved)
        whole = mirrored(whole) if outline.round else whole
        at = CloughTocher2DInterpolator(whole.points, whole.displacement)(points)
        fields.append(DisplacementField(pressure, points, at, z=np.zeros(len(points))))
    return tuple(fields)


def with_clamp(fields, out=118.0):
    angle, radius = np.meshgrid(np.arange(0.0, 2 * np.pi, 0.1), np.arange(101.0, out, 4.0))
    ring = np.stack([(radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel()], axis=1)
    z, still = np.zeros(len(ring)), np.zeros((len(ring), 3))
    return tuple(
        replace(f, points=np.vstack([f.points, ring]), z=np.append(f.z, z),
                displacement=np.vstack([f.displacement, still]))
        for f in fields
    )  # fmt: skip


def doubts_by_name(fields, expected=FABRIC, outline=CIRCLE, thickness=THICKNESS):
    found = doubts_of(MeasuredView(tuple(fields), outline, thickness, False, expected=expected))
    return {doubt.name: doubt for doubt in found}


def for_each_field(change, *args):
    return lambda fields: tuple(change(field, *args) for field in fields)


def pressed(field, by):
    return replace(field, pressure=field.pressure * by)


def zeros(field, by):
    places, moved = field.points.copy(), field.displacement.copy()
    places[200:206], moved[200:206] = by * places[200:206], 0.0
    return replace(field, points=places, displacement=moved)


def swap(field):
    moved = field.displacement[:, [1, 0, 2]]
    return replace(field, points=field.points[:, ::-1].copy(), displacement=moved)


def deformed(field, z):
    places, height = field.points + field.displacement[:, :2], field.displacement[:, 2]
    return replace(field, points=places, z=height if z else None)


def exchanged(fields):
    first, two, three, last = fields
    return first, replace(three, pressure=two.pressure), replace(two, pressure=three.pressure), last


def columns(points: float = 1.0, moved=(1.0, 1.0, 1.0)):
    return for_each_field(
        lambda f: replace(f, points=f.points * points, displacement=f.displacement * moved)
    )


def in_camera(turn: Rotation, shift=(0.0, 0.0, 0.0)):
    def seen(field_of):
        places = (
            turn.apply(np.column_stack([field_of.points, np.zeros(len(field_of.points))])) + shift
        )
        moved = turn.apply(field_of.displacement)
        return replace(field_of, points=places[:, :2], z=places[:, 2], displacement=moved)

    return for_each_field(seen)


TURN = partial(Rotation.from_euler, degrees=True)
#: Doubts that tests of their own provoke, and whether they are errors.
MISTAKES_WITH_OWN_TESTS = {
    "frame-numbers": False,
    "pressure-log": False,
    "outliers": False,
    "repeated-points": False,
    "moving-edge": False,
    "radius": True,
    "flat-sheet": False,
    "height-flipped": False,
    "height-falls": True,
    "height-unit": True,
    "not-zeroed": False,
    "left-out": False,
    "loaded-reference": False,
}
BUBBLE_MISTAKES = {
    "places in m": (columns(0.001), "length-unit", True, "radii from the centre"),
    "displacements in m": (columns(1.0, (0.001,) * 3), "length-unit", True, "mm beside m"),
    "bar read as kPa": (for_each_field(pressed, 0.01), "pressure-unit", True, "kPa"),
    "kPa read as bar": (for_each_field(pressed, 100), "pressure-unit", True, "bar"),
    "z flipped": (columns(1.0, (1.0, 1.0, -1.0)), "z-flipped", True, "z is flipped"),
    "y flipped in places only": (columns((1.0, -1.0)), "axis-flipped", True, "y and dy"),
    "x flipped in displacements only": (
        columns(1.0, (-1.0, 1.0, 1.0)),
        "axis-flipped",
        True,
        "x and dx",
    ),
    "x and y exchanged in places only": (
        for_each_field(lambda f: replace(f, points=f.points[:, ::-1].copy())),
        "exchanged",
        True,
        "calls for about 0.054: dx and dy are exchanged",
    ),
    "dx and dy in cm": (columns(1.0, (0.1, 0.1, 1.0)), "strain-rise", True, "in one unit"),
    "warp and fill swapped": (for_each_field(swap), "swapped", False, "swapped"),
    "deformed coordinates": (
        for_each_field(deformed, True),
        "deformed-coordinates",
        True,
        "height z",
    ),
    "deformed coordinates without z": (
        for_each_field(deformed, False),
        "deformed-coordinates",
        True,
        "from frame to frame",
    ),
    "rejected points do not move": (
        for_each_field(zeros, 1.0),
        "zero-points",
        True,
        "5 of 500 points",
    ),
    "rejected points at the origin": (for_each_field(zeros, 0.0), "zero-points", True, "x = y = 0"),
    "a frame repeated": (
        lambda f: (*f[:2], replace(f[1], pressure=f[2].pressure), f[3]),
        "repeated-frame",
        True,
        "60 and 150 kPa",
    ),
    "a frame at rest said to be under pressure": (
        lambda f: (replace(f[0], displacement=1e-3 * f[0].displacement, pressure=0.5e-3), *f),
        "rest-frame",
        True,
        "at 0.5 kPa",
    ),
    "frames out of order": (exchanged, "frame-order", True, "between 60 and 150 kPa"),
    "turned by 12 degrees": (in_camera(TURN("z", 12.0)), "turned", False, "degrees from x"),
    "tilted by 3 degrees": (in_camera(TURN("x", 3.0)), "tilted", False, "3 degrees from z"),
    "5 mm off the centre": (
        in_camera(TURN("z", 0.0), (3.0, 4.0, 0.0)),
        "off-centre",
        False,
        "x = 3, y = 3.99 mm",
    ),
    "in the camera's heights": (
        in_camera(TURN("z", 0.0), (0.0, 0.0, 600.0)),
        "camera-frame",
        False,
        "z = 600",
    ),
}


def noisy(fields, size):
    rng = np.random.default_rng(7)
    noise = [size * rng.standard_normal(f.displacement.shape) for f in fields]
    every = zip(fields, noise, strict=True)
    return tuple(replace(f, displacement=f.displacement + n) for f, n in every)
