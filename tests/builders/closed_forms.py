"""Closed forms of the strips of constant moduli of two tests, and cards near their optima."""

from dataclasses import replace

import numpy as np
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from scipy.optimize import minimize_scalar

from .projects import STRIP_ELONGATION, STRIP_MODULI

#: MPa, near the optima of the tests; without contraction loads along the yarns are 20 mm^2 E eps.
CARD = MaterialCard(HypoelasticLaw.linear(330.0, 190.0, 10.0, 0.0), 0.8, "near")


ENDS = {"one": 2.9, "two": 2.5}


STRAIN = {
    test: np.log1p(STRIP_ELONGATION[STRIP_ELONGATION <= end] / 20) for test, end in ENDS.items()
}


def relative_error(test, direction, modulus):
    loads = np.array([20 * e * STRAIN[test] for e in STRIP_MODULI[test][direction]])
    return float(np.sqrt(np.mean((20 * modulus * STRAIN[test] - loads) ** 2)) / loads.max())


def best_warp(one, two):
    """E1 (MPa) that both tests together ask for: fill of "one" has half of its weight."""

    def total(modulus):
        own = one * relative_error("one", "warp", modulus) / 2
        return own + two * relative_error("two", "warp", modulus)

    found = minimize_scalar(total, bounds=(200, 500), method="bounded", options={"xatol": 1e-6})
    return float(found.x)


#: MPa; not quite the optimum of test "one", which is at 330 and 190.
PROFILED = MaterialCard(HypoelasticLaw.linear(328.0, 190.5, 10.0, 0.0), 0.8, "near")


LAW = replace(
    HypoelasticLaw.linear(350.0, 190.0, 60.0, 0.0), strain_range=np.array([0.1, 0.14, 0.1])
)
