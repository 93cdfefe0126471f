"""A copy of the repository to change: an interrupted run leaves nothing behind in the original."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from .rooms import ROOT, git


@contextmanager
def copy(root: Path = ROOT) -> Iterator[Path]:
    """The working tree as a folder `bubblefit`, measured data beside it as they are beside it."""
    with TemporaryDirectory(prefix="bubblefit-mutants-") as place:
        house = Path(place) / "bubblefit"
        listed = git("ls-files", "--cached", "--others", "--exclude-standard", "-z", root=root)
        for name in filter(None, listed.split("\0")):
            if (root / name).is_file():
                (house / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(root / name, house / name)
        data = root.parent / "shared"
        if data.is_dir():
            (house.parent / "shared").symlink_to(data.resolve())
        yield house


def environment(house: Path) -> dict[str, str]:
    """The copy is the package that is imported, here and in processes of the tests.

    A test that needs what is not there is left out: whether CI may do that is not asked here.
    """
    apart = ("CI", "PYTEST", "COV_", "COVERAGE")
    variables = {k: value for k, value in os.environ.items() if not k.startswith(apart)}
    return {**variables, "PYTHONPATH": str(house.parent), "MPLBACKEND": "Agg"}


@contextmanager
def instead(path: Path, source: str) -> Iterator[None]:
    """Another text in a file, for a while; then the old one with its old date.

    The date tells Python that what it compiled from the old text is not of the new one.
    """
    old, date = path.read_text(), path.stat().st_mtime_ns
    path.write_text(source)
    try:
        yield
    finally:
        path.write_text(old)
        os.utime(path, ns=(date, date))
