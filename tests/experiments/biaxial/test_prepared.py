"""experiments/biaxial/prepared.py: residuals and doubts of biaxial paths, and ratios proposed."""

import bubblefit as bf
import numpy as np
import pytest
import scipy
from bubblefit.experiments.base import Planning, Precision, Weighting
from bubblefit.experiments.biaxial.prepared import PreparedBiaxial, candidates
from bubblefit.experiments.doubts import Expected
from bubblefit.inference.linear import LinearisedFit
from bubblefit.inference.noise import Noise
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import elongations

from ...builders.biaxial_tests import (
    BENT_LAW,
    FIVE_RATIOS,
    THICKNESS,
    biaxial_project,
    biaxial_rows,
    write_biaxial_rows,
)
from ...builders.projects import fit_setup

CONSTANT_LAW = HypoelasticLaw.linear(900.0, 600.0, 30.0)


def test_errors_at_a_fitted_share_of_the_load_are_those_of_the_residuals(tmp_path):
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(BENT_LAW, ["2:1"]))
    test = "load_share = 0.9\nload_share_deviation = 0.05"
    setup = fit_setup(biaxial_project(tmp_path, test, "constant"))
    (comparison,) = setup.tests[0].comparisons(setup.make_solver, Weighting())
    history = comparison.run(CONSTANT_LAW, tuple(range(12)), {}, False)
    objective = comparison.objective
    name, start = objective.load_share
    errors = []
    for share in (0.9, 0.8):
        fitted = objective.at({name: share})
        residual = objective.residual(history, {name: share}) * objective.scale
        np.testing.assert_allclose(
            fitted.rms(history), np.sqrt(np.mean(residual.reshape(2, -1) ** 2, axis=1))
        )
        difference = 100 * (fitted.modelled(history) - objective.strain)[1:]
        np.testing.assert_allclose(difference.T.ravel(), residual)
        errors.append(residual)
    column = objective.nuisance_columns([name], {name: start}, history)[:, 0] * objective.scale
    np.testing.assert_allclose(errors[1] - errors[0], -0.1 * column, rtol=1e-9)


def test_strains_change_with_the_share_of_the_load_by_the_slope_of_their_curve(tmp_path):
    """Strains of n / 20 + (n / 20)^4 %, of loads n in kN/m."""
    loads = np.linspace(1.0, 30.0, 30)
    strain = loads / 20.0 + (loads / 20.0) ** 4
    rows = [("1:1", n, n, e, e) for n, e in zip(loads, strain, strict=True)]
    write_biaxial_rows(tmp_path / "test.csv", rows)
    test = "load_share = 0.9\nload_share_deviation = 0.05"
    setup = fit_setup(biaxial_project(tmp_path, test, "constant"))
    (comparison,) = setup.tests[0].comparisons(setup.make_solver, Weighting())
    objective = comparison.objective
    name, start = objective.load_share
    column = objective.nuisance_columns([name], {name: start}, None)[:, 0] * objective.scale
    slope = loads / 20.0 + 4.0 * (loads / 20.0) ** 4
    expected = (slope - slope[0])[1:] / 0.9
    np.testing.assert_allclose(column, np.tile(expected, 2), rtol=1e-9)


