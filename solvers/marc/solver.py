"""MSC Marc behind the solver protocol: a deck, a run of run_marc in a fresh folder, its results.

Outline: the solver, then one run: the command, the folder, how it ended.
"""

import logging
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable, Sequence
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
from ..decks import file_mark, in_words, templates_mark
from ..process import (
    WORDS,
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
from .deck import JOB, MarcRun, Reader
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
T = TypeVar("T")
#: What is done with each model.
ANALYSES: dict[type, Callable[[Any, HypoelasticLaw, MarcSettings, MarcRun], History]] = {
    BubbleModel: analyses.analyse_bubble,
    UniaxialModel: analyses.analyse_strip,
    CylinderModel: analyses.analyse_cylinder,
}


class MarcSolver:
    """A licensed MSC Marc; marc : run_marc or a site's .toml, else BUBBLEFIT_MARC, else PATH."""

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
        """Inflate, pull or bend the model; SolverFailure: names the folder; InputError."""
        settings = self.settings
        repeats = 0
        early = ""
        source: str | None = None
        if settings.law == "hypela2":
            own_state = settings.own_state
            symmetric = settings.symmetric
            source = hypela2_source({1: law}, own_state=own_state, symmetric=symmetric)
        parent = scratch or (None if settings.scratch is None else Path(settings.scratch))

        def once(deck: str, units: int, read: Reader[T], rescue: Reader[T] | None = None) -> T:
            nonlocal repeats, early
            job = deck, units, source, settings, read, rescue
            history, end = run_job(*job, parent, timeout, self.progress)
            repeats += end.repeated
            early = early or end.problem or ""
            return history

        history = analysis_of(ANALYSES, model, self.name)(model, law, settings, once)
        remarks = [*history.remarks]
        if early:
            remarks.append(Note(EARLY, early))
        if repeats:
            words = f"{repeats} increments were repeated after they did not converge"
            remarks.append(Note(REPEATED, words))
        reason = f"{history.early}: {early}" if history.early and early else history.early
        return replace(history, remarks=tuple(remarks), early=reason)


SECONDS = 600.0


def prove(solver: MarcSolver, timeout: float = SECONDS) -> tuple[float, ...]:
    """Return the end stresses (MPa) of BARS by this Marc; SolverFailure beyond TOLERANCE."""
    stresses = []
    for bar in BARS:
        # The table of the modulus ends with the bar: to the reach of a law without a range its
        # points would lie so far apart that the warp bar is 2e-4 off.
        end = np.full(3, float(np.log1p(bar.elongation)))
        model = bar_model(bar)
        law = replace(bar_law(bar.model), strain_range=end)
        stresses.append(stress_of(model, solver.run(model, law, timeout=timeout)))
    return checked_stresses(tuple(stresses), "this Marc", solver.name)


NAMED, FOUND = "named", "PATH"


def diagnose(named: Path | str | None = None) -> list[Diagnosis]:
    """Return one entry (`named`: the one to look at), none if it is neither there nor was named."""
    origin = NAMED if named is not None else VARIABLE if os.environ.get(VARIABLE) else FOUND
    expected = origin != FOUND
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
            "marc",
            version,
            path,
            origin,
            expected,
            None,
            stresses is not None,
            stresses,
            off,
            advice,
        )
    ]


# One run of Marc

ADVICE = (
    f"name run_marc in [solver.marc] executable, by --marc, or in {VARIABLE}; "
    "see `bubblefit docs marc`"
)
SECONDS = 60.0
log = logging.getLogger(__name__)

NAME, SCREEN, SUBROUTINE = "marc", "screen.txt", "hypela2.f"
#: What Marc writes and is read, and what is added to the name of a file that is too old to be.
WRITTEN, EARLIER = ("sts", "out", "log", "t19"), ".earlier"
Tell = Callable[[Progress], None]


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
        process = subprocess.run(
            ask, capture_output=True, timeout=SECONDS, stdin=subprocess.DEVNULL
        )
    if process is None or process.returncode != 0:
        lines = process.stderr.decode(errors="replace").strip().splitlines() if process else []
        reason = f" ({lines[-1]})" if lines else ""
        names = ", ".join(settings.modules)
        problem = f"modules {names} give no {settings.executable}{reason}; {ADVICE}"
        raise SolverFailure(problem, "marc")
    path = process.stdout.decode(errors="replace").strip().splitlines()
    return Path(path[-1]) if path else None


