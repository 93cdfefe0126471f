"""python tests/faults [NAME ...]: put faults into a copy of the repository; do tests fail?

Those of escaped.md were once put in by hand and not noticed; each names the tests that notice it.
Without names all of them; NAME is any part of a fault's name. Prints a line a fault, and ends with
1 where one escapes its tests, or where a test does not pass without it.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
#: What the copy does not need, or must not share.
LEFT_OUT = (".git", ".venv", "out", "build", "dist", "__pycache__", ".*_cache", "*.egg-info")
#: Folders whose modules are no part of the product.
APART = {"tests", "benchmarks", "docs", "examples", "out", "build", "dist", "__pycache__"}
#: A text of a cell, between backticks.
CODE = re.compile(r"`([^`]*)`")
ESCAPES = {"n": "\n"}


@dataclass(frozen=True)
class Fault:
    """One fault: the text `before` of `file`, there once, becomes `after`; `tests` then fail.

    file : below the repository. Where the text is no longer in it, the module may have moved: the
        only module of the product that has the text, once, takes its place; of several the only
        one of the same file name.
    """

    name: str
    file: str
    before: str
    after: str
    tests: Sequence[str]

    def found(self, root: Path) -> Path:
        """Return the module below `root` that has the text; ValueError unless it is there once."""

        def having(paths):
            times = {path: path.read_text("utf-8").count(self.before) for path in paths}
            return {path: count for path, count in times.items() if count}

        path = root / self.file
        found = having([path] if path.exists() else [])
        if not found:
            every = ((path, path.relative_to(root).parts) for path in sorted(root.rglob("*.py")))
            ours = (p for p, parts in every if not ({*parts} & APART or parts[0][0] == "."))
            found = having(ours)
        if len(found) > 1:
            found = {p: n for p, n in found.items() if p.name == path.name} or found
        if list(found.values()) != [1]:
            where = {path.relative_to(root).as_posix(): count for path, count in found.items()}
            raise ValueError(f"{self.name}: {self.before!r} is there {where or 'nowhere'}")
        return next(iter(found))

    def put_in(self, root: Path) -> None:
        path = self.found(root)
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace(self.before, self.after), encoding="utf-8")


def fault_of(row: str) -> Fault:
    """Return the fault of a row of the table: name, file, `before`, `after`, `test` `test` ..."""
    cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]]
    if len(cells) != 5:
        raise ValueError(f"{len(cells)} cells instead of 5, a bar in a text is \\|: {row}")
    name, file, *quoted = cells
    before, after, tests = ([_plain(text) for text in CODE.findall(cell)] for cell in quoted)
    if len(before) != 1 or len(after) != 1 or not tests:
        raise ValueError(f"a text before, one after, and tests in backticks are expected: {row}")
    return Fault(name, file, before[0], after[0], tests)


def _plain(text: str) -> str:
    """Return the text of a cell with its line breaks, bars and backslashes."""
    return re.sub(r"\\(.)", lambda escaped: ESCAPES.get(escaped[1], escaped[1]), text)


def faults(table: Path = HERE / "escaped.md") -> list[Fault]:
    """Return the faults of the table in their order; what stands above it is for people."""
    lines = table.read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if line.startswith("|")]
    return [fault_of(row) for row in rows[2:]]


def run(root: Path, tests: Sequence[str], keep: str = "1") -> tuple[int, dict[str, str], str]:
    """Exit code of pytest, how each test of the copy ended by its name, and the output.

    keep : "" keeps what Python compiles; never with a fault in, which may have the same size and
    second as what it takes the place of.
    """
    environment = {**os.environ, "PYTHONPATH": str(root.parent), "PYTHONDONTWRITEBYTECODE": keep}
    command = [sys.executable, "-m", "pytest", "-q", "-rA", "-p", "no:cacheprovider", *tests]
    done = subprocess.run(
        command, cwd=root, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, check=False,
    )  # fmt: skip
    found = re.findall(r"^(PASSED|FAILED|ERROR|SKIPPED) (\S+::.*?)(?: - .*)?$", done.stdout, re.M)
    return done.returncode, {name: word for word, name in found}, done.stdout


def caught(root: Path, fault: Fault) -> bool:
    path = fault.found(root)
    before = path.read_bytes()
    fault.put_in(root)
    try:
        ended = run(root, fault.tests)[1]
    finally:
        path.write_bytes(before)
    failed = [name for name, word in ended.items() if word == "FAILED"]
    return all(any(name.startswith(test) for name in failed) for test in fault.tests)


def main(names: Sequence[str]) -> int:
    chosen = [f for f in faults() if not names or any(name in f.name for name in names)]
    if not chosen:
        print(f"no fault is named {' or '.join(names)}", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(prefix="faults-") as folder:
        root, shared = Path(folder) / "bubblefit", ROOT.parent / "shared"
        shutil.copytree(ROOT, root, ignore=shutil.ignore_patterns(*LEFT_OUT))
        if shared.is_dir():
            (root.parent / "shared").symlink_to(shared)
        tests = sorted({test for fault in chosen for test in fault.tests})
        code, ended, output = run(root, tests, "")
        if code or {*ended.values()} != {"PASSED"} or "skipped" in output.splitlines()[-1]:
            print(f"{output}\nwithout any fault, not every test passes", file=sys.stderr)
            return 1
        escaped = 0
        for fault in chosen:
            good = caught(root, fault)
            escaped += not good
            where = ", ".join(test.split("::")[-1] for test in fault.tests)
            print(f"{'caught ' if good else 'ESCAPED'}  {fault.name}: {where}", flush=True)
    print(f"{len(chosen) - escaped} of {len(chosen)} caught")
    return int(escaped > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
