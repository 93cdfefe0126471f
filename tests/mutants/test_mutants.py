"""`make mutants`: what it draws, which tests it runs on it, and what it leaves behind."""

from __future__ import annotations

import subprocess
from pathlib import Path

import click
import pytest

from ..places import ROOT
from . import house, judging, listing, rooms
from .drawing import draw, places
from .judging import Verdict, judge
from .measured import Measured, measure, near

SOURCE = '''"""Pressure in kPa."""
from dataclasses import dataclass


@dataclass
class Reading:
    label: str | None = None


def shown(value: float | None, **given):
    """Text of MPa, kPa."""
    if value >= 2.5:
        return f"{1e3 * value:g} kPa"
    return plot(value, new_figure(9.6, 4.3), linewidth=3, strict=True, **{"zorder": 4}, **given)
'''


def drawn(seed=0, number=None, source=SOURCE):
    return list(draw({"a.py": source}, seed, number))


def test_what_is_drawn():
    changed = {mutant.line for mutant in drawn()}
    assert changed == {12, 13}  # no annotation, docstring, decorator, look, promise
    every = {mutant.after for seed in range(60) for mutant in drawn(seed)}
    assert {
        "if value > 2.5:", "if value < 2.5:", "if not value >= 2.5:",
        'return f"{1e3 * value:g} MPa"', 'return f"{1e3 / value:g} kPa"',
    } <= every  # fmt: skip
    assert not any(" is " in after or "<<" in after for after in every)


def test_exceptions_of_a_module_stop_no_drawing():
    source = (
        "try:\n    f()\nexcept zlib.error:\n    pass\nexcept (OSError, struct.error):\n    pass\n"
    )
    assert {mutant.line for seed in range(9) for mutant in drawn(seed, source=source)} == {3, 5}


def test_what_runs_when_a_module_is_loaded():
    source = "MOST = 2\n\n\ndef one(\n    a: int = 3,\n) -> int:\n    return 4 + a\n"
    found = {mutant.line: mutant.loading for mutant in drawn(source=source)}
    assert found == {1: True, 5: True, 7: False}


def test_a_seed_draws_the_same_and_another_seed_others():
    source = (ROOT / "inference" / "assessment.py").read_text()
    one, again, other = (drawn(seed, 12, source) for seed in (1, 1, 2))
    assert one == again != other and len(one) >= 11
    for mutant in one:
        assert mutant.source != source and mutant.first <= mutant.line <= mutant.last
        compile(mutant.source, "a.py", "exec")


def test_every_place_has_the_same_chance():
    """However many changes there are of it."""
    at = [place.position for place in places("a.py", SOURCE)]
    assert len(at) == len(set(at)) and {line for line, _ in at} == {12, 13}
    share = sum(line == 12 for line, _ in at) / len(at)
    found = [drawn(seed, 1)[0].line == 12 for seed in range(100)]
    assert sum(found) / len(found) == pytest.approx(share, abs=0.15)


def test_all_rooms_have_files():
    assert len(rooms.files()) > 100
    for pattern in rooms.ROOMS:
        assert rooms.files([pattern]), pattern


def test_tests_of_a_line():
    lines = {"runs/folder.py": {1: {""}, 2: {"t::slow", "t::quick"}, 3: {"test_store.py::own"}}}
    known = Measured(lines, {"t::slow": 9.0, "t::quick": 0.1, "test_store.py::own": 5.0})
    assert known.tests("runs/folder.py", 2, 2, 60.0) == ["t::quick", "t::slow"]
    assert known.tests("runs/folder.py", 2, 3, 60.0)[0] == "test_store.py::own"
    assert known.tests("runs/folder.py", 2, 3, 6.0) == ["test_store.py::own", "t::quick"]
    assert len(known.tests("runs/folder.py", 1, 1, 60.0)) == 3  # runs when the module is loaded
    assert known.tests("runs/folder.py", 7, 7, 60.0) == []
    # A test was the first that needed the module.
    late = Measured({"runs/folder.py": {1: {"t::quick"}, 2: {"t::slow", ""}}}, known.seconds)
    assert late.tests("runs/folder.py", 1, 1, 60.0) == ["t::quick"]
    every = ["test_store.py::own", "t::quick", "t::slow"]
    assert late.tests("runs/folder.py", 1, 1, 60.0, loading=True) == every
    # Those that run some of the module come before those that run none of it.
    some = Measured({"reports/fit_page.py": {1: {""}, 2: {"t::slow"}}}, known.seconds)
    assert some.tests("reports/fit_page.py", 1, 1, 60.0)[0] == "t::slow"
    # Unless they are slow, and the line is no more than loaded.
    assert some.tests("reports/fit_page.py", 1, 1, 60.0, loading=True)[0] == "t::quick"
    # A module of declarations: no test runs a line of it, and any may show it.
    declared = Measured({"project/schema.py": {1: {""}}}, known.seconds)
    assert sorted(declared.tests("project/schema.py", 1, 1, 60.0)) == sorted(known.seconds)


def test_tests_near_a_module():
    found = near(ROOT, "experiments/strips/report.py")
    assert "tests/experiments/strips/test_objective.py" in found
    assert "tests/materials/test_law.py" not in found
    assert "tests/test_ci.py" not in near(ROOT, "files.py")


