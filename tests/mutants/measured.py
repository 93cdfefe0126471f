"""Which tests run which line of a file, measured by running them once on the code as it is."""

from __future__ import annotations

import ast
import subprocess
import sys
import xml.etree.ElementTree as xml
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import click
from coverage import CoverageData

from .house import environment

#: What a copy of the test's process runs counts, too (tests/commands.py): it ends with `_exit`.
SETTINGS = """
[run]
include =
{files}
data_file = {folder}/coverage
parallel = true
patch = _exit
"""


#: Seconds of a test that is tried before those that take longer.
QUICK = 0.2


@dataclass(frozen=True)
class Measured:
    """lines: file -> line -> tests (name as pytest has it); seconds: that a test takes."""

    lines: dict[str, dict[int, set[str]]]
    seconds: dict[str, float]

    def tests(
        self, file: str, first: int, last: int, limit: float, loading: bool = False
    ) -> list[str]:
        """Those that run a line of a statement; if it runs at import, all: any may show it.

        loading : it does. Where a test is the first that needs the module, only that one has run
        the line.

        Tests of the module's own name first, then those that run some of it, then the quick ones,
        for `limit` seconds in all. What runs at import (a default of a section) may show in a
        quick test that runs nothing else of the module: quick ones come second there.
        """
        known = self.lines.get(file, {})
        found = set().union(*(known.get(line, set()) for line in range(first, last + 1)))
        if loading or found <= {""}:
            at_import = any(line in known for line in range(first, last + 1))
            found = {*self.seconds} if at_import else set()
        own, inside = f"test_{Path(file).stem}", set().union(*known.values())
        order = sorted(
            found & {*self.seconds},
            key=lambda test: (
                own not in test,
                loading and self.cost(test) > QUICK,
                test not in inside,
                self.cost(test),
            ),
        )
        total, chosen = 0.0, []
        for test in order:
            total += self.cost(test)
            if chosen and total > limit:
                break
            chosen.append(test)
        return chosen

    def cost(self, test: str) -> float:
        return self.seconds.get(test, 0.0)


def near(house: Path, file: str) -> list[str]:
    """Test files of a module: all in the folder that mirrors its own, and what imports it."""
    inside = Path(file)
    module = "bubblefit." + ".".join(inside.with_suffix("").parts).removesuffix(".__init__")
    found = set()
    for path in (house / "tests").rglob("test_*.py"):
        here = path.relative_to(house)
        mirrored = inside.parent != Path(".") and here.parent == "tests" / inside.parent
        if mirrored or module in _imports(path, inside.stem):
            found.add(here.as_posix())
    return sorted(found)


def _imports(path: Path, word: str) -> set[str]:
    """Modules that a test file imports, `from x import y` as x and as x.y; none without `word`."""
    found, text = set(), path.read_text()
    for node in ast.walk(ast.parse(text if word in text else "")):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def measure(
    house: Path,
    files: Iterable[str],
    tests: Iterable[str],
    folder: Path,
    processes: int,
    seconds: float | None = None,
) -> Measured:
    """Run test files (not what is marked slow), and see which of them run lines of `files`.

    Raises TimeoutExpired after `seconds`, ClickException where the run itself broke: what was not
    measured must not be taken for lines that no test runs.
    """
    folder.mkdir(parents=True, exist_ok=True)
    settings = folder / "settings"
    listed = "\n".join(f"    {house / file}" for file in files)
    settings.write_text(SETTINGS.format(files=listed, folder=folder))
    spread = ["-n", str(processes), "--dist", "worksteal"] if processes > 1 else []
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *spread]
    command += ["-m", "not slow", "-o", "junit_family=xunit1", f"--junitxml={folder}/times.xml"]
    command += ["--cov", f"--cov-config={settings}", "--cov-context=test", "--cov-report="]
    with (folder / "log").open("w") as log:
        done = subprocess.run(
            [*command, *tests],
            cwd=house,
            env=environment(house),
            stdout=log,
            stderr=log,
            timeout=seconds,
        )
    if done.returncode > 1:  # 1: some tests failed, which are left out
        tail = "\n".join((folder / "log").read_text().splitlines()[-5:])
        raise click.ClickException(f"pytest ended with {done.returncode}: {folder}/log\n{tail}")
    return Measured(_lines(house, folder / "coverage"), _seconds(folder / "times.xml"))


def _lines(house: Path, path: Path) -> dict[str, dict[int, set[str]]]:
    data, found = CoverageData(str(path)), {}
    data.read()
    for name in data.measured_files():
        lines: dict[int, set[str]] = defaultdict(set)
        for line, contexts in data.contexts_by_lineno(name).items():
            lines[line] |= {context.rpartition("|")[0] for context in contexts}
        found[Path(name).relative_to(house).as_posix()] = dict(lines)
    return found


def _seconds(path: Path) -> dict[str, float]:
    """Of the tests that passed."""
    return {
        f"{case.get('file')}::{case.get('name')}": float(case.get("time") or 0.0)
        for case in xml.parse(path).iter("testcase")
        if not {child.tag for child in case} & {"failure", "error", "skipped"}
    }
