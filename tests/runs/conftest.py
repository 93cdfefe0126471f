"""The fit of `bubble`, and the example with a known solution, set up for a fit."""

import pytest
from bubblefit.project.project import read_project

from ..builders.projects import constant_strips, fit_setup
from ..support.paths import KNOWN


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return read_project(constant_strips(tmp_path_factory.mktemp("strips"))).with_fit(jobs=1)


@pytest.fixture(scope="module")
def known():
    return fit_setup(KNOWN)


@pytest.fixture(scope="module")
def fitted(bubble):
    return bubble.fit
