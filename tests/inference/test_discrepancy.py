"""inference/discrepancy.py: causes of a discrepancy ranked, and when it matters."""

import numpy as np
import pytest
from bubblefit.inference.discrepancy import (
    DISCREPANCY,
    LIKELY_CAUSE,
    Cause,
    Discrepancy,
    describe,
    notes_of_discrepancies,
    orthogonal_part,
    ranked_causes,
    sheet_discrepancy,
    smooth_shapes,
    specimen_discrepancy,
)
from scipy.ndimage import gaussian_filter
from scipy.stats import ttest_1samp

RANDOM = np.random.default_rng(4)
SLOPES = RANDOM.standard_normal((50, 3))
OFFSET = RANDOM.standard_normal((50, 1))
SHAPES = RANDOM.standard_normal((50, 2))


def test_orthogonal_part_has_nothing_of_the_basis():
    basis, _ = np.linalg.qr(SLOPES)
    left = orthogonal_part(SHAPES, basis)
    np.testing.assert_allclose(basis.T @ left, 0.0, atol=1e-12)
    np.testing.assert_allclose(orthogonal_part(left, basis), left)


def test_cause_of_the_residual_is_first_with_its_amount():
    residual = -(2.5 * OFFSET[:, 0]) + SLOPES @ [1.0, -2.0, 0.5]
    first, second = ranked_causes(
        residual,
        SLOPES,
        {"two shapes, {:.2g} and {:.2g}": SHAPES, "an offset of {:.3g} mm": OFFSET},
    )
    assert first.description == "an offset of 2.5 mm"
    assert first.explained_share == pytest.approx(1.0)
    assert second.explained_share < 0.5


def test_cause_that_the_unknowns_can_follow_explains_nothing():
    causes = {"a change of the law by {:.2g}": SLOPES[:, :1]}
    assert ranked_causes(RANDOM.standard_normal(50), SLOPES, causes) == ()
    assert ranked_causes(SLOPES @ np.ones(3), SLOPES, {"offset {:.2g}": OFFSET}) != ()
    assert ranked_causes(np.zeros(50), SLOPES, {"offset {:.2g}": OFFSET}) == ()


def test_change_of_moduli_is_that_of_the_step_that_takes_up_the_cause():
    steps = []
    residual = -OFFSET[:, 0]

    def modulus_change(step):
        steps.append(step)
        return float(np.abs(step).max())

    (cause,) = ranked_causes(residual, SLOPES, {"offset {:.2g}": OFFSET}, modulus_change)
    expected = -np.linalg.lstsq(SLOPES, OFFSET[:, 0], rcond=None)[0]
    np.testing.assert_allclose(steps[0], expected)
    assert cause.modulus_change == pytest.approx(np.abs(expected).max())


@pytest.mark.parametrize(
    ("changes", "is_systematic", "is_significant"),
    [
        ({}, True, True),
        ({"f_ratio": 1.0}, False, False),
        ({"noise_of_mean": 0.1}, False, False),
        ({"relative_rms": 0.0019}, True, False),
        ({"relative_rms": 0.0021}, True, True),
        ({"relative_rms": 0.009, "specimen_count": 5}, True, False),
        ({"relative_rms": 0.011, "specimen_count": 5}, True, True),
        ({"relative_rms": 0.0, "causes": (Cause("c", 0.6, 0.03),)}, True, True),
        ({"relative_rms": 0.0, "causes": (Cause("c", 0.4, 0.03),)}, True, False),
        ({"relative_rms": 0.0, "causes": (Cause("c", 0.6, 0.01),)}, True, False),
    ],
)
def test_discrepancy_matters_if_it_is_no_noise_and_large(changes, is_systematic, is_significant):
    given = {"f_ratio": 3.0, "critical_ratio": 1.5, "rms": 0.05, "unit": "mm"} | changes
    found = Discrepancy(**given)
    assert (found.is_systematic, found.is_significant) == (is_systematic, is_significant)
    notes = notes_of_discrepancies({"bubble": found})
    kind = LIKELY_CAUSE if found.likely_causes else DISCREPANCY
    assert [(note.kind, note.of) for note in notes] == [(kind, "bubble")] * is_significant
    assert found.numbers["told"] == is_significant


def test_at_most_two_causes_are_named_with_their_share():
    causes = tuple(Cause(f"cause {k}", 0.9 - 0.1 * k, 0.05) for k in range(4))
    words = describe(Discrepancy(3.0, 1.5, 0.05, "mm", relative_rms=0.01, causes=causes))
    assert "cause 0 (90 % of it explained; moduli would change by up to 5 %)" in words
    assert "cause 1" in words and "cause 2" not in words
    assert "wrong" not in words and "wrong" not in LIKELY_CAUSE.objection.reason


