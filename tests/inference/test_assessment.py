"""Uncertainty of a fit: covariance, information, correlation, chi square."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.experiments.bubble.targets import FieldTarget
from bubblefit.inference.assessment import certainty, moduli_from
from bubblefit.inference.bound_notes import BOUND, notes_on_box
from bubblefit.inference.correlation import correlated_count, correlated_count_of
from bubblefit.inference.descent import descend
from bubblefit.inference.information import information
from bubblefit.inference.law_bounds import LawBounds
from bubblefit.inference.linear import PRIOR, posteriors_of
from bubblefit.inference.mesh_limit import FineMeshLimit
from bubblefit.inference.moduli import moduli_error
from bubblefit.inference.noise import (
    ABOVE_NOISE,
    BELOW_NOISE,
    SIGNIFICANCE,
    Misfit,
    Noise,
    NoiseTest,
    noise_tests,
    notes_of_noise,
)
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.posterior import Posterior
from bubblefit.inference.unknowns import Unknowns
from bubblefit.materials.forms.base import form_named
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.wording import percent
from scipy.ndimage import gaussian_filter

from .cases import (
    CONSTANT,
    LAW,
    MODEL,
    PRESSURES,
    clean_fit,
    follows,
    problem,
    reference,
    scatter_of,
    single,
    targets,
)

REACHED = np.array([0.08, 0.08, 0.08])
FLAT_LAW = HypoelasticLaw.linear(400.0, 250.0, 12.0)
PRESSURE = Nuisance("pressure_offset", -290.0, 3000.0, "kPa", "pressure_offset", 1e-3)
PRESSED = replace(CONSTANT, nuisance=NuisanceUnknowns({"bubble": (PRESSURE,)}))


def test_moduli_error_looks_at_every_strain():
    breaks = [[0.03, 0.06]] * 3
    known = HypoelasticLaw.trilinear([300.0] * 3, [220.0] * 3, [4.0] * 3, breaks)
    e1, e2, g12 = [300.0, 330.0, 300.0], [231.0, 220.0, 220.0], [4.0, 4.0, 5.0]
    law = HypoelasticLaw.trilinear(e1, e2, g12, breaks)
    whole = moduli_error(law, known, np.array([0.1, 0.1, 0.1]))
    assert whole == pytest.approx({"E1": 0.1, "E2": 0.05, "G12": 0.25})
    part = moduli_error(law, known, np.array([0.02, 0.02, 0.05]))
    assert part == pytest.approx({"E1": 0.0, "E2": 0.05, "G12": 0.0})


def test_certainty_predicts_the_scatter_of_noisy_fits():
    fit, moduli, noise = problem(CONSTANT), np.array([12.0, 250.0, 400.0]), 0.05
    clean = MembraneSolver(1e-10).run(MODEL, FLAT_LAW)
    drawn = noise * np.random.default_rng(2).standard_normal(clean.displacement.shape)
    fit.comparisons[0].objective = FieldObjective(targets(clean.displacement + drawn))
    truth = CONSTANT.at(moduli)
    point = fit.evaluate(truth, True)
    scatter = scatter_of(fit, point, {"bubble": noise})
    predicted = certainty(fit, point, FLAT_LAW, clean.strain_max)
    assert predicted.noise.level["bubble"] == pytest.approx(noise, rel=0.03)  # of 1281 values: 2 %
    sigma = [predicted.linear_sigma[name][0] for name in ("G12", "E2", "E1")]
    assert sigma == pytest.approx(CONSTANT.to_coefficients @ scatter / moduli, rel=0.03)
    assert [predicted.sigma[name][0] for name in ("G12", "E2", "E1")] == pytest.approx(
        sigma, rel=0.01
    )
    assert not predicted.undetermined
    limit = FineMeshLimit(np.zeros_like(point.unknowns), 3 * point.residual, 0 * point.residual)
    thrice = certainty(fit, point, FLAT_LAW, clean.strain_max, limit)
    assert thrice.linear_sigma["G12"][0] == pytest.approx(3 * sigma[0])
    assert thrice.noise_sigma["G12"] == pytest.approx(thrice.sigma["G12"])
    (words,) = thrice.undetermined
    most = percent(thrice.sigma["G12"].max())
    assert words.startswith(f"G12 is uncertain by up to {most} (1 sigma at 0.15 mm")
    best, _ = descend(fit, point, 1e-7, 10**6, norms=True)
    off = best.unknowns - truth - follows(fit, point, -point.residual)
    assert np.abs(off / scatter).max() < 0.05  # 0.016: G12 is not quite linear


def test_what_a_nuisance_hides_is_not_determined():
    """At a single pressure that is not known for sure, moduli can only be told up to a factor."""
    model, found = replace(MODEL, pressures=PRESSURES[-1:], increments=PRESSURES), []
    for unknowns in (CONSTANT, PRESSED):
        fit = flat(unknowns, model)
        point = evaluated(fit)
        noise = Noise.from_residual(fit, point.residual)
        posterior = posteriors_of(fit, point, noise)[0]
        strains = {name: np.linspace(0.0, 0.08, 5) for name in ("E1", "E2", "G12")}
        sigma = noise.residual_sigma
        found.append(moduli_from(fit, point, posterior, FLAT_LAW, strains, [0], sigma))
    for name in ("E1", "E2"):
        assert found[0][name].sigma.max() < 0.02 and found[1][name].sigma.min() > 0.4


def flat(unknowns, model=MODEL):
    return clean_fit(model, FLAT_LAW, unknowns)


def evaluated(fit):
    return fit.evaluate(fit.unknowns.at(np.array([12.0, 250.0, 400.0])), True)


def test_what_the_data_never_reach_is_not_certain():
    ends = [0.13, 0.13, 0.6]
    form = form_named("spline", {"knots": 7}, ends)
    ranges = {"E1": (20.0, 2000.0), "E2": (20.0, 1000.0), "G12": (0.5, 200.0)}
    unknowns = Unknowns.of(form, 0.24, ends, LawBounds.of_moduli(ranges))
    law = HypoelasticLaw(np.repeat([12.0, 250.0, 400.0], 7), 0.24, ends, form=form)
    fit = replace(flat(CONSTANT), law=law, unknowns=unknowns)
    point = fit.evaluate(unknowns.at(law.beta), True)
    assert point.jacobian is not None and point.histories[0].strain_max[2] < 0.2
    sure = certainty(fit, point, law, np.array([0.05, 0.05, 0.5]))
    shear = sure.sigma["G12"]
    assert shear[0] < 1.0 and shear[-1] > 5.0
    assert not sure.moduli["G12"].determined[-1]
    assert any(words.startswith("G12 is not determined between") for words in sure.undetermined)


def test_bounds_are_touched_within_a_millionth_of_their_width():
    values = np.array([2.0 + 1e-6, 2.0 + 3e-6, 4.0 - 1e-6, 4.0 - 3e-6, 3.0])
    notes = notes_on_box("abcde", values, np.full(5, 2.0), np.full(5, 4.0))
    assert [str(note)[:19] for note in notes] == ["a lies on its lower", "c lies on its upper"]
    assert {note.kind for note in notes} == {BOUND}


INFORMATION_LAW = HypoelasticLaw.linear(300.0, 200.0, 10.0)
UNKNOWNS = Unknowns.of(
    INFORMATION_LAW.form, 0.24, [0.1] * 3,
    LawBounds.of_moduli({"E1": (1.0, 900.0), "E2": (1.0, 900.0), "G12": (0.1, 90.0)}),
)  # fmt: skip
Y = UNKNOWNS.at(INFORMATION_LAW.beta[list(UNKNOWNS.free)])


def test_nuisance_is_what_the_whole_covariance_says_it_is():
    random = np.random.default_rng(1)
    slopes, sigma = random.standard_normal((40, 5)), random.uniform(0.5, 2.0, 40)
    offsets = (Nuisance("a", -2.0, 2.0, "mm", prior=0.3), Nuisance("b", -1e-2, 1e-2, "kPa"))
    # The second may lie anywhere within ten times the width of its bounds.
    before = np.diag([0.0, 0.0, 0.0, 0.3**-2, 0.2**-2])
    rows = slopes / sigma[:, None]
    whole = np.linalg.inv(rows.T @ rows + before)
    left = information(slopes, sigma, offsets)
    np.testing.assert_allclose(np.linalg.inv(left), whole[:3, :3], rtol=1e-9)
    # And it is less than without nuisance.
    alone = information(slopes[:, :3], sigma)
    np.testing.assert_allclose(alone, rows[:, :3].T @ rows[:, :3], rtol=1e-12)
    assert (np.linalg.eigvalsh(alone - left) > 0).all()


def test_values_that_only_a_nuisance_explains_say_nothing():
    slopes = np.column_stack([np.ones(9), np.arange(9.0), np.ones(9)])
    left = information(slopes, 1.0, (Nuisance("offset", -1e6, 1e6, "mm"),))
    assert left[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert left[1, 1] == pytest.approx(60.0)


def test_information_on_a_product_determines_no_factor():
    """Each of G12, E2 and E1 is known to 1000 % before; E1 G12 and E2 are measured."""
    before = Posterior(UNKNOWNS, Y, Y, np.diag(PRIOR * Y) ** 2)
    slope = np.array([[1 / Y[0], 0.0, 1 / Y[2]]])
    known = information(slope, 1e-3) + np.diag([0.0, (0.01 * Y[1]) ** -2, 0.0])
    sigma = np.sqrt(np.diag(before.with_information(known).covariance)) / Y
    assert sigma == pytest.approx([10 / np.sqrt(2), 0.01, 10 / np.sqrt(2)], rel=1e-4)


SIDE, STEP = 40, 2.5
NODES = MODEL.mesh.points[:, :2]
PLACES = STEP * np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 2)


def noise(width, count, seed=3):
    """Fields that are alike over a Gaussian of `width` steps: 4 pi width^2 err as one."""
    fields = np.random.default_rng(seed).standard_normal((count, SIDE, SIDE))
    if width:
        fields = np.array([gaussian_filter(field, width, mode="wrap") for field in fields])
    return [field.reshape(-1) for field in fields]


def smooth(length):
    """A root of the correlation of neighbours, (places, places)."""
    distance = np.hypot(*(NODES[:, None] - NODES).T)
    return np.linalg.cholesky(np.exp(-((distance / length) ** 2)) + 1e-9 * np.eye(len(NODES)))


@pytest.mark.parametrize("width", [0.0, 0.7, 1.0, 1.5])
def test_smoothed_noise(width):
    fields = noise(width, 24)
    expected = max(1.0, 4 * np.pi * width**2)
    assert correlated_count(fields, [PLACES] * 24) == pytest.approx(expected, rel=0.15)


def test_blocks_count_alike_whatever_their_size():
    fields, places = noise(1.0, 12), [PLACES] * 12
    sizes = np.array([1.0, 100.0] * 6)
    scaled = [size * field for size, field in zip(sizes, fields, strict=True)]
    assert correlated_count(scaled, places) == pytest.approx(
        correlated_count(fields, places), rel=1e-12
    )
    # What changes its sign from point to point counts as independent; so does nothing at all.
    field = (-1.0) ** np.indices((SIDE, SIDE)).sum(axis=0).reshape(-1)
    assert correlated_count([field], [PLACES]) == correlated_count([], []) == 1.0
    assert correlated_count([np.zeros(5), np.ones(1)], [PLACES[:5], PLACES[:1]]) == 1.0


def test_a_fit_is_as_much_less_sure():
    random = np.random.default_rng(5)
    nodes, found = NODES, {}
    mixes = {"white": 0.2 * np.eye(len(nodes)), "shared": 0.2 * smooth(20.0), "smooth": None}
    for name, mix in mixes.items():
        fit = problem()
        objective = fit.comparisons[0].objective
        moved = [
            t.displacement
            + (0.03 if mix is None else mix @ random.standard_normal((len(nodes), 3)))
            for t in objective.targets
        ]
        objective.targets = tuple(
            replace(t, displacement=u, positions=nodes)
            for t, u in zip(objective.targets, moved, strict=True)
        )
        point = fit.evaluate(fit.unknowns.at(LAW.beta), True)
        found[name] = certainty(fit, point, LAW, np.full(3, 0.08))
        if name == "shared":
            count = correlated_count_of(objective, point.residual)
            assert count == found[name].noise.correlated_count["bubble"]
    # A smooth misfit of 0.03 mm, below 0.05 mm to reckon with, does not tell.
    assert found["smooth"].noise.correlated_count == {"bubble": 1.0}
    assert found["white"].noise.correlated_count["bubble"] == pytest.approx(1.0, abs=0.15)
    assert 3.0 < found["shared"].noise.correlated_count["bubble"] < 12.0
    for name in ("E1", "E2", "G12"):
        ratio = found["shared"].linear_sigma[name] / found["white"].linear_sigma[name]
        noise_ratio = found["shared"].noise.level["bubble"] / found["white"].noise.level["bubble"]
        shared, white = (found[mix].noise.correlated_count["bubble"] for mix in ("shared", "white"))
        many = shared / white
        # Noise that is shared leaves blocks of other norms, and so of other weights.
        assert ratio == pytest.approx(noise_ratio * np.sqrt(many), rel=0.15)


def test_along_a_curve():
    """Of readings that follow each other by 0.6, (1 + 0.6) / (1 - 0.6) = 4 err as one."""
    random = np.random.default_rng(2)
    places = np.arange(2000.0)[:, None]
    white = random.standard_normal((6, 2000))
    follow = np.zeros_like(white)
    for k in range(1, 2000):
        follow[:, k] = 0.6 * follow[:, k - 1] + white[:, k]
    fine = places[:60]
    pieces = [piece for one in follow for piece in np.split(one[:1980], 33)]
    assert correlated_count(pieces, [fine] * len(pieces)) == pytest.approx(4.0, rel=0.15)
    for count in (10, 100):
        found = [
            correlated_count([random.standard_normal(count)], [places[:count]]) for _ in range(60)
        ]
        assert np.median(found) == 1.0 and np.mean(found) < 1.15


NOISE = 0.05


def fit_of_fields(given):
    fields = zip(MODEL.pressures, reference().displacement, strict=True)
    data = [FieldTarget(p, u, positions=NODES) for p, u in fields]
    objective = FieldObjective(data, "e", noise=given)
    return single(MODEL, MembraneSolver(), LAW, objective, CONSTANT)


@pytest.mark.parametrize("length", [1e-3, 15.0])
def test_noise_as_it_is_given_is_seldom_told(length):
    root, told = smooth(length), {0.5: 0, 1.0: 0, 2.0: 0}
    problem, random = fit_of_fields(NOISE), np.random.default_rng(3)
    fields, count = len(MODEL.pressures), 30
    for _ in range(count):
        noise = np.concatenate(
            [(root @ random.standard_normal((len(root), 3))).T.ravel() for _ in range(fields)]
        )
        for times in told:
            tests = noise_tests(problem, NOISE * times * noise / problem.scale)
            kinds = [note.kind for note in notes_of_noise(tests)]
            expected = {0.5: [BELOW_NOISE], 2.0: [ABOVE_NOISE]}
            told[times] += kinds == expected.get(times, kinds) and bool(kinds)
    assert told[1.0] <= 2
    assert told[0.5] == told[2.0] == count


def test_what_is_counted():
    fit = fit_of_fields(NOISE)
    residual = np.random.default_rng(5).standard_normal(len(fit.scale)) * NOISE / fit.scale
    (test,) = noise_tests(fit, residual).values()
    assert test.values == len(residual)
    assert test.degrees_of_freedom == pytest.approx(test.independent - 3)
    assert test.chi_square == pytest.approx(test.independent * test.misfit.ratio**2)
    assert test.probability_of_more + test.probability_of_less == pytest.approx(1.0)
    # Nobody gave it: nothing is tested.
    assert noise_tests(fit_of_fields(None), residual) == {}


def test_what_is_told():
    above = NoiseTest(Misfit(4.54, 3.0, "given", "N"), 300, 30.0, 29.0)
    below = NoiseTest(Misfit(1.5, 3.0, "given", "N"), 300, 30.0, 29.0)
    few = NoiseTest(Misfit(4.54, 3.0, "given", "N"), 300, 3.0, 2.0)
    # However many values say it: a twentieth is no matter.
    little = NoiseTest(Misfit(3.15, 3.0, "given", "N"), 10**6, 1e6, 1e6)
    assert little.probability_of_more < SIGNIFICANCE
    notes = notes_of_noise({"warp": above, "fill": below, "bias": few, "other": little})
    assert [(n.kind, n.of) for n in notes] == [
        (ABOVE_NOISE, "warp"), (BELOW_NOISE, "fill"),
    ]  # fmt: skip
    assert "4.54 N RMS, 1.51 times the noise given (3 N; 300 values count as 30 " in notes[0]
    assert above.numbers["probability_of_more"] == above.probability_of_more
    assert above.probability_of_more < SIGNIFICANCE < few.probability_of_more
    assert Misfit(1.0, 0.0, "assumed", "mm").ratio == np.inf
