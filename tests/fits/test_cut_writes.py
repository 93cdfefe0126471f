"""A fit that ends between any two of its writes, by a kill or a disk, and is gone on with."""

from __future__ import annotations

import errno
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bubblefit as bf
import pytest
from bubblefit import files
from bubblefit.errors import OutputError
from bubblefit.runs import starts as running_files
from bubblefit.runs.folder import Store

from ..projects import constant_strips


class Killed(BaseException):
    """In place of a signal that nobody can catch: nothing of ours handles it."""


ENDS: dict[str, Callable[[], BaseException]] = {
    "kill": Killed,
    "full disk": lambda: OSError(errno.ENOSPC, "No space left on device"),
    "broken disk": lambda: OSError(errno.EIO, "Input/output error"),
}


def counted(patch: pytest.MonkeyPatch, last: int, end: Callable[[], BaseException]) -> list[str]:
    """What is written, in order; in place of number `last` comes the end."""
    written: list[str] = []
    replace, append = files.os.replace, running_files._append

    def note(what: str) -> None:
        written.append(what)
        if len(written) == last:
            raise end()

    def replacing(source: Any, target: Any) -> None:
        note(Path(target).name)
        replace(source, target)

    def appending(stream: Any, text: str) -> None:
        # Half of a line may be there.
        if len(written) + 1 == last:
            append(stream, text[: len(text) // 2])
        note("a line")
        append(stream, text)

    patch.setattr(files.os, "replace", replacing)
    patch.setattr(running_files, "_append", appending)
    return written


def fitted(project: Path, out: Path, **options: Any) -> bf.Fit:
    return bf.fit(bf.read_project(project), ["one"], out=out, jobs=1, **options)


def told(fit: bf.Fit, out: Path) -> tuple[Any, ...]:
    """All that may be compared: moduli, starts but their seconds, and every analysis."""
    starts = fit.starts().drop(columns="seconds")
    return fit.moduli().to_csv(), starts.to_csv(), (out / "history.csv").read_text()


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return constant_strips(tmp_path_factory.mktemp("cut"))


def test_whichever_write_is_the_last_the_end_is_the_same(project: Path, tmp_path: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        written = counted(patch, 0, Killed)
        whole = told(fitted(project, tmp_path / "whole"), tmp_path / "whole")
    assert written[:2] == ["run.json", "as-run.toml"] and written[-1] == "history.csv"
    # Every file, and some of the lines.
    lines = [n for n, what in enumerate(written, 1) if what == "a line"]
    chosen = [n for n, what in enumerate(written, 1) if what != "a line"]
    chosen += [lines[len(lines) // 2], lines[-1]]
    for turn, number in enumerate(sorted(chosen)):
        name = list(ENDS)[turn % len(ENDS)]
        out = tmp_path / f"{number} {name}"
        with pytest.MonkeyPatch.context() as patch:
            counted(patch, number, ENDS[name])
            with pytest.raises(Killed if name == "kill" else OutputError) as ended:
                fitted(project, out)
        if name != "kill":
            assert "cannot be written" in str(ended.value)
        again = fitted(project, out, resume=Store(out).used)
        assert told(again, out) == whole, (number, name)
        assert not [path for path in out.rglob(".*") if path.is_file()]