def test_discrepancy_without_a_cause_asks_for_another_form():
    sheet = describe(Discrepancy(3.0, 1.5, 0.05, "mm", relative_rms=0.01))
    assert "smooth over the whole sheet (3 times" in sheet and "[bubble.sheet]" in sheet
    deck = describe(Discrepancy(3.0, 1.5, 0.05, "mm", relative_rms=0.01), has_law=False)
    assert deck.endswith(
        "the model is wrong, and the parameters are off by more than their bands say"
    )
    strips = describe(Discrepancy(30.0, 9.0, 5.0, "N", specimen_count=5, relative_rms=0.02))
    assert "alike in all 5 specimens (Hotelling's F is 30" in strips
    assert "bubblefit compare" in strips and "[bubble.sheet]" not in strips
    weak = describe(Discrepancy(3.0, 1.5, 0.05, "mm", causes=(Cause("c", 0.3),)))
    assert "known causes explain at most 30 %" in weak


SIDE, BLOCKS = 32, 9
PLACES = 4.0 * np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 2)
SMOOTH_SHAPES = smooth_shapes(PLACES)
NO_DOUBT = [np.zeros(SIDE**2)] * BLOCKS


def smooth_noise(random, width, size=0.02):
    fields = random.standard_normal((BLOCKS, SIDE, SIDE))
    if width:
        fields = np.array([gaussian_filter(one, width, mode="wrap") for one in fields])
    return [size * one.reshape(-1) / one.std() for one in fields]


def judged(blocks, doubts=NO_DOUBT, unknowns=3):
    found = sheet_discrepancy(blocks, doubts, [PLACES] * BLOCKS, unknowns, "mm")
    assert found is not None
    return found


@pytest.mark.parametrize("width", [0.0, 0.7])
def test_sheet_discrepancy_rejects_pure_noise_once_in_a_hundred(width):
    random = np.random.default_rng(4)
    told = 0
    for _ in range(50):
        blocks = smooth_noise(random, width)
        for k in range(3):
            blocks[k] = blocks[k] - SMOOTH_SHAPES[:, k] * (SMOOTH_SHAPES[:, k] @ blocks[k])
        told += judged(blocks).is_significant
    assert told <= 3  # more in one of 600 such tests, if one of a hundred is told


def test_smooth_field_below_the_noise_is_a_sheet_discrepancy():
    """0.005 mm of one shape in every block, beside noise of 0.02 mm."""
    random, shape = np.random.default_rng(6), 0.005 * SMOOTH_SHAPES[:, 7] * SIDE
    told = [judged([b + shape for b in smooth_noise(random, 0.0)]) for _ in range(6)]
    assert all(one.is_significant for one in told)
    assert np.mean([one.rms for one in told]) == pytest.approx(0.005, rel=0.2)
    # What the mesh may be answerable for is none.
    found = judged([b + shape for b in smooth_noise(random, 0.0)], [shape] * BLOCKS)
    assert not found.is_significant and found.rms < 0.003


def test_sheet_discrepancy_does_not_depend_on_sizes_of_blocks():
    blocks = smooth_noise(np.random.default_rng(1), 0.7)
    scaled = [k * block for k, block in enumerate(blocks, start=1)]
    assert judged(scaled).f_ratio == pytest.approx(judged(blocks).f_ratio, rel=1e-12)


def test_sheet_with_too_few_values_has_no_discrepancy():
    for few, places, unknowns in (
        (np.arange(20.0), PLACES[:20], 3),
        (np.zeros(SIDE**2), PLACES, 3),
        (smooth_noise(np.random.default_rng(0), 0.0)[0], PLACES, 15),
    ):
        assert sheet_discrepancy([few], [np.zeros(len(few))], [places], unknowns, "mm") is None


def test_note_of_a_discrepancy_needs_relevance():
    found = {
        "bubble": Discrepancy(22.6, 1.25, 0.036, "mm"),
        "other": Discrepancy(1.2, 1.25, 0.001, "mm"),
        "computed": Discrepancy(61.8, 1.66, 2e-8, "mm", noise_of_mean=4e-4),
    }
    (note,) = notes_of_discrepancies(found)
    assert (note.kind, note.of) == (DISCREPANCY, "bubble")
    assert "0.036 mm " in note and "22.6 times" in note and "1.25 in " in note


def test_smooth_shapes_are_orthonormal_and_contain_quartics():
    assert SMOOTH_SHAPES.T @ SMOOTH_SHAPES == pytest.approx(np.eye(45), abs=1e-12)
    x, y = PLACES.T
    quartic = x**3 * y - 2 * y**4 + x
    inside = SMOOTH_SHAPES[:, :15] @ (SMOOTH_SHAPES[:, :15].T @ quartic)
    assert inside == pytest.approx(quartic, rel=1e-9, abs=1e-5)


