"""Builders for tests of materials: laws of each form, cards, exports, paths of strain."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.forms.base import COMPONENTS, UNLIMITED, form_named
from bubblefit.materials.forms.polynomial import CONSTANT, CUBIC, LINEAR, QUADRATIC, LoadRatio
from bubblefit.materials.forms.ratio import SplineCrimp, SplineRatio
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.memory import Memory
from bubblefit.materials.pieces import increment_modulus
from bubblefit.solvers.export_formats import FORMATS

from ..builders.fortran import BETA, LAWS
from ..builders.laws import TABLE_4_2

CUBIC_BETA = 1e3 * np.array(TABLE_4_2)
FORM_RANGE = [0.11, 0.12, 0.13]
FORM_KNOTS = [[0.0, 0.01, 0.04, 0.06, 0.11], [0.0, 0.06, 0.12], [0.0, 0.02, 0.05, 0.13, 0.2]]


def _degree(degree):
    beta = CUBIC_BETA.reshape(3, 4).copy()
    beta[:, : 3 - degree] = 0.0
    return beta.ravel()


STRAIN_LAW_OF_FORM = {
    "constant": HypoelasticLaw(_degree(0), 0.24, FORM_RANGE, form=CONSTANT),
    "linear": HypoelasticLaw(np.abs(_degree(1)), 0.24, FORM_RANGE, form=LINEAR),
    "quadratic": HypoelasticLaw(np.abs(_degree(2)), 0.24, FORM_RANGE, form=QUADRATIC),
    "cubic": HypoelasticLaw(CUBIC_BETA, 0.24, FORM_RANGE, form=CUBIC),
    "trilinear": HypoelasticLaw.trilinear(
        (800.0, 450.0, 900.0), (140.0, 110.0, 240.0), (20.0, 14.0, 40.0),
        [[0.01, 0.03], [0.02, 0.2], [0.01, 0.04]], 0.24, FORM_RANGE,
    ),
    "spline": HypoelasticLaw(
        np.array([20.0, 9.0, 8.0, 16.0, 30.0, 140.0, 120.0, 260.0, 800, 640, 350, 330, 500.0]),
        0.24, FORM_RANGE, form=Spline.at(FORM_KNOTS),
    ),
}  # fmt: skip


def turning_points(law: HypoelasticLaw, name: str) -> np.ndarray:
    ends = law.pieces[COMPONENTS[name], :, 0]
    return np.unique(np.concatenate([-ends, [0.0], ends]))


def integral_of_modulus(law: HypoelasticLaw, name: str, start: float, end: float) -> float:
    """Integrate the modulus as a reader of the card does: Gauss between the turning points."""
    if end < start:
        return -integral_of_modulus(law, name, end, start)
    at, weight = np.polynomial.legendre.leggauss(4)
    inside = [x for x in turning_points(law, name) if start < x < end]
    points = np.array([start, *inside, end])
    width, middle = np.diff(points), 0.5 * (points[1:] + points[:-1])
    x = middle[:, None] + 0.5 * width[:, None] * at
    return float((0.5 * width[:, None] * weight * law.modulus(name, x)).sum())


def stress_along(law, path):
    stress = np.zeros((1, 3))
    for old, new in pairwise(path):
        stress, _ = law.increment(old, new, stress)
    return stress[0]


LAW_OF_FORM = {
    **STRAIN_LAW_OF_FORM,
    "load-ratio": HypoelasticLaw(
        np.array([20.0, 240.0, 90.0, 600.0, -150.0]), 0.24, FORM_RANGE, form=LoadRatio()
    ),
    "spline-ratio": HypoelasticLaw(
        np.array([*STRAIN_LAW_OF_FORM["spline"].beta, 40.0, -150.0]), 0.24, FORM_RANGE,
        form=SplineRatio.at(FORM_KNOTS),
    ),
}  # fmt: skip
FORMS = pytest.mark.parametrize("name", LAW_OF_FORM)
NO_RANGE = [UNLIMITED] * 3
EVERY_FORM = pytest.mark.parametrize("form", STRAIN_LAW_OF_FORM)


def mean_of(form: str, name: str, x: float, x_old: float) -> tuple[float, float, float]:
    return increment_modulus(STRAIN_LAW_OF_FORM[form].pieces, COMPONENTS[name], x, x_old)


RATIO_NU = 0.24
#: MPa: G12, E2 at 1:1 and its gain, E1 at 1:1 and its gain.
RATIO_BETA = (30.0, 800.0, 400.0, 1000.0, -300.0)


def load_ratio_law(beta=RATIO_BETA, nu=RATIO_NU):
    return HypoelasticLaw(np.array(beta, dtype=float), nu, form=LoadRatio())


def loads_out_of_proportion(increments):
    """Warp first, then the fill while the warp is let go: nowhere in proportion."""
    share = np.linspace(0.0, 1.0, increments + 1)[1:, None]
    return np.concatenate([share * [20.0, 5.0], [20.0, 5.0] + share * [-10.0, 20.0]])


FORM = SplineCrimp.at([[0.0, 0.06, 0.12]] * 3)
#: MPa: G12, E2 and E1 at three knots; T1, T2 and S.
CRIMP = np.array([20.0, 25.0, 30.0, 300.0, 250.0, 400.0, 500.0, 450.0, 600.0, 1.5, 2.5, 12.0])
STIFF = np.array([20.0] * 3 + [300.0] * 3 + [500.0] * 3 + [1.5, 2.5, 12.0])


def crimp_law(beta=CRIMP, nu=0.2):
    return HypoelasticLaw(np.array(beta, dtype=float), nu, [0.12] * 3, form=FORM)


def lengthened(stress, beta=CRIMP):
    """Strain of the crimp alone: slopes after the exchange, in which the crossings balance."""
    *_, t1, t2, bed = beta
    r = np.array([t1, t2]) / bed
    w = (r @ (stress * [1, -1])) / (bed + stress.sum())
    after = r + w * np.array([-1, 1])
    assert stress @ (after * [1, -1]) == pytest.approx(bed * w)
    return r**2 - after**2


EXPORTED_CARD = MaterialCard(LAWS["cubic"], 0.8, "Valmex 7318", "Table 4.2")
E1, E2, NU12 = np.poly1d(BETA[8:]), np.poly1d(BETA[4:8]), 0.24


def export(name, card=EXPORTED_CARD, **options):
    return FORMATS[name].export(card, **options)


def few_points(name, count=15):
    return {"points": count} if hasattr(FORMATS[name].options(), "points") else {}


def strip_curve(pulled, log_strain):
    """Nominal strain and stress of the cubic card; the width's modulus is held at zero strain."""
    stress = (E1, E2)[pulled].integ()(log_strain)
    across = -NU12 * (log_strain if pulled == 0 else stress / E1(0))
    return np.expm1(log_strain), stress * np.exp(across)


