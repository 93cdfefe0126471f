"""`make mutants`: run cosmic-ray over a copy of the code, and list the faults no test notices."""

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import click
import psutil
from cosmic_ray.config import serialize_config
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import TestOutcome, WorkItem, WorkResult

from ..mirror import test_file_of

ROOT = Path(__file__).resolve().parents[2]
#: Code that reports, resumes, validates and converts units; numerics have other tests.
MUTATED = (
    "readers/**/*.py", "experiments/**/*.py", "project/*.py", "inference/assessment.py",
    "inference/reported.py", "inference/comparison.py", "inference/search.py",
    "inference/objective.py", "inference/nuisance*.py",
    "materials/card.py", "reports/*.py", "runs/*.py", "storage/*.py",
)  # fmt: skip
#: Operators that leave code which does not load, or change annotations alone.
LEFT_OUT = re.compile(r".*(RemoveDecorator|NoOp|Bit(Or|And|Xor)|Shift|Invert|_Is(Not)?(_|$))")


def git(*arguments: str) -> list[str]:
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True)
    return done.stdout.splitlines() if done.returncode == 0 else []


def files_of(changed: str | None) -> list[str]:
    """Return the mutated modules that differ from a commit (1: where origin/main was left)."""
    paths = {str(path.relative_to(ROOT)) for one in MUTATED for path in ROOT.glob(one)}
    if changed == "1":
        base = git("merge-base", "HEAD", "origin/main")
        changed = base[0] if base and base != git("rev-parse", "HEAD") else "HEAD~1"
    if changed:
        untracked = git("ls-files", "--others", "--exclude-standard")
        paths &= {*git("diff", "--name-only", changed), *untracked}
    return sorted(path for path in paths if (ROOT / path).stat().st_size)


def copied(place: Path) -> Path:
    """Return a copy of the working tree, `bubblefit`, with the measured data beside it."""
    copy = place / "bubblefit"
    for name in git("ls-files", "--cached", "--others", "--exclude-standard"):
        if (ROOT / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, copy / name)
    if (ROOT.parent / "shared").is_dir():
        (place / "shared").symlink_to((ROOT.parent / "shared").resolve())
    return copy


def tests_near(file: str) -> list[str]:
    """Return the test file of a module's name, then those that import it; else its folder's."""
    module = "bubblefit." + file.removesuffix(".py").replace("/", ".")
    package, _, name = module.removesuffix(".__init__").rpartition(".")
    imports = re.compile(rf"{re.escape(package)}(\.| import .*\b){name}\b")
    own = ROOT / test_file_of(Path(file))
    tests = sorted((ROOT / "tests").rglob("test_*.py"), key=lambda path: (path != own, path))
    near = [path for path in tests if path == own or imports.search(path.read_text("utf-8"))]
    if own not in near and "/" in file:
        near += [path for path in tests if path.parent == own.parent and path not in near]
    return [str(path.relative_to(ROOT)) for path in near]


def cosmic_ray(arguments: Sequence[str], copy: Path, end: float) -> bool:
    """Run cosmic-ray until `end` at most, with all that it has started; True if it ended well."""
    # In CI, a test that lacks its tools would fail.
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("CI", "PYTEST", "COV"))}
    environment |= {"PYTHONPATH": str(copy.parent), "MPLBACKEND": "Agg"}
    command = [sys.executable, "-m", "cosmic_ray.cli", *arguments]
    with (copy.parent / "log").open("w") as log:
        child = psutil.Popen(command, cwd=copy, env=environment, stdout=log, stderr=log)
        try:
            return bool(child.wait(max(0.1, min(end - time.monotonic(), 1e6))) == 0)
        except psutil.TimeoutExpired:
            with suppress(psutil.NoSuchProcess):
                for process in [child, *child.children(recursive=True)]:
                    process.kill()
            return False


def _place_and_change(item: WorkItem) -> tuple[str, tuple[int, int], str, int]:
    """Return where a mutant is in the code, and what it changes there."""
    mutation = item.mutations[0]
    place = str(mutation.module_path), mutation.start_pos
    return *place, mutation.operator_name, mutation.occurrence


def drawn(items: Sequence[WorkItem], seed: int, number: int | None) -> dict[str, list[WorkItem]]:
    """Return `number` mutants by file, in random order: one of a place in the code at most.

    The same seed draws the same mutants of the same code, in whatever order the database has them.
    """
    places = {}
    in_order = sorted(items, key=_place_and_change)
    for item in Random(seed).sample(in_order, len(in_order)):
        mutation = item.mutations[0]
        if not LEFT_OUT.match(mutation.operator_name):
            places.setdefault((str(mutation.module_path), mutation.start_pos), item)
    files: dict[str, list[WorkItem]] = {}
    for (file, _), item in list(places.items())[:number]:
        files.setdefault(file, []).append(item)
    return files


@click.command()
@click.argument("files", nargs=-1)
@click.option("--changed", help="only files that differ from this commit (1: from origin/main)")
@click.option("--number", type=int, help="how many mutants are drawn  [one of every place]")
@click.option("--seed", type=int, default=1, show_default=True, help="of what is drawn")
@click.option("--minutes", type=float, help="end after this long, with what was tried so far")
@click.option("--also", multiple=True, help="tests beside those near a module: a file or folder")
@click.option("--limit", type=float, default=120.0, show_default=True, help="tests' s a mutant")
@click.option("--out", type=Path, default=Path("out/mutants"), show_default=True)
def main(files: Sequence[str], changed: str | None, number: int | None, seed: int,
         minutes: float | None, also: Sequence[str], limit: float, out: Path) -> None:  # fmt: skip
    """Try mutants of FILES (of all that assesses, reports, resumes, validates, converts units)."""
    end = time.monotonic() + 60.0 * (minutes or 1e6)
    results: list[WorkResult] = []
    with TemporaryDirectory(prefix="bubblefit-mutants-", ignore_cleanup_errors=True) as place:
        copy, config, session = copied(Path(place)), f"{place}/config", f"{place}/session"
        settings = {"module-path": list(files) or files_of(changed), "timeout": limit}
        settings |= {"distributor": {"name": "local"}, "test-command": ""}
        Path(config).write_text(serialize_config(settings))
        cosmic_ray(["init", config, session], copy, end)
        with use_db(session) as database:
            mutants = drawn(database.work_items, seed, number)
        for file, items in mutants.items():
            if time.monotonic() >= end:
                break
            pytest = f"{sys.executable} -m pytest -q -x -p no:cacheprovider -m 'not slow'"
            settings["test-command"] = " ".join([pytest, *(tests_near(file) or ["none"]), *also])
            Path(config).write_text(serialize_config(settings))
            if not cosmic_ray(["baseline", config], copy, min(end, time.monotonic() + limit)):
                click.echo(f"{file}: no time for its tests, or there are none that pass")
                continue
            with use_db(session, WorkDB.Mode.open) as database:
                database.clear()
                database.add_work_items(items)
            cosmic_ray(["exec", config, session], copy, end)
            with use_db(session, WorkDB.Mode.open) as database:
                results += [result for _, result in database.results]
    out.mkdir(parents=True, exist_ok=True)
    for name, outcome in (("caught", TestOutcome.KILLED), ("survivors", TestOutcome.SURVIVED)):
        found = [one.diff for one in results if one.test_outcome is outcome]
        click.echo(f"{len(found)} of {len(results)} mutants: {out}/{name}.txt")
        (out / f"{name}.txt").write_text("\n\n".join(found) + "\n")


if __name__ == "__main__":
    main()