_EXIT = re.compile(r"exit\s++number\s*+:?\s*+(\d{1,9})(?!\d)", re.IGNORECASE)
COLUMNS = 13


def increments(sts: Path) -> list[Increment]:
    """Read increments of a .sts file, repeated ones too; lines not of 13 numbers are none."""
    rows = [row for row in number_rows(sts) if len(row) == COLUMNS]
    return [Increment(int(row[0]), int(row[1]), int(row[2]), row[10]) for row in rows]


def exit_number(*files: Path) -> int | None:
    """Return the last exit number (Marc's have four digits) in the first file with one, or None."""
    for file in files:
        numbers = _EXIT.findall(_text(file))
        if numbers:
            return int(numbers[-1])
    return None


def repeated(finished: list[Increment]) -> int:
    """Return how many increments were tried again after they did not converge."""
    numbers = [increment.increment for increment in finished]
    return len(numbers) - len(set(numbers))


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="latin-1").replace("\r\n", "\n")
    except OSError:
        return ""


NORMAL = 3004
NO_SMALLER = 3015
TURNED = 1005
#: Exit numbers that public sources explain; others are reported as they are.
MEANINGS = {
    NO_SMALLER: "the time step could not get smaller: no convergence",
    TURNED: "an element was turned inside out",
    3: "run_marc could not compile or link the user subroutine",
}
#: Total time that may be missing at the end: the .sts has few digits.
TIME_ROUNDING = 1e-3
_ERROR = re.compile(r"\*\*\*\s*error", re.IGNORECASE)
_INSIDE_OUT = re.compile(r"inside[ -]out(?:\s+at\s+element\s+(\d+))?", re.IGNORECASE)
_LICENCE = re.compile(r"licen[cs]e", re.IGNORECASE)
_REFUSED = re.compile(
    r"error|fail|denied|unable|could not|cannot|(not |un)available|exhausted|no such feature",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Ending:
    """The end of a job of Marc.

    Parameters
    ----------
    problem : str or None
        None when it ended well.
    number : int or None
        Marc's exit number.
    excerpt : str
        Lines of its logs that speak of an error.
    licence : bool
        Whether a licence was denied.
    iterations, repeated : int
        Of all increments; increments that were tried again.
    """

    problem: str | None
    number: int | None
    excerpt: str
    licence: bool
    iterations: int
    repeated: int

    @property
    def collapse(self) -> bool:
        """Return whether Marc itself gave up: what it wrote until then is a result."""
        is_step_too_small = self.problem is not None and self.problem.startswith(
            MEANINGS[NO_SMALLER]
        )
        return self.number == NO_SMALLER and is_step_too_small


def ending(
    folder: Path, job: str, screen: str, outcome: Outcome, timeout: float, time: float
) -> Ending:
    """Judge a job from its files: well is number 3004, the whole time, and no element inside out.

    Return codes are not looked at: scripts around Marc give any.

    Parameters
    ----------
    folder, job, screen : Path, str, str
        Folder, name of the job, and file with what run_marc printed.
    outcome : Outcome
        Of the process.
    timeout, time : float
        Seconds it may take; total time of the analysis at a good end.
    """
    finished = increments(folder / f"{job}.sts")
    log = folder / f"{job}.log"
    out = folder / f"{job}.out"
    number = exit_number(folder / f"{job}.sts", log, out, folder / screen)
    lines = LogLines.of([out, log, folder / screen])
    licence = bool(lines.refusals) and not finished and not outcome.timed_out
    problem = _problem_of_process(folder, job, outcome, timeout, finished, number, lines)
    if problem is None:
        problem = _problem_of_analysis(finished, number, time, lines)
    excerpt = "\n".join(lines.errors or lines.refusals) or log_tail(log)
    return Ending(
        problem,
        number,
        excerpt,
        licence and problem is not None,
        sum(increment.iterations for increment in finished),
        repeated(finished),
    )


def _reached(finished: Sequence[Increment]) -> str:
    """Return in words how far a job came."""
    if not finished:
        return "before the first increment"
    return f"after increment {finished[-1].increment}"


def _problem_of_process(
    folder: Path,
    job: str,
    outcome: Outcome,
    timeout: float,
    finished: Sequence[Increment],
    number: int | None,
    lines: "LogLines",
) -> str | None:
    """Return what ended the process from outside, or that it may not be Marc; None for neither."""
    reached = _reached(finished)
    if outcome.timed_out:
        return f"did not end within {timeout:g} s: killed {reached}"
    if lines.refusals and not finished and number != NORMAL:
        return f"no licence: {lines.refusals[0]}"
    full = disk_full(folder, lines.complaints, outcome)
    if full and number != NORMAL:
        return f"disk full {reached}: {full}"
    if outcome.exit_code < 0 or (outcome.signal_name and number is None):
        return f"killed by {outcome.signal_name} {reached}"
    if number is None:
        has_status = (folder / f"{job}.sts").exists()
        complaint = "said no exit number" if has_status else f"wrote no {job}.sts"
        return f"{complaint}, {reached}; run_marc returned {outcome.exit_code}: is this Marc?"
    return None


def _problem_of_analysis(
    finished: Sequence[Increment], number: int | None, time: float, lines: "LogLines"
) -> str | None:
    """Return what was wrong with the analysis; None where it came to its end."""
    reached = _reached(finished)
    if lines.inverted_element is not None:
        return f"an element was turned inside out{lines.inverted_element}, {reached}"
    if number != NORMAL:
        meaning = MEANINGS.get(number or 0, "did not end well")
        return f"{meaning}, {reached}"
    last = finished[-1].time if finished else 0.0
    if not finished or last < time - TIME_ROUNDING * max(1.0, time):
        return f"ended at time {last:g} of {time:g}, {reached}"
    return None


@dataclass
class LogLines:
    """Lines of Marc's logs that say what went wrong.

    Parameters
    ----------
    errors, refusals, complaints : lists of str
        Lines `*** error`, of a licence refused, of a full disk; the first few of each.
    inverted_element : str or None
        Which element was turned inside out, "" for one without a number; None for none.
    """

    errors: list[str] = field(default_factory=list)
    refusals: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)
    inverted_element: str | None = None

    @classmethod
    def of(cls, files: Sequence[Path]) -> "LogLines":
        """Read the files that are there."""
        lines = cls()
        for file in files:
            with suppress(OSError), file.open(encoding="latin-1") as text:
                for line in text:  # the .out of a long job is large
                    lines.add(line)
        return lines

    def add(self, line: str) -> None:
        """Keep a line where it belongs."""
        match = _INSIDE_OUT.search(line)
        if match is not None and self.inverted_element is None:
            self.inverted_element = f" (element {match[1]})" if match[1] else ""
        if any(words.lower() in line.lower() for words in WORDS):
            _keep(self.complaints, line)
        if _ERROR.search(line):
            _keep(self.errors, line)
        if _LICENCE.search(line) and _REFUSED.search(line):
            _keep(self.refusals, line)


