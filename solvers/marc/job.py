"""One run of Marc: a fresh folder, a deck in it, the program, the judgement, the results."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from ...errors import LicenceDenied, SolverFailure
from ..base import Progress
from ..process import Watch, run_process
from ..scratch import run_folder
from .analysis import Reader
from .command import find_marc, run_command
from .deck import JOB
from .reasons import Ending, ending
from .settings import MarcSettings
from .sts import increments

log = logging.getLogger(__name__)

NAME, SCREEN, SUBROUTINE = "marc", "screen.txt", "hypela2.f"
#: What Marc writes and is read, and what is added to the name of a file that is too old to be.
WRITTEN, EARLIER = ("sts", "out", "log", "t19"), ".earlier"
T = TypeVar("T")
Tell = Callable[[Progress], None]


@dataclass(frozen=True)
class Job:
    """What is run: the deck, total time at its end, source of a user subroutine or None."""

    deck: str
    time: int
    subroutine: str | None


def run_job(
    job: Job,
    settings: MarcSettings,
    read: Reader[T],
    rescue: Reader[T] | None = None,
    parent: Path | None = None,
    timeout: float | None = None,
    tell: Tell | None = None,
) -> tuple[T, Ending]:
    """Run it in a fresh scratch folder.

    Parameters
    ----------
    read : makes something of the results; rescue : of those of a run that stopped early.
    parent : folder of the scratch folder.
    timeout : s, of one run; the settings' unless given.
    tell : called with every increment that ended while it runs.

    Raises
    ------
    SolverFailure : it did not end well; the scratch folder is kept and named. LicenceDenied : it
        never began, for want of a licence.
    InputError : a Marc that is not there or cannot be started.
    """
    find_marc(settings)
    with run_folder(NAME, parent, settings.keep, NAME, SCREEN) as folder:
        return _in(folder, job, settings, read, rescue, timeout or settings.timeout, tell)


def _in(
    folder: Path,
    job: Job,
    settings: MarcSettings,
    read: Reader[T],
    rescue: Reader[T] | None,
    timeout: float,
    tell: Tell | None,
) -> tuple[T, Ending]:
    """One run in a folder that is empty at its start."""
    try:
        (folder / f"{JOB}.dat").write_text(job.deck, encoding="ascii", errors="replace")
        if job.subroutine is not None:
            (folder / SUBROUTINE).write_text(job.subroutine, encoding="ascii", errors="replace")
    except OSError as error:
        raise SolverFailure(f"the deck cannot be written: {error.strerror}", NAME) from None
    sts, results = folder / f"{JOB}.sts", folder / f"{JOB}.t19"
    outcome = run_process(
        run_command(settings, JOB, None if job.subroutine is None else SUBROUTINE),
        folder,
        folder / SCREEN,
        timeout,
        settings.environment,
        None if tell is None else Watch(lambda: increments(sts), tell),
    )
    set_earlier_aside(folder)
    end = ending(folder, JOB, SCREEN, outcome, timeout, float(job.time))
    if end.problem is None:
        try:
            return read(results, end.iterations), end
        except SolverFailure as failure:
            number = end.number if failure.exit_number is None else failure.exit_number
            raise SolverFailure(failure.reason, NAME, number, failure.log_tail) from None
    log.info("stopped early: %s", end.problem)
    kind = LicenceDenied if end.licence else SolverFailure
    try:
        if rescue is not None and end.collapse:
            return rescue(results, end.iterations), end
    except SolverFailure as failure:
        # Why it stopped says more than what its results then lack.
        log.info("%s", failure.reason)
    raise kind(end.problem, NAME, end.number, end.said)


def set_earlier_aside(folder: Path) -> None:
    """What is older than the deck was left by an earlier job: it is not this one's answer.

    The folder is fresh, but a site's script may copy files into it, from a place of its own.
    """
    begun = (folder / f"{JOB}.dat").stat().st_mtime_ns
    for name in WRITTEN:
        path = folder / f"{JOB}.{name}"
        if path.is_file() and path.stat().st_mtime_ns < begun:
            log.warning(
                "%s is older than the deck, and is left aside as %s", path, path.name + EARLIER
            )
            path.rename(path.with_name(path.name + EARLIER))
