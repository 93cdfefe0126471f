"""One run of Marc: the command, a fresh folder, its results."""

import logging
import os
import shlex
import shutil
import subprocess
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from ...errors import LicenceDenied, SolverFailure
from ..base import Progress
from ..process import Watch, program_at, run_process
from ..scratch import run_folder, write_deck
from .deck import JOB, Reader
from .ending import Ending, ending, increments
from .settings import VARIABLE, MarcSettings

T = TypeVar("T")
ADVICE = (
    f"name run_marc in [solver.marc] executable, by --marc, or in {VARIABLE}; "
    "see `bubblefit docs marc`"
)
log = logging.getLogger(__name__)

NAME = "marc"
#: Files of a run: what run_marc printed, and the user subroutine.
SCREEN = "screen.txt"
SUBROUTINE = "hypela2.f"
#: What Marc writes and is read.
WRITTEN = ("sts", "out", "log", "t19")
#: Added to the name of a file that is too old to be of this run.
EARLIER = ".earlier"


def run_command(settings: MarcSettings, job: str, subroutine: str | None) -> list[str]:
    """Return the command of Marc on `job`.dat, in the foreground; subroutine : user code's file."""
    older = settings.options == "older"
    words = [settings.executable, "-jid" if older else "-j", job, "-v", "no", "-b", "no"]
    if older:
        words += ["-nprocd", str(settings.processors)]
        if settings.threads > 1:
            words += ["-nthread", str(settings.threads)]
    else:
        words += ["-nte", str(settings.threads), "-nts", str(settings.threads)]
        if settings.processors > 1:
            words += ["-nps", str(settings.processors)]
    if subroutine is not None:
        words += ["-u", subroutine]
    return with_modules(settings.modules, [*words, *settings.arguments])


def with_modules(modules: Sequence[str], words: Sequence[str]) -> list[str]:
    """Return the command in a login shell that has loaded `modules`; as it is without any."""
    if not modules:
        return list(words)
    load = " && ".join(f"module load {shlex.quote(name)}" for name in modules)
    # The command's own words never become text of the shell.
    return ["/bin/bash", "-lc", f'{load} && exec "$@"', "bash", *words]


def find_marc(settings: MarcSettings) -> Path | None:
    """Return run_marc, None: only modules know it; InputError: not there; SolverFailure: none."""
    if os.sep in settings.executable:
        return program_at(Path(os.path.expanduser(settings.executable)), "marc", "run_marc")
    if settings.modules:
        return _in_modules(settings)
    program = shutil.which(settings.executable)
    if program is None:
        raise SolverFailure(f"there is no {settings.executable} on the PATH; {ADVICE}", "marc")
    return Path(program)


def _in_modules(settings: MarcSettings) -> Path | None:
    """Return run_marc as the shell sees it after `module load`."""
    ask = with_modules(
        settings.modules, ["/bin/sh", "-c", 'command -v "$1"', "sh", settings.executable]
    )
    process = None
    with suppress(OSError, subprocess.SubprocessError):
        process = subprocess.run(ask, capture_output=True, timeout=60.0, stdin=subprocess.DEVNULL)
    if process is None or process.returncode != 0:
        lines = process.stderr.decode(errors="replace").strip().splitlines() if process else []
        reason = f" ({lines[-1]})" if lines else ""
        names = ", ".join(settings.modules)
        problem = f"modules {names} give no {settings.executable}{reason}; {ADVICE}"
        raise SolverFailure(problem, "marc")
    path = process.stdout.decode(errors="replace").strip().splitlines()
    return Path(path[-1]) if path else None


def run_job(
    deck: str,
    time: int,
    source: str | None,
    settings: MarcSettings,
    read: Reader[T],
    rescue: Reader[T] | None = None,
    parent: Path | None = None,
    timeout: float | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> tuple[T, Ending]:
    """Run a deck in a fresh scratch folder below `parent`; return what `read` makes of its results.

    time : total, at the end. source : of a user subroutine, or None. rescue : reads the results of
    a run that stopped early. SolverFailure: no good end; names the kept folder. LicenceDenied: it
    never began. InputError: a Marc that is not there.
    """
    find_marc(settings)
    seconds = timeout or settings.timeout
    subroutine = None if source is None else SUBROUTINE
    with run_folder(NAME, parent, settings.keep, NAME, SCREEN) as folder:
        write_deck(folder, {f"{JOB}.dat": deck, SUBROUTINE: source})
        sts = folder / f"{JOB}.sts"
        results = folder / f"{JOB}.t19"
        watch = None if on_progress is None else Watch(lambda: increments(sts), on_progress)
        command = run_command(settings, JOB, subroutine)
        screen = folder / SCREEN
        outcome = run_process(command, folder, screen, seconds, settings.environment, watch)
        set_earlier_aside(folder)
        end = ending(folder, JOB, SCREEN, outcome, seconds, float(time))
        if end.problem is None:
            try:
                return read(results, end.iterations), end
            except SolverFailure as failure:
                number = end.number if failure.exit_number is None else failure.exit_number
                raise SolverFailure(failure.reason, NAME, number, failure.log_tail) from None
        log.info("stopped early: %s", end.problem)
        try:
            if rescue is not None and end.collapse:
                return rescue(results, end.iterations), end
        except SolverFailure as failure:
            # Why it stopped says more than what its results then lack.
            log.info("%s", failure.reason)
        kind = LicenceDenied if end.licence else SolverFailure
        raise kind(end.problem, NAME, end.number, end.excerpt)


def set_earlier_aside(folder: Path) -> None:
    """Rename what is older than the deck: a site's script may copy old files into the folder."""
    start = (folder / f"{JOB}.dat").stat().st_mtime_ns
    for name in WRITTEN:
        path = folder / f"{JOB}.{name}"
        if path.is_file() and path.stat().st_mtime_ns < start:
            log.warning(
                "%s is older than the deck, and is left aside as %s", path, path.name + EARLIER
            )
            path.rename(path.with_name(path.name + EARLIER))
