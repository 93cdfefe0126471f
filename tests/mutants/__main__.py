"""`make mutants`: small faults put into the code; the ones that no test notices are listed."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from random import Random
from subprocess import TimeoutExpired

import click

from . import house, judging, listing, rooms
from .drawing import Mutant, draw
from .judging import Verdict
from .measured import Measured, measure, near


@click.command()
@click.argument("files", nargs=-1)
@click.option("--changed", help="only files that differ from this commit (1: from origin/main)")
@click.option("--number", type=int, help="how many mutants are drawn  [one of every place]")
@click.option("--seed", type=int, help="of what is drawn  [of the commit]")
@click.option("--minutes", type=float, help="end after this long, with what was tried so far")
@click.option("--also", multiple=True, help="tests beside those near a module: a file or folder")
@click.option("--limit", type=float, default=60.0, show_default=True, help="tests' s a mutant")
@click.option("--processes", type=int, default=2, show_default=True, help="at a time")
@click.option("--out", type=Path, default=Path("out/mutants"), show_default=True)
def main(
    files: Sequence[str],
    changed: str | None,
    number: int | None,
    seed: int | None,
    minutes: float | None,
    also: Sequence[str],
    limit: float,
    processes: int,
    out: Path,
) -> None:
    """Mutants of FILES (of all rooms that assess, report, resume, validate and convert units)."""
    end = time.monotonic() + 60.0 * minutes if minutes else float("inf")
    # A sixth of the time at most for one mutant.
    limit = min(limit, 10.0 * minutes) if minutes else limit
    chosen = list(files) or (rooms.changed(changed) if changed else rooms.files())
    if not chosen:
        click.echo("nothing to mutate: no file of these rooms was changed")
        return
    seed = rooms.commit_number() if seed is None else seed
    click.echo(f"drawing from {len(chosen)} files, seed {seed}")
    out.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        copies = [stack.enter_context(house.copy()) for _ in range(processes)]
        # Within a time limit, file by file: there is a list of survivors whatever the limit.
        groups = [chosen] if minutes is None else [[file] for file in _mixed(chosen, seed)]
        verdicts: list[Verdict] = []
        for group in groups:
            if time.monotonic() >= end:
                break
            mutants = _drawn(copies[0], group, seed, number)
            if not mutants:
                continue
            try:
                measured = _measured(copies[0], mutants, also, processes, _left(end))
            except TimeoutExpired:
                click.echo(f"no time for {' '.join(group)}: its tests take longer than is left")
                continue
            for verdict in judging.verdicts(copies, mutants, measured, limit, end):
                verdicts.append(verdict)
                mutant = verdict.mutant
                click.echo(f"{verdict.outcome:9s} {mutant.file}:{mutant.line}", err=True)
    for name, text in (("survivors", listing.survivors), ("caught", listing.caught)):
        (out / f"{name}.txt").write_text(f"{listing.summary(verdicts)}\n\n{text(verdicts)}\n")
    click.echo(f"{listing.survivors(verdicts)}\n\n{listing.summary(verdicts)}")
    click.echo(f"listed in {out}/survivors.txt")


def _drawn(copy: Path, group: Sequence[str], seed: int, number: int | None) -> list[Mutant]:
    return list(draw({file: (copy / file).read_text() for file in group}, seed, number))


def _measured(
    copy: Path, mutants: Sequence[Mutant], also: Sequence[str], processes: int, left: float | None
) -> Measured:
    """The files that were drawn from, by the tests near them."""
    files = sorted({mutant.file for mutant in mutants})
    tests = {*also, *(test for file in files for test in near(copy, file))}
    return measure(copy, files, sorted(tests), copy.parent / "run", processes, left)


def _mixed(files: Sequence[str], seed: int) -> list[str]:
    order = list(files)
    Random(seed).shuffle(order)
    return order


def _left(end: float) -> float | None:
    return None if end == float("inf") else end - time.monotonic()


if __name__ == "__main__":
    main()
