"""`make mutants`: what it draws, which tests it runs, and that it ends."""

import time
from pathlib import Path

import pytest
from click.testing import CliRunner
from cosmic_ray.work_item import MutationSpec, WorkItem

from . import __main__ as mutants

CODE = "def triple(x):\n    return 3 * x\n\n\ndef unseen(x):\n    return x - 1\n"
TEST = "from bubblefit.runs.a import triple\n\n\ndef test_a():\n    assert triple(2) == 6\n"
HANGING = (
    "import time\nfrom bubblefit.runs.a import triple\n\n\ndef test_a():\n    time.sleep(99)\n"
)


def item(line: int, operator: str, occurrence: int = 0) -> WorkItem:
    mutation = MutationSpec("a.py", operator, occurrence, (line, 0), (line, 9))
    return WorkItem.single(f"{line}{operator}{occurrence}", mutation)


def test_one_mutant_per_place_is_drawn():
    items = [item(line, f"core/{name}") for line in range(9) for name in ("NumberReplacer", "Zero")]
    items.append(item(20, "core/RemoveDecorator"))
    drawn = mutants.drawn(items, 1, None)["a.py"]
    assert sorted(one.mutations[0].start_pos[0] for one in drawn) == list(range(9))
    assert mutants.drawn(items, 1, 4) == mutants.drawn(items, 1, 4) != mutants.drawn(items, 2, 4)
    assert len(mutants.drawn(items, 1, 4)["a.py"]) == 4
    assert mutants.drawn(items[::-1], 1, 4) == mutants.drawn(items, 1, 4)


def test_test_file_of_its_name_comes_first_then_those_that_import_it():
    near = mutants.tests_near("runs/starts.py")
    assert near[0] == "tests/runs/test_starts.py"
    assert "tests/runs/test_certainty.py" in near
    assert "tests/runs/test_in_use.py" not in near


def test_module_without_test_file_takes_those_of_its_folder():
    assert "tests/storage/test_reading.py" in mutants.tests_near("storage/unknown.py")
    assert mutants.tests_near("unknown.py") == []


@pytest.mark.slow
@pytest.mark.parametrize(("test", "tried"), [(TEST, True), (HANGING, False)])
def test_survivors_are_listed_in_time(test, tried, tmp_path: Path, monkeypatch):
    root = tmp_path / "bubblefit"
    texts = {"__init__.py": "", "runs/__init__.py": "", "runs/a.py": CODE, "tests/test_a.py": test}
    for name, text in texts.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    monkeypatch.setattr(mutants, "ROOT", root)
    mutants.git("init")
    begun = time.monotonic()
    limit = "120" if tried else "3"
    options = ["--minutes", "0.5", "--limit", limit, "--out", str(tmp_path), "runs/a.py"]
    done = CliRunner().invoke(mutants.main, options, catch_exceptions=False)
    assert done.exit_code == 0 and time.monotonic() - begun < 45
    survivors, caught = (tmp_path / f"{n}.txt" for n in ("survivors", "caught"))
    assert ("return x" in survivors.read_text()) is tried
    assert ("3 * x" in caught.read_text()) is tried
    assert ("no time for its tests" in done.output) is not tried
