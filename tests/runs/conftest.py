"""The fit of `bubble`, and the example with a known solution, set up for a fit."""

import pytest

from ..builders.projects import fit_setup
from ..support.paths import KNOWN


@pytest.fixture(scope="module")
def known():
    return fit_setup(KNOWN)


@pytest.fixture(scope="module")
def fitted(bubble):
    return bubble.fit
