"""The solver MSC Marc: it writes decks, runs run_marc, judges how a job ended and reads results."""

import logging
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ...errors import BubblefitError, LicenceDenied, SolverFailure
from ...materials.exports.subroutines import hypela2_source
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.cylinder_model import CylinderModel
from ...meshes.strip_models import UniaxialModel
from ...notes import Note, NoteKind
from ..bars import BARS, bar_law, bar_model, checked_stresses, difference, stress_of
from ..base import EARLY, Diagnosis, History, Progress, SolverCheck, analysis_of
from ..decks import JOB, UserDeck, file_mark, in_words, templates_mark
from ..process import (
    DISK_FULL_MESSAGES,
    Increment,
    Outcome,
    Watch,
    disk_full,
    log_tail,
    number_rows,
    program_at,
    run_process,
)
from ..scratch import run_folder, write_deck
from ..settings import KEYS
from . import analyses
from .deck import MarcRun, Reader
from .settings import VARIABLE, MarcSettings, marc_settings

REPEATED = NoteKind("repeated increments")

#: Settings that change what the deck or the subroutine says, or what Marc makes of them.
MATTERING = (
    "law",
    "element",
    "increments",
    "pressure_type",
    "pressure_sign",
    "own_state",
    "symmetric",
    "arguments",
)


def analyse_user_deck(
    model: UserDeck,
    law: HypoelasticLaw,
    settings: MarcSettings,
    run: MarcRun,
) -> History:
    """Run a deck of the user's; SolverFailure if the run fails or its results lack a value."""
    deck = str(model.files[f"{JOB}.dat"])
    return run(deck, 0, lambda t19, iterations: model.reader.read(t19.parent))


#: Analyses by the class of the model.
ANALYSES: dict[type, Callable[[Any, HypoelasticLaw, MarcSettings, MarcRun], History]] = {
    BubbleModel: analyses.analyse_bubble,
    UniaxialModel: analyses.analyse_strip,
    CylinderModel: analyses.analyse_cylinder,
    UserDeck: analyse_user_deck,
}


class MarcSolver:
    """Solver that runs a licensed MSC Marc.

    Parameters
    ----------
    marc : Path or str or None
        run_marc, or a site's .toml file of settings; unless given, by the environment variable
        BUBBLEFIT_MARC, else on the PATH.
    settings : object
        See `MarcSettings`.
    """

    name = "marc"
    external = True

    def __init__(
        self,
        marc: Path | str | None = None,
        progress: Callable[[Progress], None] | None = None,
        **settings: Any,
    ) -> None:
        self.settings: MarcSettings = marc_settings(settings, None if marc is None else str(marc))
        self.progress = progress

    @property
    def identity(self) -> str:
        """Return the settings of the deck; the site's templates and blocks by what is in them."""
        settings = self.settings
        return in_words(
            self.name,
            settings.version,
            **{name: getattr(settings, name) for name in MATTERING},
            include={name: file_mark(Path(file)) for name, file in settings.include.items()},
            templates=templates_mark(
                None if settings.templates is None else Path(settings.templates)
            ),
        )

    @property
    def programs(self) -> tuple[Path, ...]:
        """Return run_marc; none where only the site's modules know where it is."""
        program = find_marc(self.settings)
        return () if program is None else (program,)

    @property
    def keep(self) -> bool:
        """Return whether the folders of runs that end well stay."""
        return self.settings.keep

    @property
    def site_licences(self) -> dict[str, Any]:
        """Return what the site's file says of licences; the project's own words count more."""
        return {
            key: getattr(self.settings, key)
            for key in KEYS
            if key in self.settings.model_fields_set
        }

    def check(self) -> SolverCheck:
        """Return whether there is a run_marc; that it carries the law, `doctor` shows."""
        try:
            find_marc(self.settings)
        except SolverFailure as failure:
            return SolverCheck(self.name, False, self.settings.version, False, failure.reason)
        return SolverCheck(self.name, True, self.settings.version, True)

    def run(
        self,
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
    ) -> History:
        """Run the analysis of a model and return its history; see `Solver.run`.

        SolverFailure of a failed run names its scratch folder. InputError for a model, a law or a
        template that cannot be used.
        """
        settings = self.settings
        files = dict[str, Any]()
        source: str | None = None
        if isinstance(model, UserDeck):
            files |= model.files
            source = files.get(SUBROUTINE)
            timeout = timeout or model.timeout
        elif settings.law == "hypela2":
            own_state = settings.own_state
            symmetric = settings.symmetric
            source = hypela2_source({1: law}, own_state=own_state, symmetric=symmetric)
        parent = scratch or (None if settings.scratch is None else Path(settings.scratch))
        jobs = MarcJobs(
            settings,
            source,
            parent,
            timeout=timeout,
            on_progress=self.progress,
            files=files,
        )
        history = analysis_of(ANALYSES, model, self.name)(model, law, settings, jobs)
        early = jobs.early
        remarks = [*history.remarks]
        if early:
            remarks.append(Note(EARLY, early))
        if jobs.repeats:
            words = f"{jobs.repeats} increments were repeated after they did not converge"
            remarks.append(Note(REPEATED, words))
        reason = f"{history.early}: {early}" if history.early and early else history.early
        return replace(history, remarks=tuple(remarks), early=reason)