def test_biaxial_residuals_and_derivatives(five_ratios_folder):
    setup = fit_setup(five_ratios_folder / "project.toml")
    (prepared,) = setup.tests
    comparisons = prepared.comparisons(setup.make_solver, Weighting())
    assert [c.name for c in comparisons] == [f"biaxial: {ratio}" for ratio in FIVE_RATIOS]
    law = BENT_LAW.with_beta(1.1 * BENT_LAW.beta)
    free = tuple(range(12))
    for comparison in comparisons:
        objective = comparison.objective
        history, jacobian = comparison.differentiate(law, free, {}, warm=False)
        residual = objective.residual(history, {})
        own = elongations(history.displacement)
        off = (own - own[0] - objective.strain)[1:]
        np.testing.assert_allclose(residual * objective.scale, 100 * off.T.ravel(), atol=1e-12)
        rms, largest = np.sqrt(np.mean(off[:, 0] ** 2)), np.abs(objective.strain).max()
        assert np.linalg.norm(residual[: objective.sizes[0]]) == pytest.approx(rms / largest)
        for place in (7, 11):
            step = 1e-4 * np.eye(12)[place]
            laws = [law.with_beta(law.beta + s) for s in (step, -step)]
            up, down = (objective.residual(comparison.run(x, free, {}, False), {}) for x in laws)
            slope = (up - down) / 2e-4
            least = 1e-6 * np.abs(jacobian[:, [7, 11]]).max()
            np.testing.assert_allclose(jacobian[:, place], slope, rtol=1e-5, atol=least)
        larger = np.linspace(2, 30, 30)[1:, None]
        assert [len(at) for at in objective.positions] == list(objective.sizes)
        np.testing.assert_allclose(objective.positions[1], larger)
        # Weights of one test among others add up to that of the test.
    weighted, own = prepared.comparisons(setup.make_solver, Weighting(True, 3.0)), comparisons[0]
    history, other = (own.run(one, free, {}, False) for one in (law, BENT_LAW))
    residual = own.objective.residual(history, {})
    ratio = weighted[0].objective.residual(history, {}) / residual
    np.testing.assert_allclose(ratio, 3.0 / 10)
    shifted = own.objective.shifted(history, other)
    np.testing.assert_allclose(shifted.residual(other, {}), residual, atol=1e-12)


@pytest.mark.parametrize(("deviation", "lower", "upper"), [(0.05, 0.6, 1.0), (0.25, 0.08, 1.52)])
def test_share_of_loads_is_bounded_by_four_deviations_and_above_zero(
    tmp_path, deviation, lower, upper
):
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(BENT_LAW, ["1:1"]))
    keys = f"load_share = 0.8\nload_share_deviation = {deviation}"
    setup = fit_setup(biaxial_project(tmp_path, keys))
    (comparison,) = setup.tests[0].comparisons(setup.make_solver, Weighting())
    (share,) = comparison.nuisance
    assert (share.lower, share.start, share.upper) == pytest.approx((lower, 0.8, upper))
    history = comparison.run(BENT_LAW, (), {}, warm=False)
    plain = comparison.objective.residual(history)
    np.testing.assert_array_equal(comparison.objective.residual(history, {share.name: 0.8}), plain)
    assert np.abs(comparison.objective.residual(history, {share.name: 0.7}) - plain).max() > 0


def test_share_of_loads_that_is_known_adds_no_residual(tmp_path):
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(BENT_LAW, ["1:1"]))
    setup = fit_setup(biaxial_project(tmp_path, "load_share = 0.8"))
    (comparison,) = setup.tests[0].comparisons(setup.make_solver, Weighting())
    assert comparison.nuisance == ()
    history = comparison.run(BENT_LAW, (), {}, warm=False)
    plain, beside = (comparison.objective.residual(history, n) for n in (None, {"compliance": 1.0}))
    np.testing.assert_array_equal(beside, plain)


@pytest.mark.parametrize(
    ("line", "noise", "how"), [("noise = 0.03", 0.03, "given"), ("", 0.01, "assumed")]
)
def test_noise_of_a_biaxial_test_is_that_of_its_section(tmp_path, line, noise, how):
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(BENT_LAW, ["1:1"]))
    (prepared,) = fit_setup(biaxial_project(tmp_path, line)).tests
    (comparison,) = prepared.comparisons(lambda *a: None, Weighting())
    assert comparison.objective.least_noise == pytest.approx(noise)
    assert comparison.objective.noise_is == how and comparison.objective.unit == "%"