def fixed_columns(line, widths):
    ends = np.cumsum(widths)
    return [line[end - width : end] for width, end in zip(widths, ends, strict=True)]


EXPORTED_MEMORY = Memory((0.4, 0.5, 0.3), (1.6, 1.7, 1.5), (1.2, 1.1, 1.0), (3.0, 5.0, 1.0))
MEMORY_CARD = replace(
    EXPORTED_CARD, law=replace(LAWS["cubic"], memory=EXPORTED_MEMORY), state="first loading"
)
CARD_ENDS = [0.1, 0.12, 0.2]


def quadratic_law():
    form = form_named("quadratic", {}, CARD_ENDS)
    beta = np.zeros(form.size)
    beta[list(form.free)] = [100, 20, 10, 900, 200, 190, 2000, 300, 330]
    return HypoelasticLaw(beta, 0.24, np.array(CARD_ENDS), form=form)


LINEAR_CARD = MaterialCard(HypoelasticLaw.linear(1000.0, 800.0, 30.0, 0.24), 0.8, "linear")


def text_of(name, card=LINEAR_CARD, **options):
    made = FORMATS[name].export(card, **options)
    (text,) = made.files.values()
    return text, made.remarks


MEMORY = Memory((0.4, 0.5, 0.3), (1.6, 1.7, 1.5), (1.2, 1.1, 1.05), (3.0, 5.0, 1.0))
MEMORY_BETA = np.zeros(12)
MEMORY_BETA[[2, 3, 6, 7, 10, 11]] = 20.0, 15.0, 500.0, 200.0, -300.0, 800.0
MEMORY_LAW = HypoelasticLaw(MEMORY_BETA, 0.24, [0.1, 0.1, 0.5], memory=MEMORY)
MEMORYLESS_LAW = replace(MEMORY_LAW, memory=None)
