"""What is mutated: the code that assesses, reports, resumes, validates and converts units."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Patterns of files, from the repository's root. The numerics have tests of another kind.
ROOMS = (
    "readers/*.py",
    "readers/formats/*.py",
    "experiments/*.py",
    "experiments/*/*.py",
    "project/*.py",
    "inference/assessment.py",
    "inference/comparison.py",
    "inference/search.py",
    "inference/resampling.py",
    "materials/card.py",
    "reports/*.py",
    "runs/*.py",
    "files.py",
)


def files(patterns: Sequence[str] = ROOMS, root: Path = ROOT) -> list[str]:
    """Paths of modules from `root`, in order."""
    paths = {path for pattern in patterns for path in root.glob(pattern)}
    return sorted(path.relative_to(root).as_posix() for path in paths if path.stat().st_size)


def git(*arguments: str, root: Path = ROOT) -> str:
    """What git prints; "" where it cannot."""
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else ""


def commit_number(root: Path = ROOT) -> int:
    """A number that is another one with every commit; 0 without git."""
    return int(git("rev-parse", "HEAD", root=root).strip()[:6] or "0", 16)


def changed(since: str, root: Path = ROOT) -> list[str]:
    """Those of the rooms' files that differ from the commit `since`.

    "1" stands for the commit where this branch left origin/main, or the last one but one where
    it has not left it.
    """
    if since == "1":
        head = git("rev-parse", "HEAD", root=root).strip()
        base = git("merge-base", "HEAD", "origin/main", root=root).strip()
        since = base if base not in ("", head) else "HEAD~1"
    different = git("diff", "--name-only", since, root=root).splitlines()
    different += git("ls-files", "--others", "--exclude-standard", root=root).splitlines()
    return [file for file in files(root=root) if file in different]
