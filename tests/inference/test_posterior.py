"""inference/posterior.py: draws of laws, and information added to them."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.posterior import Posterior
from bubblefit.inference.unknowns import Unknowns
from bubblefit.materials.forms import polynomial as forms
from bubblefit.materials.law import HypoelasticLaw

from .cases import CONSTANT_BOUNDS

OFFSET = Nuisance("offset", -2.0, 2.0, "mm")
UNKNOWNS = replace(
    Unknowns.of(forms.CONSTANT, 0.24, [0.1, 0.1, 0.1], CONSTANT_BOUNDS),
    nuisance=NuisanceUnknowns({"linear": (OFFSET,)}),
)
LAW = HypoelasticLaw.linear(400.0, 250.0, 12.0)


def test_drawn_laws_keep_the_bounds_and_follow_the_seed():
    y = np.append(UNKNOWNS.at(np.array([1.0, 250.0, 400.0]))[:3], 2.0)
    covariance = np.diag([0.02, 1e-4, 1e-4, 0.1]) ** 2
    posterior = Posterior(UNKNOWNS, y, y, covariance)
    drawn = posterior.sample(2000, np.random.default_rng(0))
    a, c = UNKNOWNS.inequalities
    assert (drawn @ a.T >= c - 1e-7).all()
    assert drawn[:, 3].max() <= 2.0 + 1e-9 and drawn[:, 3].std() == pytest.approx(0.0603, rel=0.08)
    laws = posterior.laws(LAW, 50, np.random.default_rng(0))
    assert len(laws) == 50 and all(law.nu12 == LAW.nu12 for law in laws)
    shear = np.array([law.modulus("G12", np.zeros(1))[0] for law in laws])
    assert shear.min() >= 1.0 - 1e-7 and shear.std() > 0.1
    same = posterior.laws(LAW, 50, np.random.default_rng(0))
    assert all((one.beta == two.beta).all() for one, two in zip(laws, same, strict=True))


def test_information_adds_to_precision_and_pulls_centre_to_best():
    random = np.random.default_rng(2)
    roots = random.standard_normal((4, 4)), random.standard_normal((3, 2))
    covariance, more = roots[0] @ roots[0].T, roots[1] @ roots[1].T
    best = np.append(UNKNOWNS.at(np.array([12.0, 250.0, 400.0]))[:3], 0.0)
    centre = best + random.standard_normal(4)
    posterior = Posterior(UNKNOWNS, best, centre, covariance)
    added = np.zeros((4, 4))
    added[:3, :3] = more
    sharper = posterior.with_information(more)
    precision = np.linalg.inv(covariance) + added
    np.testing.assert_allclose(sharper.covariance, np.linalg.inv(precision), rtol=1e-9)
    middle = np.linalg.solve(precision, np.linalg.solve(covariance, centre) + added @ best)
    np.testing.assert_allclose(sharper.centre, middle, rtol=1e-9)


def test_information_beside_an_unknown_known_to_a_millionth():
    best = np.append(UNKNOWNS.at(np.array([12.0, 250.0, 400.0]))[:3], 0.0)
    # An unknown with hardly any information beside one that is known to a millionth.
    flat = Posterior(UNKNOWNS, best, best, np.diag([1e-6, 1e3, 1.0, 1.0]) ** 2)
    known = flat.with_information(np.diag([0.0, 1e4, 0.0]))
    np.testing.assert_allclose(
        np.sqrt(np.diag(known.covariance)), [1e-6, 0.01, 1.0, 1.0], rtol=1e-6
    )
    np.testing.assert_allclose(flat.with_information(np.zeros((3, 3))).covariance, flat.covariance)