def test_bands_hold_the_noise_of_the_rows_from_which_strains_count(tmp_path):
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(CONSTANT_LAW, ["1:1", "2:1", "1:2"]))
    problem = fit_setup(biaxial_project(tmp_path, "noise = 0.03", form="constant")).problem()
    truth = problem.unknowns.at([CONSTANT_LAW.beta[row] for row in (3, 7, 11)])
    best = problem.evaluate(truth, True)
    no_noise = np.zeros_like(best.residual)
    noise = Noise.from_residual(problem, no_noise).with_shared_errors(problem, best, no_noise)
    fitted = LinearisedFit.of(problem, best, noise)
    covariance = fitted.noise_response @ fitted.noise_response.T
    random = np.random.default_rng(0)
    draws = 400
    estimates = np.zeros((draws, problem.unknowns.count))
    for comparison, number in zip(problem.comparisons, range(3), strict=True):
        objective = comparison.objective
        rows = problem.rows(number)
        weights = fitted.weights[rows, None] * np.ones(draws)
        strains = 3e-4 * random.standard_normal((*objective.strain.shape, draws))
        residuals = objective.in_blocks(strains - strains[0])
        estimates += (fitted.inverse @ (fitted.jacobian[rows].T @ (weights * residuals))).T
    yarns = slice(1, 3)  # the shear modulus is open
    chi_square = np.sum(
        estimates[:, yarns].T * np.linalg.solve(covariance[yarns, yarns], estimates[:, yarns].T)
    )
    # Sums of squares of independent errors scatter as chi-square does: 1 in 100 lies outside.
    low, high = scipy.stats.chi2.ppf([0.005, 0.995], 2 * draws)
    assert low < chi_square < high


def test_rows_of_a_table_are_used_thinned_or_of_no_loading(tmp_path):
    """Load 30 rows of each of two ratios, and unload 15."""
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(BENT_LAW, ["1:1", "2:1"]))
    (test,) = bf.read_project(biaxial_project(tmp_path, "points = 10")).tests.values()
    (file,) = PreparedBiaxial(test).data_files()
    assert file.used_count == 20 and file.dropped == {
        "not of an evaluated loading": 30,
        "thinned to at most 10 of a ratio": 40,
    }


EXPECTED = Expected({"E1": (300.0, 3000.0), "E2": (200.0, 3000.0), "G12": (1.0, 300.0)})
ROWS = biaxial_rows(BENT_LAW)


def scaled(load=1.0, strain=1.0):
    return [(r, load * a, load * b, strain * c, strain * d) for r, a, b, c, d in ROWS]


#: Rows, and of each trap that they fall into whether it stops a fit and a word of it.
TRAPS = {
    "shares for percent": (scaled(strain=0.01), {"strain-unit": (True, "in the unit")}),
    "percent times a hundred": (scaled(strain=100), {"strain-unit": (True, "changes by")}),
    "newtons a metre": (scaled(load=1e3), {"load-unit": (True, "per width")}),
    "loads of a fiftieth": (scaled(load=0.02), {"modulus": (True, "is the thickness right")}),
    "yarns of the loads swapped": (
        [(r, b, a, c, d) for r, a, b, c, d in ROWS], {"ratio": (True, "columns")},
    ),
    "another ratio": (
        [("3:1" if r == "2:1" else r, *rest) for r, *rest in ROWS],
        {"ratio": (False, "which is 2:1")},
    ),
    "yarns of the strains swapped": (
        [(r, a, b, d, c) for r, a, b, c, d in ROWS], {"swapped": (True, "stretches more")},
    ),
}  # fmt: skip


def listed_doubts(folder, rows, expected=EXPECTED):
    write_biaxial_rows(folder / "test.csv", rows)
    (test,) = bf.read_project(biaxial_project(folder)).tests.values()
    return PreparedBiaxial(test).doubts(expected)


def doubts_of_table(folder, rows):
    return {doubt.name: doubt for doubt in listed_doubts(folder, rows)}


@pytest.mark.parametrize("trap", TRAPS)
def test_mistakes_in_a_biaxial_table_are_doubted(tmp_path, trap):
    rows, wanted = TRAPS[trap]
    found = doubts_of_table(tmp_path, rows)
    for name, (sure, words) in wanted.items():
        assert found[name].sure == sure and words in found[name].text, found
    if trap == "loads of a fiftieth":
        (_, first, _, low, _), (_, last, _, high, _) = rows[0], rows[29]
        modulus = (last - first) / (0.01 * (high - low)) / THICKNESS
        assert f"is about {modulus:.3g} MPa" in found["modulus"].text
    if trap in ("another ratio", "yarns of the strains swapped"):
        assert set(found) == set(wanted)


#: The bounds of `EXPECTED` do not say which yarn is stiffer, these do.
STIFF_WARP = Expected({"E1": (500.0, 3000.0), "E2": (200.0, 1500.0), "G12": (1.0, 300.0)})


