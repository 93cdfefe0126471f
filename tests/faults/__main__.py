"""python tests/faults [NAME ...]: put faults into a copy of the repository; do tests fail?

Those of escaped.toml were once put in by hand and not noticed; each names the tests that notice it.
Without names all of them; NAME is any part of a fault's name. Prints a line a fault, and ends with
1 where one escapes its tests, or where a test does not pass without it.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from table import Fault, faults

ROOT = Path(__file__).resolve().parents[2]
#: What the copy does not need, or must not share.
LEFT_OUT = (".git", ".venv", "out", "build", "dist", "__pycache__", ".*_cache", "*.egg-info")


@contextmanager
def copy() -> Iterator[Path]:
    """A copy of the repository named bubblefit, beside the same measured data, for a while."""
    with tempfile.TemporaryDirectory(prefix="faults-") as name:
        root = Path(name) / "bubblefit"
        shutil.copytree(ROOT, root, ignore=shutil.ignore_patterns(*LEFT_OUT))
        shared = ROOT.parent / "shared"
        if shared.is_dir():
            (Path(name) / "shared").symlink_to(shared)
        yield root


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
    """Whether every test of a fault fails with it."""
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
    """Exit code."""
    chosen = [f for f in faults() if not names or any(name in f.name for name in names)]
    if not chosen:
        print(f"no fault is named {' or '.join(names)}", file=sys.stderr)
        return 2
    with copy() as root:
        tests = sorted({test for fault in chosen for test in fault.tests})
        code, ended, output = run(root, tests, "")
        bad = [name for name, word in ended.items() if word != "PASSED"]
        if code or bad or "skipped" in output.splitlines()[-1]:
            print(output, file=sys.stderr)
            print("without any fault, not every test passes", file=sys.stderr)
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
