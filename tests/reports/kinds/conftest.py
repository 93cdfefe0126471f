"""Runs of cylinders with a band between two walls."""

from dataclasses import replace

import pytest
from bubblefit.experiments.cylinder.predicted import CylinderOutcome

from ...builders.bending_results import BENT, CURVE, LOAD, case, outcome_of, run
from ...builders.bent_cylinders import ENDS


# A band: both ends with one card, the prediction alone with another, whose other end failed
@pytest.fixture
def banded() -> CylinderOutcome:
    test, (slack, rigid) = case("150/90", measured=(CURVE, CURVE)), ENDS
    return outcome_of(
        run(test, "soft", slack), run(test, "soft", rigid),
        run(test, "hard", slack), run(test, "hard", rigid, failure="killed"),
        bent={0: BENT, 1: replace(BENT, load=1.5 * LOAD), 2: BENT},
    )  # fmt: skip
