"""The list of faults stays true: each can still be put in, and names tests that are there."""

import ast

import pytest

from .__main__ import ROOT, Fault, fault_of, faults


@pytest.mark.parametrize("fault", faults(), ids=lambda fault: fault.name)
def test_fault_of_the_table_can_be_put_in(fault):
    text = fault.found(ROOT).read_text(encoding="utf-8")
    assert text.count(fault.before) == 1 and fault.before != fault.after
    ast.parse(text.replace(fault.before, fault.after))
    assert fault.tests
    for test in fault.tests:
        file, _, name = test.partition("::")
        text = (ROOT / file).read_text(encoding="utf-8")
        assert f"def {name.partition('[')[0]}(" in text, test


def test_fault_follows_its_module_and_no_other(tmp_path):
    """A module that moved is found by the text; two with the text, or none, are refused."""
    names = [fault.name for fault in faults()]
    assert len(set(names)) == len(names) > 20
    fault = Fault("one", "old/a.py", "x = 1\n", "x = 2\n", ("tests/test_a.py::test_a",))
    for folder in ("new", "tests", ".venv"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "b.py").write_text("x = 1\n")
    fault.put_in(tmp_path)
    assert (tmp_path / "new" / "b.py").read_text() == "x = 2\n"
    assert (tmp_path / "tests" / "b.py").read_text() == "x = 1\n"
    with pytest.raises(ValueError, match="nowhere"):
        fault.found(tmp_path)
    for name in ("c.py", "d.py"):
        (tmp_path / "new" / name).write_text("x = 1\n")
    with pytest.raises(ValueError, match=r"new/c.py.*new/d.py"):
        fault.found(tmp_path)


def test_row_of_the_table_is_a_fault():
    row = r"| bars | a.py | `x \| y\n    z` | `\\d` | `a.py::test_a[1, 2]` `b.py::test_b` |"
    tests = ["a.py::test_a[1, 2]", "b.py::test_b"]
    assert fault_of(row) == Fault("bars", "a.py", "x | y\n    z", r"\d", tests)


@pytest.mark.parametrize(
    "row", ["| a | a.py | `x | y` | `z` | `t` |", "| a | a.py | `x` | `y` | t |"]
)
def test_row_that_is_no_fault_is_named(row):
    with pytest.raises(ValueError, match=r"expected|cells") as caught:
        fault_of(row)
    assert row in str(caught.value)
