"""Fits to strips of a fabric of constant moduli, in which nearly every number is a closed form."""

from __future__ import annotations

import bubblefit as bf
import pytest

from ..projects import constant_strips


@pytest.fixture(scope="session")
def strips_project(tmp_path_factory: pytest.TempPathFactory) -> bf.Project:
    """See `projects.constant_strips`."""
    return bf.read_project(constant_strips(tmp_path_factory.mktemp("strips")))


@pytest.fixture(scope="session")
def together(strips_project: bf.Project) -> bf.Fit:
    """Both tests, two starts."""
    return bf.fit(strips_project, jobs=1)


@pytest.fixture(scope="session")
def alone(strips_project: bf.Project) -> bf.Fit:
    """The second test."""
    return bf.fit(strips_project, tests=["two"], starts=1, jobs=1)
