"""Laws of every form, and their moduli integrated by quadrature, for the tests of the law."""

import numpy as np
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.forms.polynomial import CONSTANT, CUBIC, LINEAR, QUADRATIC
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw

from ...published_laws import TABLE_4_2

# MPa.
BETA = 1e3 * np.array(TABLE_4_2)
RANGE = [0.11, 0.12, 0.13]
KNOTS = [[0.0, 0.01, 0.04, 0.06, 0.11], [0.0, 0.06, 0.12], [0.0, 0.02, 0.05, 0.13, 0.2]]


def _degree(degree: int) -> np.ndarray:
    beta = BETA.reshape(3, 4).copy()
    beta[:, : 3 - degree] = 0.0
    return beta.ravel()


LAWS = {
    "constant": HypoelasticLaw(_degree(0), 0.24, RANGE, form=CONSTANT),
    "linear": HypoelasticLaw(np.abs(_degree(1)), 0.24, RANGE, form=LINEAR),
    "quadratic": HypoelasticLaw(np.abs(_degree(2)), 0.24, RANGE, form=QUADRATIC),
    "cubic": HypoelasticLaw(BETA, 0.24, RANGE, form=CUBIC),
    "trilinear": HypoelasticLaw.trilinear(
        (800.0, 450.0, 900.0), (140.0, 110.0, 240.0), (20.0, 14.0, 40.0),
        [[0.01, 0.03], [0.02, 0.2], [0.01, 0.04]], 0.24, RANGE,
    ),
    "spline": HypoelasticLaw(
        np.array([20.0, 9.0, 8.0, 16.0, 30.0, 140.0, 120.0, 260.0, 800, 640, 350, 330, 500.0]),
        0.24, RANGE, form=Spline.at(KNOTS),
    ),
}  # fmt: skip


def turning_points(law: HypoelasticLaw, name: str) -> np.ndarray:
    """Every strain at which a modulus passes from one piece to the next, both signs."""
    ends = law.pieces[COMPONENTS[name], :, 0]
    return np.unique(np.concatenate([-ends, [0.0], ends]))


def integral(law: HypoelasticLaw, name: str, start: float, end: float) -> float:
    """Of the modulus, as a reader of the card takes it: Gauss between the turning points."""
    if end < start:
        return -integral(law, name, end, start)
    at, weight = np.polynomial.legendre.leggauss(4)
    inside = [x for x in turning_points(law, name) if start < x < end]
    points = np.array([start, *inside, end])
    width, middle = np.diff(points), 0.5 * (points[1:] + points[:-1])
    x = middle[:, None] + 0.5 * width[:, None] * at
    return float((0.5 * width[:, None] * weight * law.modulus(name, x)).sum())
