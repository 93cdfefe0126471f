"""Bubbles computed by the membrane and read by gauges, without the code that reads them in fits."""

from functools import cache

import numpy as np
from bubblefit.experiments.bubble.field_shape import mirrored
from bubblefit.experiments.bubble.readings import ReadingSeries
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import Outline, elliptic_disk_mesh
from bubblefit.readers.fields import DisplacementField
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.interpolate import CloughTocher2DInterpolator

RIM = Outline.circle(100.0)
THICKNESS = 0.8
PRESSURES = (0.01, 0.03, 0.06, 0.1, 0.15, 0.2)
LAW = HypoelasticLaw.linear(700.0, 300.0, 15.0)


def bubble_model(elements=108, pressures=PRESSURES, symmetry="quarter"):
    mesh = elliptic_disk_mesh(RIM, elements, symmetry)
    return BubbleModel(mesh, THICKNESS, pressures, (0.3 * pressures[0], *pressures))


@cache
def inflated(law=LAW, elements=432):
    """The model and its history with a law."""
    model = bubble_model(elements)
    return model, MembraneSolver().run(model, law)


def gauge_heights(places, law=LAW, elements=432):
    """Heights (pressures, places), mm, of the moved sheet at places that stand still."""
    model, history = inflated(law, elements)
    rows = []
    for moved in history.displacement:
        field = mirrored(DisplacementField(1.0, model.mesh.points[:, :2], moved))
        points = field.points + field.displacement[:, :2]
        rows.append(CloughTocher2DInterpolator(points, field.displacement[:, 2])(places))
    return np.array(rows)


def height_series(place, pressures=PRESSURES, **keys):
    """A series of heights at a place, with values of zero unless they are given."""
    n = len(pressures)
    arrays = {"value": np.zeros(n), "specimens": np.zeros(n, dtype=int)} | keys
    positions = np.tile(np.asarray(place, dtype=float), (n, 1))
    return ReadingSeries(
        quantity="height",
        label=f"height at {place}",
        pressure=np.array(pressures),
        positions=positions,
        **arrays,
    )
