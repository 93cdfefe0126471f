"""The list of faults stays true: each can still be put in, and names tests that are there."""

from __future__ import annotations

import ast

import pytest

from ..places import ROOT
from .table import Fault, faults

every = pytest.mark.parametrize("fault", faults(), ids=lambda fault: fault.name)


@every
def test_a_fault_can_be_put_in(fault: Fault) -> None:
    """Its text stands exactly once in its file, and Python reads what becomes of it."""
    text = (ROOT / fault.file).read_text(encoding="utf-8")
    assert text.count(fault.before) == 1
    assert fault.before != fault.after
    ast.parse(text.replace(fault.before, fault.after))


@every
def test_its_tests_are_there(fault: Fault) -> None:
    assert fault.tests
    for test in fault.tests:
        file, _, name = test.partition("::")
        text = (ROOT / file).read_text(encoding="utf-8")
        assert f"def {name.partition('[')[0]}(" in text, test


def test_names_are_each_one_s_own() -> None:
    names = [fault.name for fault in faults()]
    assert len(set(names)) == len(names) > 20
