"""Running one job of Marc: its command, its scratch folder, and the reading of its results."""

import logging
import os
import shlex
import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
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
#: Names of files of a run: the output of run_marc, and the source of the user subroutine.
SCREEN = "screen.txt"
SUBROUTINE = "hypela2.f"
#: Endings of the files of Marc that are read.
WRITTEN = ("sts", "out", "log", "t19")
#: Ending that is added to the name of a file that is older than the run.
EARLIER = ".earlier"


def run_command(settings: MarcSettings, job: str, subroutine: str | None) -> list[str]:
    """Return the command that runs Marc on the deck `job`.dat in the foreground.

    Parameters
    ----------
    subroutine : str or None
        File with the source of the user subroutine, or None.
    """
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
    """Return a command that loads environment modules in a login shell and runs `words` there.

    Without modules it is `words`.
    """
    if not modules:
        return list(words)
    load = " && ".join(f"module load {shlex.quote(name)}" for name in modules)
    # The command's own words never become text of the shell.
    return ["/bin/bash", "-lc", f'{load} && exec "$@"', "bash", *words]


def find_marc(settings: MarcSettings) -> Path | None:
    """Return the path of run_marc, or None if only the shell with its modules knows it.

    InputError if the file that is named does not exist; SolverFailure if none is found.
    """
    if os.sep in settings.executable:
        return program_at(Path(os.path.expanduser(settings.executable)), "marc", "run_marc")
    if settings.modules:
        return _in_modules(settings)
    program = shutil.which(settings.executable)
    if program is None:
        raise SolverFailure(f"there is no {settings.executable} on the PATH; {ADVICE}", "marc")
    return Path(program)


def _in_modules(settings: MarcSettings) -> Path | None:
    """Return the path of run_marc in a shell that has loaded the modules; see `find_marc`."""
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


@dataclass(eq=False)
class MarcJobs:
    """The runs of Marc for one history, called as `MarcRun`.

    Attributes
    ----------
    settings : MarcSettings
    source : str or None
        Source of the user subroutine.
    parent : Path or None
        Folder in which the scratch folders are made.
    timeout : float or None, s
        Time after which a run is ended; that of the settings if it is None.
    on_progress : callable or None
        Called after every increment.
    files : mapping of str or bytes
        Further files of the scratch folders, by name.
    repeats : int
        Number of increments that were repeated in all runs.
    early : str
        Why the first run that stopped early did so, or "".
    """

    settings: MarcSettings
    source: str | None
    parent: Path | None
    timeout: float | None
    on_progress: Callable[[Progress], None] | None
    files: Mapping[str, str | bytes]
    repeats: int = 0
    early: str = ""

    def __call__(
        self,
        deck: str,
        units: int,
        read: Reader[T],
        rescue: Reader[T] | None = None,
    ) -> T:
        """Run a deck to the total time `units`; return what `read`, or `rescue`, returns for it.

        Parameters
        ----------
        deck : str
            Text of the deck.
        units : int
            Total time at the end of the deck.
        read, rescue : callable
            Read the results of a run that ended well, and of one in which Marc gave up.

        Raises
        ------
        SolverFailure
            If the run fails; it names the scratch folder, which is kept.
        LicenceDenied
            If a licence was denied.
        InputError
            If there is no such program.
        """
        settings = self.settings
        find_marc(settings)
        seconds = self.timeout or settings.timeout
        subroutine = None if self.source is None else SUBROUTINE
        with run_folder(NAME, self.parent, settings.keep, NAME, SCREEN) as folder:
            write_deck(folder, {**self.files, f"{JOB}.dat": deck, SUBROUTINE: self.source})
            sts = folder / f"{JOB}.sts"
            watch = None
            if self.on_progress is not None:
                watch = Watch(lambda: increments(sts), self.on_progress)
            outcome = run_process(
                run_command(settings, JOB, subroutine),
                folder,
                folder / SCREEN,
                seconds,
                settings.environment,
                watch,
            )
            set_earlier_aside(folder)
            end = ending(
                folder,
                JOB,
                SCREEN,
                outcome,
                timeout=seconds,
                time=float(units),
            )
            result = _results(folder / f"{JOB}.t19", end, read, rescue)
        self.repeats += end.repeated
        self.early = self.early or end.problem or ""
        return result


def _results(path: Path, end: Ending, read: Reader[T], rescue: Reader[T] | None) -> T:
    """Return what `read` makes of a result file, or `rescue` where Marc gave up; SolverFailure."""
    if end.problem is None:
        try:
            return read(path, end.iterations)
        except SolverFailure as failure:
            number = end.number if failure.exit_number is None else failure.exit_number
            raise SolverFailure(failure.reason, NAME, number, failure.log_tail) from None
    log.info("stopped early: %s", end.problem)
    try:
        if rescue is not None and end.collapse:
            return rescue(path, end.iterations)
    except SolverFailure as failure:
        # Why it stopped says more than what its results then lack.
        log.info("%s", failure.reason)
    kind = LicenceDenied if end.licence else SolverFailure
    raise kind(end.problem, NAME, end.number, end.excerpt)


def set_earlier_aside(folder: Path) -> None:
    """Rename files of Marc that are older than the deck, which a site's script may have copied."""
    start = (folder / f"{JOB}.dat").stat().st_mtime_ns
    for name in WRITTEN:
        path = folder / f"{JOB}.{name}"
        if path.is_file() and path.stat().st_mtime_ns < start:
            log.warning(
                "%s is older than the deck, and is left aside as %s", path, path.name + EARLIER
            )
            path.rename(path.with_name(path.name + EARLIER))