@pytest.mark.parametrize(
    ("ratios", "words"),
    [
        (["1:1"], "in 1:1 the warp is strained 1.5 times as much as the fill is by the same load"),
        (["2:1", "1:2"], "in 2:1 the warp is strained 1.5 times"),
        (["0:1", "1:0"], "by the same load in 0:1, and the bounds have the warp stiffer"),
        (["2:1", "0:1"], None),
    ],
)
def test_warp_that_is_softer_than_the_fill_is_doubted_by_the_bounds(tmp_path, ratios, words):
    """Compare equal loads; strains are small, so that their quotient is that of the moduli."""
    law = HypoelasticLaw.linear(600.0, 900.0, 30.0, 0.0)
    rows = biaxial_rows(law, ratios, lowest=0.1, highest=0.9)
    found = listed_doubts(tmp_path, rows, STIFF_WARP)
    expected = [("swapped", False)] if words else []
    assert [(doubt.name, doubt.sure) for doubt in found] == expected
    assert all(words in doubt.text for doubt in found), found
    assert listed_doubts(tmp_path, rows) == []


def test_swapped_yarns_are_doubted_once(tmp_path):
    rows, _ = TRAPS["yarns of the strains swapped"]
    (doubt,) = listed_doubts(tmp_path, rows, STIFF_WARP)
    assert doubt.name == "swapped" and doubt.sure


def test_modulus_is_that_of_the_first_path_that_stretches(tmp_path):
    rows = [(r, 0.02 * a, 0.02 * b, c * (-1 if r == "1:1" else 1), d) for r, a, b, c, d in ROWS]
    assert doubts_of_table(tmp_path, rows)["modulus"].text.startswith("ratio 2:1: load over")


def test_good_biaxial_data_raise_no_doubt(tmp_path):
    assert doubts_of_table(tmp_path, ROWS) == {}
    noise = 0.005 * np.random.default_rng(3).standard_normal((len(ROWS), 4))
    rows = [(r, *(np.array(rest) + n)) for (r, *rest), n in zip(ROWS, noise, strict=True)]
    assert doubts_of_table(tmp_path, rows) == {}


TRUE = HypoelasticLaw.linear(900.0, 600.0, 30.0, 0.24)


def planning_of(tmp_path, noise=None, own=True) -> Planning:
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(TRUE, ["1:1", "2:1"]))
    setup = fit_setup(biaxial_project(tmp_path, form="constant"))
    (prepared,) = setup.tests
    law = HypoelasticLaw(TRUE.beta, 0.24, [0.03, 0.04, 0.1], form=TRUE.form)
    precision = {"biaxial: 1:1": Precision(0.02, 2.0, 29), "biaxial: 2:1": Precision(0.03, 4.0, 29)}
    tests = [prepared] if own else []
    place = prepared.test.place
    return Planning(place, tests, precision if own else {}, law, setup.make_solver, noise)


def test_candidate_ratios_reach_to_the_strains_of_the_law(tmp_path):
    offered = candidates(planning_of(tmp_path))
    assert [c.name for c in offered] == [
        f"biaxial {r}" for r in ("1:1", "2:1", "1:2", "1:0", "0:1", "1:5", "5:1")
    ]
    assert {c.noise_is for c in offered} == {"that of biaxial"}
    for candidate in offered:
        (path,) = candidate.make().test.paths
        share = np.log1p(path.strain[-1]) / [0.03, 0.04]
        assert share.max() == pytest.approx(1.0, rel=1e-6) and len(path.load) == 20
        wanted = biaxial_response(TRUE, path.load, THICKNESS).elongation
        np.testing.assert_allclose(path.strain, wanted, rtol=1e-12)
        np.testing.assert_allclose(path.load[0], 0.05 * path.load[-1])


def test_noise_of_a_candidate_ratio_is_measured_given_or_assumed(tmp_path):
    def noise(**options):
        candidate = candidates(planning_of(tmp_path, **options))[0]
        (one,) = candidate.make().comparisons(lambda *a: None, Weighting())
        return candidate.noise_is, one.objective.least_noise

    # The worse of both ratios, of which four neighbours err as one.
    own, known = noise()
    assert own == "that of biaxial" and known == pytest.approx(0.03 * np.sqrt(4.0 * 19 / 29))
    assert noise(noise=0.05) == ("given", pytest.approx(0.05))
    assert noise(own=False) == ("assumed", pytest.approx(0.01 * np.sqrt(19 / 5)))
