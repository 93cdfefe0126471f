"""Data of the very model that is fitted are called so, and other data are not."""

from __future__ import annotations

from pathlib import Path

import pytest
from bubblefit.project.project import read_project
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers import registry
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...projects import small

KNOWN = "[bubble.data.known_solution]\n"


class Other(MembraneSolver):
    name = identity = "other"


@pytest.mark.parametrize(
    ("said", "crime"),
    [
        ("", True),
        ("elements = 48\n", True),
        ('symmetry = "full"\n', True),
        ('solver = "membrane"\n', True),
        ("elements = 108\n", False),
        ("increments = [4, 11, 40]\n", False),
        ('solver = "other"\n', False),
    ],
)
def test_the_inverse_crime(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, said: str, crime: bool
) -> None:
    monkeypatch.setitem(registry.SOLVERS, "other", Other)
    project = read_project(small(tmp_path, (KNOWN, KNOWN + said)))
    (prepared,) = prepare_fit(project, list(project.tests.values())).tests
    assert prepared.by_this_model is crime