T = TypeVar("T")

ADVICE = (
    f"name run_marc in [solver.marc] executable, by --marc, or in {VARIABLE}; "
    "see `bubblefit docs marc`"
)

log = logging.getLogger(__name__)

#: Names of files of a run: the output of run_marc, and the source of the user subroutine.
SCREEN = "screen.txt"

SUBROUTINE = "hypela2.f"

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
    # Jobs run in folders of their own.
    program = settings.executable
    if os.sep in program:
        program = os.path.abspath(os.path.expanduser(program))
    words = [program, "-jid" if older else "-j", job, "-v", "no", "-b", "no"]
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
        with run_folder("marc", self.parent, settings.keep, "marc", SCREEN) as folder:
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


def set_earlier_aside(folder: Path) -> None:
    """Rename files of Marc that are older than the deck, which a site's script may have copied."""
    start = (folder / f"{JOB}.dat").stat().st_mtime_ns
    for name in ("sts", "out", "log", "t19"):  # what is read of Marc's files
        path = folder / f"{JOB}.{name}"
        if path.is_file() and path.stat().st_mtime_ns < start:
            log.warning(
                "%s is older than the deck, and is left aside as %s", path, path.name + EARLIER
            )
            path.rename(path.with_name(path.name + EARLIER))


NORMAL = 3004  #: exit number of a job that ended well

NO_SMALLER = 3015  #: of one that gave up

#: Exit numbers that public sources explain; others are reported as they are.
MEANINGS = {
    NO_SMALLER: "the time step could not get smaller: no convergence",
    1005: "an element was turned inside out",
    3: "run_marc could not compile or link the user subroutine",
}


def increments(sts: Path) -> list[Increment]:
    """Read the increments of a .sts file, including repeated ones: lines of 13 numbers."""
    read = []
    for row in number_rows(sts):
        if len(row) == 13:
            step, increment, cycles = map(int, row[:3])
            read.append(Increment(step, increment, cycles, row[10]))
    return read


def exit_number(*files: Path) -> int | None:
    """Return the last exit number (Marc's have four digits) in the first file with one, or None."""
    pattern = re.compile(r"exit\s++number\s*+:?\s*+(\d{1,9})(?!\d)", re.IGNORECASE)
    for file in files:
        numbers = pattern.findall(_text(file))
        if numbers:
            return int(numbers[-1])
    return None


def repeated(finished: list[Increment]) -> int:
    """Return how many increments were tried again after they did not converge."""
    numbers = [increment.increment for increment in finished]
    return len(numbers) - len(set(numbers))


def _text(file: Path) -> str:
    """Return the text of a file; "" if it cannot be read."""
    try:
        return file.read_text(encoding="latin-1").replace("\r\n", "\n")
    except OSError:
        return ""


@dataclass(frozen=True)
class Ending:
    """The end of a job.

    Attributes
    ----------
    problem : str or None
        Why it did not end well; None if it did.
    number : int or None
        Marc's exit number.
    excerpt : str
        Lines of its files that say why.
    licence : bool
        Whether a licence was denied.
    iterations, repeated : int
        Number of iterations in all, and number of increments that were repeated.
    """

    problem: str | None
    number: int | None
    excerpt: str
    licence: bool
    iterations: int
    repeated: int

    @property
    def collapse(self) -> bool:
        """Return whether Marc gave up for want of convergence: its results until then are valid."""
        is_step_too_small = self.problem is not None and self.problem.startswith(
            MEANINGS[NO_SMALLER]
        )
        return self.number == NO_SMALLER and is_step_too_small