@pytest.fixture
def little(tmp_path: Path) -> Path:
    """A repository with one module and its tests."""
    texts = {
        "__init__.py": "",
        "rooms/__init__.py": "",
        "rooms/scale.py": "def kpa(mpa):\n    return 1e3 * mpa\n\n\n"
        "def large(mpa):\n    return mpa > 2\n\n\n"
        "def copied(mpa):\n    return mpa + 7\n\n\ndef unused(mpa):\n    return mpa * 5\n",
        "tests/rooms/test_scale.py": "import os\nimport sys\n\n"
        "from bubblefit.rooms.scale import copied, kpa, large\n"
        "\n\ndef test_copy():\n    child = os.fork()\n    if not child:\n"
        "        os._exit(copied(1))\n    assert os.waitpid(child, 0)[1] == 8 * 256\n"
        "\n\ndef test_kpa():\n    assert kpa(2) == 2000\n"
        "\n\ndef test_large():\n    assert large(5)\n"
        "\n\ndef test_alone():\n    assert 'pytest_cov' in sys.modules and kpa(0) == 0\n",
        "pyproject.toml": '[tool.pytest.ini_options]\naddopts = "--import-mode=importlib"\n'
        'markers = ["slow: slow"]\n',
    }
    root = tmp_path / "little"
    for name, text in texts.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    subprocess.run(["git", "init", "-q", root], check=True)
    return root


#: What becomes of a change of the little repository.
WANTED = {
    "return 1e3 / mpa": "caught",
    "return mpa > 3": "survived",
    "return mpa < 2": "caught",
    "return mpa - 7": "caught",
    "return mpa // 5": "unrun",
}


def test_caught_survived_and_unrun(little: Path, monkeypatch):
    """`test_alone` passes beside the coverage only: it fails without a change, too."""
    before = {path: path.read_bytes() for path in little.rglob("*") if path.is_file()}
    file = "rooms/scale.py"
    source = (little / file).read_text()
    mutants = {mutant.after: mutant for seed in range(60) for mutant in draw({file: source}, seed)}
    with house.copy(little) as copy, house.copy(little) as second:
        known = measure(copy, [file], near(copy, file), copy.parent / "run", processes=1)
        every = [mutants[after] for after in WANTED]
        verdicts = list(judging.verdicts([copy, second], every, known, 60.0, libraries=["pytest"]))
        assert [verdict.mutant for verdict in verdicts] == every
        with judge(copy, known, 60.0, ["pytest"]) as one:
            monkeypatch.setattr(judging, "PATIENCE", (0.0, 0.0))
            assert one.judge(every[0]).outcome == "late"
            monkeypatch.undo()
            assert one.fit("tests/rooms/test_scale.py::test_kpa")
            assert not one.fit("tests/rooms/test_scale.py::test_alone")
        assert (copy / file).read_text() == source
    assert not copy.parent.exists()
    after = {path: path.read_bytes() for path in little.rglob("*") if path.is_file()}
    assert after == before
    assert {verdict.mutant.after: verdict.outcome for verdict in verdicts} == WANTED
    assert verdicts[0].by == "tests/rooms/test_scale.py::test_kpa"
    assert listing.summary(verdicts) == (
        "5 mutants: 3 caught, 1 survived, 0 did not end, 1 in lines that no test near them runs"
    )
    assert listing.survivors(verdicts) == (
        "rooms/scale.py:6\n  - return mpa > 2\n  + return mpa > 3\n  (1 tests run it and pass)\n"
        "rooms/scale.py:14\n  - return mpa * 5\n  + return mpa // 5\n  (no test near it runs it)"
    )


def test_a_run_that_breaks_is_no_run_without_lines(tmp_path: Path):
    with pytest.raises(click.ClickException, match=r"pytest ended with 4: .*/run/log\n"):
        measure(tmp_path, ["a.py"], ["nothing.py"], tmp_path / "run", processes=1)


def test_an_interrupted_run_leaves_the_code_as_it_was(tmp_path: Path):
    path = tmp_path / "a.py"
    path.write_text("a = 1\n")
    date = path.stat().st_mtime_ns
    with pytest.raises(KeyboardInterrupt), house.instead(path, "a = 2\n"):
        assert path.read_text() == "a = 2\n"
        raise KeyboardInterrupt
    assert path.read_text() == "a = 1\n" and path.stat().st_mtime_ns == date


def test_changed_files(little: Path):
    def git(*arguments: str) -> None:
        names = ["-c", "user.name=a", "-c", "user.email=a@b"]
        subprocess.run(["git", *names, *arguments], cwd=little, check=True, capture_output=True)

    (little / "reports").mkdir()
    for number in (1, 2, 3):
        (little / "reports" / f"{number}.py").write_text("a = 1\n")
        git("add", "-A")
        git("commit", "-q", "-m", str(number))
    (little / "reports" / "4.py").write_text("a = 1\n")
    (little / "rooms" / "scale.py").write_text("a = 1\n")  # not in the rooms
    assert rooms.changed("1", little) == ["reports/3.py", "reports/4.py"]
    assert 0 < rooms.commit_number(little) < 16**6
    assert rooms.changed("HEAD~2", little) == ["reports/2.py", "reports/3.py", "reports/4.py"]


def test_no_verdict_is_lost_in_the_list():
    (mutant, *_) = drawn()
    verdicts = [Verdict(mutant, "caught", "tests/a.py::b", 3), Verdict(mutant, "unrun")]
    verdicts.append(Verdict(mutant, "late", tests=3))
    assert listing.caught(verdicts).endswith("(tests/a.py::b)")
    assert listing.survivors(verdicts).count("a.py:") == 2
    assert "1 caught, 0 survived, 1 did not end, 1 in lines" in listing.summary(verdicts)
