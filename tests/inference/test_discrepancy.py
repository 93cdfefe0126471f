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
)

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
    strips = describe(Discrepancy(30.0, 9.0, 5.0, "N", specimen_count=5, relative_rms=0.02))
    assert "alike in all 5 specimens (Hotelling's F is 30" in strips
    assert "bubblefit compare" in strips and "[bubble.sheet]" not in strips
    weak = describe(Discrepancy(3.0, 1.5, 0.05, "mm", causes=(Cause("c", 0.3),)))
    assert "known causes explain at most 30 %" in weak