@dataclass
class Complaints:
    """Lines of a job's files that report errors, each once and at most `max_lines` of a kind.

    Attributes
    ----------
    errors, licence, disk : list of str
        Lines on errors, on refused licences and on a full disk.
    inverted_element : str or None
        Which element was turned inside out, " (element 7)", or "" if that is not known; None if
        none was.
    """

    errors: list[str] = field(default_factory=list)
    licence: list[str] = field(default_factory=list)
    disk: list[str] = field(default_factory=list)
    inverted_element: str | None = None
    max_lines: int = 12

    _error = re.compile(r"\*\*\*\s*error", re.IGNORECASE)
    _inside_out = re.compile(r"inside[ -]out(?:\s+at\s+element\s+(\d+))?", re.IGNORECASE)
    _licence = re.compile(r"licen[cs]e", re.IGNORECASE)
    _refused = re.compile(
        r"error|fail|denied|unable|could not|cannot|(not |un)available|exhausted|no such feature",
        re.IGNORECASE,
    )

    @classmethod
    def of_files(cls, files: list[Path]) -> "Complaints":
        """Return the complaints in files, of which some may not exist."""
        complaints = cls()
        for file in files:
            with suppress(OSError), file.open(encoding="latin-1") as text:
                for line in text:  # the .out of a long job is large
                    complaints.add(line)
        return complaints

    def add(self, line: str) -> None:
        """Keep a line if it complains."""
        match = self._inside_out.search(line)
        if match is not None and self.inverted_element is None:
            self.inverted_element = f" (element {match[1]})" if match[1] else ""
        if any(words.lower() in line.lower() for words in DISK_FULL_MESSAGES):
            self._keep(line, self.disk)
        if self._error.search(line):
            self._keep(line, self.errors)
        if self._licence.search(line) and self._refused.search(line):
            self._keep(line, self.licence)

    def _keep(self, line: str, lines: list[str]) -> None:
        plain = " ".join(line.split())
        if plain not in lines and len(lines) < self.max_lines:
            lines.append(plain)


@dataclass(frozen=True)
class JobState:
    """State of a job after its end.

    Attributes
    ----------
    folder, job : Path
        Where its files are, and their name without the ending.
    outcome : Outcome
        Of the process.
    increments : list of Increment
        Those that converged.
    number : int or None
        Marc's exit number.
    full_disk : str
        A sign that the disk was full, or "".
    """

    folder: Path
    job: str
    outcome: Outcome
    increments: list[Increment]
    number: int | None
    complaints: Complaints
    full_disk: str

    @property
    def reached(self) -> str:
        if not self.increments:
            return "before the first increment"
        return f"after increment {self.increments[-1].increment}"

    @property
    def lacks_licence(self) -> bool:
        return bool(self.complaints.licence) and not self.increments

    def stopped_from_outside(self, timeout: float) -> str | None:
        """Return what ended the job from outside (time, licence, disk, signal), or None.

        Parameters
        ----------
        timeout : float
            Time in s after which it was ended.
        """
        outcome = self.outcome
        if outcome.timed_out:
            return f"did not end within {timeout:g} s: killed {self.reached}"
        if self.lacks_licence and self.number != NORMAL:
            return f"no licence: {self.complaints.licence[0]}"
        if self.full_disk and self.number != NORMAL:
            return f"disk full {self.reached}: {self.full_disk}"
        if outcome.exit_code < 0 or (outcome.signal_name and self.number is None):
            return f"killed by {outcome.signal_name} {self.reached}"
        return None

    def problem_of_marc(self, time: float) -> str | None:
        """Return why the job did not end well, from what Marc wrote, or None if it did.

        Parameters
        ----------
        time : float
            The total time at the end of the deck.
        """
        if self.number is None:
            has_status = (self.folder / f"{self.job}.sts").exists()
            complaint = "said no exit number" if has_status else f"wrote no {self.job}.sts"
            code = self.outcome.exit_code
            return f"{complaint}, {self.reached}; run_marc returned {code}: is this Marc?"
        inverted_element = self.complaints.inverted_element
        if inverted_element is not None:
            return f"an element was turned inside out{inverted_element}, {self.reached}"
        if self.number != NORMAL:
            meaning = MEANINGS.get(self.number, "did not end well")
            return f"{meaning}, {self.reached}"
        end = self.increments[-1].time if self.increments else 0.0
        # The .sts has few digits.
        if not self.increments or end < time - 1e-3 * max(1.0, time):
            return f"ended at time {end:g} of {time:g}, {self.reached}"
        return None