def _keep(lines: list[str], line: str, largest_count: int = 12) -> None:
    """Add a line with single spaces unless it is there or there are enough."""
    plain = " ".join(line.split())
    if plain not in lines and len(lines) < largest_count:
        lines.append(plain)


def run_job(
    deck: str,
    time: int,
    source: str | None,
    settings: MarcSettings,
    read: Reader[T],
    rescue: Reader[T] | None = None,
    parent: Path | None = None,
    timeout: float | None = None,
    tell: Tell | None = None,
) -> tuple[T, Ending]:
    """Run a deck in a fresh scratch folder; return what `read` makes of its results.

    Parameters
    ----------
    deck, time : str, int
        Input, and its total time at the end.
    source : str or None
        Of a user subroutine.
    settings : MarcSettings
    read, rescue : functions of the result file and the number of iterations
        Of a run that ended well, and of one that stopped early.
    parent : Path, optional
        Where the folder is made.
    timeout : float, optional
        Seconds; those of the settings unless given.
    tell : function, optional
        Is told each increment.

    Raises
    ------
    SolverFailure
        Without a good end; it names the folder, which is kept.
    LicenceDenied
        If it never began.
    InputError
        For a Marc that is not there.
    """
    find_marc(settings)
    seconds = timeout or settings.timeout
    subroutine = None if source is None else SUBROUTINE
    with run_folder(NAME, parent, settings.keep, NAME, SCREEN) as folder:
        write_deck(folder, {f"{JOB}.dat": deck, SUBROUTINE: source})
        sts = folder / f"{JOB}.sts"
        results = folder / f"{JOB}.t19"
        watch = None if tell is None else Watch(lambda: increments(sts), tell)
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