CURVE_PLACES = np.linspace(0.1, 3.0, 30)
#: Of a law whose modulus is a constant: the load is proportional.
SPECIMEN_SLOPES = 100.0 * CURVE_PLACES[:, None] @ np.array([[1.0, 0.0, 0.0]])


def scattered(count, random):
    """(count, n) N: stiffer by a factor each, uneven over half of the curve, and noise."""
    distance = np.abs(CURVE_PLACES[:, None] - CURVE_PLACES)
    root = np.linalg.cholesky(np.exp(-((distance / 1.5) ** 2)) + 1e-6 * np.eye(len(CURVE_PLACES)))
    factor = 20.0 * CURVE_PLACES * random.standard_normal((count, 1))
    uneven = 15.0 * random.standard_normal((count, len(CURVE_PLACES))) @ root.T
    return factor + uneven + random.standard_normal((count, len(CURVE_PLACES)))


def discrepancy_of(residuals, places=None):
    own = places or [CURVE_PLACES] * len(residuals)
    return specimen_discrepancy(list(residuals), own, [SPECIMEN_SLOPES[: len(p)] for p in own], "N")


@pytest.mark.parametrize("specimens", [3, 5, 10])
def test_scatter_between_specimens_is_seldom_a_discrepancy(specimens):
    random, told = np.random.default_rng(specimens), 0
    sets = 400
    for _ in range(sets):
        off = scattered(specimens, random)
        off -= (
            off @ SPECIMEN_SLOPES[:, :1] / (SPECIMEN_SLOPES[:, 0] @ SPECIMEN_SLOPES[:, 0])
        ).mean() * SPECIMEN_SLOPES[:, 0]
        one = discrepancy_of(off)
        assert one is not None and one.specimen_count == specimens
        told += one.is_significant
    assert told / sets <= 0.03


def test_f_ratio_of_three_specimens_is_square_of_students_t():
    """Beside the slope there is one shape to be tested, the load at no elongation."""
    off = scattered(3, np.random.default_rng(4))
    one, starts = discrepancy_of(off), [np.polyfit(CURVE_PLACES, own, 1)[1] for own in off]
    assert one.f_ratio == pytest.approx(ttest_1samp(starts, 0.0).statistic ** 2, rel=1e-9)
    assert one.critical_ratio == pytest.approx(98.50, abs=0.01)


def test_wrong_form_is_a_significant_discrepancy_of_specimens():
    random = np.random.default_rng(8)
    bend = 60.0 * ((CURVE_PLACES / 1.5 - 1.0) ** 2 - 0.4)
    assert (
        sum([discrepancy_of(bend + scattered(5, random)).is_significant for _ in range(100)]) > 70
    )
    ten = [discrepancy_of(bend + scattered(10, random)) for _ in range(50)]
    assert all(one.is_significant for one in ten)
    # Without what another modulus would follow.
    beside = bend - SPECIMEN_SLOPES[:, 0] * (bend @ SPECIMEN_SLOPES[:, 0]) / (
        SPECIMEN_SLOPES[:, 0] @ SPECIMEN_SLOPES[:, 0]
    )
    expected = float(np.sqrt(np.mean(beside**2)))
    assert np.mean([one.rms for one in ten]) == pytest.approx(expected, rel=0.1)
    (note,) = notes_of_discrepancies({"strips: warp": ten[0]})
    assert (note.kind, note.of) == (DISCREPANCY, "strips: warp")
    assert f"{ten[0].rms:.2g} N " in note and "all 10 specimens" in note


def test_misfit_that_the_law_can_follow_is_no_discrepancy():
    """All specimens stiffer alike: another modulus, not another form."""
    random = np.random.default_rng(9)
    for _ in range(20):
        off = scattered(5, random)
        before, after = discrepancy_of(off), discrepancy_of(400.0 * CURVE_PLACES + off)
        assert after.f_ratio == pytest.approx(before.f_ratio, rel=1e-6)
    # Two of four broke early: their curves say too little of the whole.
    places = [CURVE_PLACES, CURVE_PLACES, CURVE_PLACES[:15], CURVE_PLACES[:15]]
    assert (
        discrepancy_of([own[: len(at)] for own, at in zip(off, places, strict=False)], places)
        is None
    )
    # Specimens that do not differ leave nothing to test against, nor do two, nor single points.
    assert discrepancy_of(off[:2]) is None and discrepancy_of(np.tile(off[:1], (5, 1))) is None
    assert (
        specimen_discrepancy([np.ones(1)] * 5, [np.ones(1)] * 5, [np.ones((1, 1))] * 5, "N") is None
    )