def ending(
    folder: Path,
    job: str,
    screen: str,
    outcome: Outcome,
    timeout: float,
    time: float,
) -> Ending:
    """Judge from its files how a job ended.

    It ended well with the exit number 3004, at the whole time, and without an element turned inside
    out. The return code is not used, as scripts around Marc may return any.

    Parameters
    ----------
    folder : Path
    job : str
        Name of its files, without the ending.
    screen : str
        File with what run_marc printed.
    outcome : Outcome
    timeout : float, s
    time : float
        Total time at the end of the deck.

    Returns
    -------
    Ending
    """
    finished = increments(folder / f"{job}.sts")
    number = exit_number(
        *(folder / f"{job}.{suffix}" for suffix in ("sts", "log", "out")), folder / screen
    )
    texts = [folder / f"{job}.out", folder / f"{job}.log", folder / screen]
    complaints = Complaints.of_files(texts)
    full_disk = disk_full(folder, complaints.disk, outcome)
    state = JobState(
        folder,
        job,
        outcome,
        finished,
        number,
        complaints,
        full_disk,
    )
    problem = state.stopped_from_outside(timeout) or state.problem_of_marc(time)
    excerpt = "\n".join(complaints.errors or complaints.licence)
    return Ending(
        problem,
        number,
        excerpt or log_tail(folder / f"{job}.log"),
        state.lacks_licence and not outcome.timed_out and problem is not None,
        sum(increment.iterations for increment in finished),
        repeated(finished),
    )


def _results(path: Path, end: Ending, read: Reader[T], rescue: Reader[T] | None) -> T:
    """Return what `read` makes of a result file, or `rescue` where Marc gave up; SolverFailure."""
    if end.problem is None:
        try:
            return read(path, end.iterations)
        except SolverFailure as failure:
            number = end.number if failure.exit_number is None else failure.exit_number
            raise SolverFailure(failure.reason, "marc", number, failure.log_tail) from None
    log.info("stopped early: %s", end.problem)
    try:
        if rescue is not None and end.collapse:
            return rescue(path, end.iterations)
    except SolverFailure as failure:
        # Why it stopped says more than what its results then lack.
        log.info("%s", failure.reason)
    kind = LicenceDenied if end.licence else SolverFailure
    raise kind(end.problem, "marc", end.number, end.excerpt)


def prove(solver: MarcSolver, timeout: float = 600.0) -> tuple[float, ...]:
    """Return the stresses (MPa) at the ends of the published bars BARS, computed by this Marc.

    SolverFailure if one is off by more than TOLERANCE.
    """
    stresses = []
    for bar in BARS:
        # The table of the modulus ends with the bar: to the reach of a law without a range its
        # points would lie so far apart that the warp bar is 2e-4 off.
        end = np.full(3, np.log1p(bar.elongation))
        model = bar_model(bar)
        law = replace(bar_law(bar.model), strain_range=end)
        stresses.append(stress_of(model, solver.run(model, law, timeout=timeout)))
    return checked_stresses(tuple(stresses), "this Marc", solver.name)


ON_PATH = "PATH"


def diagnose(named: Path | str | None = None) -> list[Diagnosis]:
    """Return the diagnosis of Marc in a list, which is empty if it is neither found nor named.

    Parameters
    ----------
    named
        run_marc or a site's .toml file to be tried.
    """
    origin = "named" if named is not None else VARIABLE if os.environ.get(VARIABLE) else ON_PATH
    expected = origin != ON_PATH
    path = None
    stresses = None
    off = None
    advice = ""
    version = ""
    try:
        solver = MarcSolver(named)
        version = solver.settings.version or "?"
        path = find_marc(solver.settings)
        stresses = prove(solver)
        off = difference(stresses)
    except BubblefitError as error:
        if path is None and not expected:
            return []
        advice = str(error).splitlines()[0]
    return [
        Diagnosis(
            name="marc",
            version=version,
            path=path,
            origin=origin,
            expected=expected,
            usable=stresses is not None,
            stresses=stresses,
            difference=off,
            advice=advice,
        )
    ]
