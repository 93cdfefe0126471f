"""Traps made from one good bubble test are named; good tests of many kinds raise no doubt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble.doubts import View, apex_of, doubts_of
from bubblefit.experiments.bubble.objective import mirrored
from bubblefit.experiments.kinds import Expected
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import Outline, disk_mesh, elliptic_disk_mesh
from bubblefit.readers.fields import DisplacementField
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.interpolate import CloughTocher2DInterpolator
from scipy.spatial.transform import Rotation

RADIUS, THICKNESS = 100.0, 0.81
PRESSURES = (0.02, 0.06, 0.15, 0.3)
FABRIC = Expected({"E1": (250.0, 1500.0), "E2": (50.0, 500.0), "G12": (7.0, 70.0)})
LAW = HypoelasticLaw.linear(700.0, 300.0, 15.0)
Fields = tuple[DisplacementField, ...]


def inflated(
    law: HypoelasticLaw, radius: float = RADIUS, thickness: float = THICKNESS, pressures=PRESSURES
) -> Fields:
    """Fields at points of a grid, as a camera has them, of a computed bubble."""
    mesh = disk_mesh(radius, 192, "quarter")
    history = MembraneSolver().run(BubbleModel(mesh, thickness, tuple(pressures)), law)
    line = np.linspace(-radius, radius, 29)[1:-1] + 0.01 * radius
    points = np.stack([axis.ravel() for axis in np.meshgrid(line, line)], axis=1)
    points = points[np.hypot(*points.T) < 0.97 * radius]
    fields = []
    for pressure, moved in zip(pressures, history.displacement, strict=True):
        whole = mirrored(DisplacementField(pressure, mesh.points[:, :2], moved))
        at = CloughTocher2DInterpolator(whole.points, whole.displacement)(points)
        fields.append(DisplacementField(pressure, points, at, z=np.zeros(len(points))))
    return tuple(fields)


@pytest.fixture(scope="module")
def good():
    return inflated(LAW)


def names(fields: Fields, expected: Expected = FABRIC, radius=RADIUS, thickness=THICKNESS):
    found = doubts_of(View(tuple(fields), Outline.circle(radius), thickness, False), expected)
    return {doubt.name: doubt for doubt in found}


def elliptic(outline: Outline) -> Fields:
    """Fields of a sheet with an elliptic edge, a little noise in them."""
    mesh = elliptic_disk_mesh(outline, 192)
    history = MembraneSolver().run(BubbleModel(mesh, THICKNESS, PRESSURES), LAW)
    line = np.linspace(-1, 1, 29)[1:-1] + 0.01
    points = np.stack([axis.ravel() for axis in np.meshgrid(line, line)], axis=1)
    points = outline.places(points[np.hypot(*points.T) < 0.97])
    fields = []
    for pressure, moved in zip(PRESSURES, history.displacement, strict=True):
        at = CloughTocher2DInterpolator(mesh.points[:, :2], moved)(points)
        fields.append(DisplacementField(pressure, points, at, z=np.zeros(len(points))))
    return noisy(tuple(fields), 0.02)


@pytest.mark.parametrize("angle", [0.0, 90.0, 30.0])
def test_an_elliptic_sheet_raises_no_doubt_where_it_is_said_to_lie(angle):
    outline = Outline(120.0, 80.0, angle)
    fields = elliptic(outline)
    assert not doubts_of(View(fields, outline, THICKNESS, False), FABRIC)
    off = Outline(120.0, 80.0, angle - 12.0)
    found = doubts_of(View(fields, off, THICKNESS, False), FABRIC)
    assert [doubt.name for doubt in found] == ["turned"]
    assert f"{angle:.3g} degrees from x" in found[0].text or angle in (0.0, 90.0)
    assert f"not {angle - 12.0:.3g}:" in found[0].text, found[0].text
    inches = columns(1 / 25.4)(fields)
    (unit,) = doubts_of(View(inches, outline, THICKNESS, False), FABRIC)
    assert unit.name == "length-unit"


def each(change: Callable[[DisplacementField], DisplacementField]):
    return lambda fields: tuple(change(field) for field in fields)


def columns(points: float = 1.0, moved=(1.0, 1.0, 1.0)):
    """Places and displacements times factors."""
    return each(lambda f: replace(f, points=f.points * points, displacement=f.displacement * moved))


def in_camera(turn: Rotation, shift=(0.0, 0.0, 0.0)):
    def seen(field: DisplacementField) -> DisplacementField:
        flat = np.column_stack([field.points, np.zeros(len(field.points))])
        places = turn.apply(flat) + shift
        return replace(
            field, points=places[:, :2], z=places[:, 2], displacement=turn.apply(field.displacement)
        )

    return each(seen)


def swap(field: DisplacementField) -> DisplacementField:
    moved = field.displacement[:, [1, 0, 2]]
    return replace(field, points=field.points[:, ::-1].copy(), displacement=moved)


def deformed(field: DisplacementField) -> DisplacementField:
    places = field.points + field.displacement[:, :2]
    return replace(field, points=places, z=field.displacement[:, 2])


def flat_deformed(field: DisplacementField) -> DisplacementField:
    return replace(deformed(field), z=None)


def rejected(field: DisplacementField) -> DisplacementField:
    moved = field.displacement.copy()
    moved[200:206] = 0.0
    return replace(field, displacement=moved)


def at_origin(field: DisplacementField) -> DisplacementField:
    points, moved = field.points.copy(), field.displacement.copy()
    points[200:206], moved[200:206] = 0.0, 0.0
    return replace(field, points=points, displacement=moved)


def exchanged(fields: Fields) -> Fields:
    first, second, third, last = fields
    return (
        first, replace(third, pressure=second.pressure), replace(second, pressure=third.pressure),
        last,
    )  # fmt: skip


TRAPS = {
    "places in m": (columns(0.001), "length-unit", True, "radii from the centre"),
    "displacements in m": (columns(1.0, (0.001,) * 3), "length-unit", True, "mm beside m"),
    "bar read as kPa": (
        each(lambda f: replace(f, pressure=f.pressure / 100)), "pressure-unit", True, "kPa",
    ),
    "kPa read as bar": (
        each(lambda f: replace(f, pressure=f.pressure * 100)), "pressure-unit", True, "bar",
    ),
    "z flipped": (columns(1.0, (1.0, 1.0, -1.0)), "z-flipped", True, "z is flipped"),
    "y flipped in places only": (
        each(lambda f: replace(f, points=f.points * (1.0, -1.0))), "axis-flipped", True, "y and dy",
    ),
    "x flipped in displacements only": (
        columns(1.0, (-1.0, 1.0, 1.0)), "axis-flipped", True, "x and dx",
    ),
    "warp and fill swapped": (each(swap), "swapped", False, "swapped"),
    "deformed coordinates": (each(deformed), "deformed-coordinates", True, "height z follows"),
    "deformed coordinates without z": (
        each(flat_deformed), "deformed-coordinates", True, "from frame to frame",
    ),
    "rejected points do not move": (each(rejected), "zero-points", True, "5 of 500 points"),
    "rejected points at the origin": (each(at_origin), "zero-points", True, "x = y = 0"),
    "a frame repeated": (
        lambda f: (*f[:2], replace(f[1], pressure=f[2].pressure), f[3]), "repeated-frame", True,
        "60 and 150 kPa",
    ),
    "frames out of order": (
        exchanged, "frame-order", True, "between 60 and 150 kPa",
    ),
    "turned by 12 degrees": (
        in_camera(Rotation.from_euler("z", 12.0, degrees=True)), "turned", False, "degrees from x",
    ),
    "tilted by 3 degrees": (
        in_camera(Rotation.from_euler("x", 3.0, degrees=True)), "tilted", False, "3 degrees from z",
    ),
    "5 mm off the centre": (
        in_camera(Rotation.identity(), (3.0, 4.0, 0.0)), "off-centre", False, "x = 3, y = 3.99 mm",
    ),
    "in the camera's heights": (
        in_camera(Rotation.identity(), (0.0, 0.0, 600.0)), "camera-frame", False, "z = 600",
    ),
}  # fmt: skip


@pytest.mark.parametrize("trap", TRAPS)
def test_a_trap_is_named(good, trap):
    change, name, sure, words = TRAPS[trap]
    found = names(change(good))
    assert name in found, (trap, list(found))
    assert found[name].sure == sure and words in found[name].text, found[name].text


def test_one_trap_raises_no_other_sure_doubt(good):
    for trap, (change, name, _, _) in TRAPS.items():
        assert {d.name for d in names(change(good)).values() if d.sure} <= {name}, trap


GOOD = {
    "soft in shear": (HypoelasticLaw.linear(700.0, 300.0, 3.0), {}),
    "stiff": (HypoelasticLaw.linear(1400.0, 450.0, 60.0), {}),
    "balanced": (HypoelasticLaw.linear(400.0, 400.0, 20.0), {}),
    "fill a little stiffer": (HypoelasticLaw.linear(380.0, 420.0, 20.0), {}),
    "small": (LAW, {"radius": 30.0, "pressures": (0.05, 0.2, 0.6)}),
    "large": (LAW, {"radius": 400.0, "pressures": (0.005, 0.02, 0.08)}),
    "thin": (LAW, {"thickness": 0.2, "pressures": (0.005, 0.02, 0.07)}),
    "low pressures": (LAW, {"pressures": (0.004, 0.01, 0.02)}),
    "one pressure": (LAW, {"pressures": (0.2,)}),
}


def noisy(fields: Fields, size: float) -> Fields:
    rng = np.random.default_rng(7)
    return tuple(
        replace(f, displacement=f.displacement + size * rng.standard_normal(f.displacement.shape))
        for f in fields
    )


@pytest.mark.parametrize("kind", GOOD)
def test_good_tests_raise_no_doubt(kind):
    law, other = GOOD[kind]
    fields = noisy(inflated(law, **other), 0.02)
    assert not names(
        fields, radius=other.get("radius", RADIUS), thickness=other.get("thickness", THICKNESS)
    )


@pytest.mark.parametrize("how", ["as computed", "half the points", "noise of 0.05 mm", "no z"])
def test_the_good_test_raises_no_doubt(good, how):
    fields = {
        "as computed": good,
        "half the points": tuple(
            replace(f, points=f.points[::2], displacement=f.displacement[::2], z=None) for f in good
        ),
        "noise of 0.05 mm": noisy(good, 0.05),
        "no z": tuple(replace(f, z=None) for f in good),
    }[how]
    assert not names(fields)


def test_equilibrium_of_the_apex_gives_the_stress_of_the_model(good):
    """The mean of the two membrane forces, within the little that they differ: 3 %."""
    law = HypoelasticLaw.linear(400.0, 400.0, 400.0 / 2.48)  # isotropic: both forces are the same
    top = apex_of(inflated(law)[-1], RADIUS)
    strain = 0.5 * sum(top.strain)
    assert top.force / THICKNESS == pytest.approx(400.0 / (1 - 0.24) * strain, rel=0.03)
    assert top.height == pytest.approx(inflated(law)[-1].displacement[:, 2].max(), rel=0.01)
    noise = [apex_of(noisy(good, s)[-1], RADIUS) for s in (0.05, 0.1)]
    assert 0 < noise[0].error < 0.05 * noise[0].force
    assert noise[1].error == pytest.approx(2 * noise[0].error, rel=0.2)
