"""Find the ccx to run, see if it can load material libraries, and judge how its run ended."""

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from ...errors import SolverFailure
from ...readers.sections import Positive
from ...storage.writing import cache_folder
from ..process import Increment, Outcome, disk_full, log_tail, number_rows, program_at
from ..settings import ExternalSettings, Override

VARIABLE = "BUBBLEFIT_CCX"
#: Origins of a ccx that somebody chose: there has to be nothing wrong with these.
NAMED = "named"
ENVIRONMENT = VARIABLE
BUILT = "make calculix"
ON_PATH = "PATH"
ADVICE = (
    "in bubblefit's repository, `make calculix` builds one; or name one by --ccx or BUBBLEFIT_CCX"
)
#: Words that only a ccx built with CALCULIX_EXTERNAL_BEHAVIOURS_SUPPORT has in it.
TRACE = b"empty library name"
SECONDS = 30.0


@dataclass(frozen=True)
class Executable:
    """A ccx; version "?": does not tell; external: loads libraries, None: not to be seen."""

    path: Path
    version: str
    external: bool | None
    origin: str


def find_ccx(named: Path | str | None = None) -> Executable:
    """Return `named`, else BUBBLEFIT_CCX, else the one `make calculix` built, else one on the PATH.

    What somebody named is taken or refused. InputError: it is no program. SolverFailure: there is
    none, or none that can load material libraries.
    """
    without = None
    for candidate in every_ccx(named):
        if candidate.external is not False:
            return candidate
        if candidate.origin in (NAMED, ENVIRONMENT):
            raise SolverFailure(
                f"{candidate.path} cannot load material libraries; {ADVICE}", "calculix"
            )
        without = without or candidate
    if without is not None:
        problem = f"no ccx that can load material libraries ({without.path} cannot); {ADVICE}"
        raise SolverFailure(problem, "calculix")
    raise SolverFailure(f"there is no ccx; {ADVICE}", "calculix")


def every_ccx(named: Path | str | None = None) -> list[Executable]:
    """Return all there are, each once, in the order in which `find_ccx` prefers them."""
    resolved_paths: set[Path] = set()
    executables = []
    for path, origin in _places(named):
        real = path.resolve()
        if real in resolved_paths:
            continue
        resolved_paths.add(real)
        executables.append(Executable(path, version_of(path), carries_external(path), origin))
    return executables


def carries_external(path: Path) -> bool | None:
    """Return whether a ccx can load material libraries; None when it is no binary to look into."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if not content.startswith(b"\x7fELF"):
        return None
    return TRACE in content


def version_of(path: Path) -> str:
    """Return what `ccx -v` says, "?" when it says nothing of the kind."""
    with suppress(OSError, subprocess.SubprocessError):
        process = subprocess.run(
            [path, "-v"], capture_output=True, timeout=SECONDS, stdin=subprocess.DEVNULL
        )
        version = re.search(rb"Version\s+(\S+)", process.stdout)
        if version:
            return version[1].decode(errors="replace")
    return "?"


def _places(named: Path | str | None) -> Iterator[tuple[Path, str]]:
    """Yield the programs that may be meant, and where they are from, the preferred first.

    They are named, then of the environment, then built by bubblefit, then on the PATH.
    """
    if named is not None:
        yield _program(named, "ccx"), NAMED
    chosen = os.environ.get(VARIABLE)
    if chosen:
        yield _program(chosen, VARIABLE), ENVIRONMENT
    built = (cache_folder() / "calculix").glob("ccx-*-external/ccx")
    # The newest first: a distribution that moves on leaves the older one behind.
    for path in sorted(built, key=lambda p: p.stat().st_mtime_ns, reverse=True):
        if _runs(path):
            yield path, BUILT
    for folder in os.environ.get("PATH", "").split(os.pathsep):
        if not folder:
            continue
        with suppress(OSError):
            for path in sorted(Path(folder).glob("ccx*")):
                if re.fullmatch(r"ccx(_[0-9][0-9.]*\w*)?", path.name) and _runs(path):
                    yield path, ON_PATH


def _program(path: Path | str, field: str) -> Path:
    """Return the path of a program that somebody named; a bare name is looked up on the PATH."""
    program = Path(os.path.expanduser(path))
    if os.sep not in str(path) and (on_path := shutil.which(program)):
        return Path(on_path)
    return program_at(program, field, "ccx")


def _runs(path: Path) -> bool:
    return path.is_file() and os.access(path, os.X_OK)


FINISHED = "Job finished"
_ERROR = re.compile(r"^\s*\*ERROR\b:?\s*(.*(?:\n {6,}\S.*)*)", re.MULTILINE)
_JACOBIAN = re.compile(r"nonpositive jacobian.*?element\s*(\d*)", re.IGNORECASE | re.DOTALL)
#: CalculiX' own word for an increment that it cannot make any smaller.
_GAVE_UP = re.compile(
    r"increment size smaller than minimum|too many cutbacks|best solution and residuals",
    re.IGNORECASE,
)
_TOO_SMALL = re.compile(rf"{_GAVE_UP.pattern}|max\. # of increments", re.IGNORECASE)


def increments(sta: Path) -> list[Increment]:
    """Read the increments of a .sta file so far, without attempts given up or half a line."""
    rows = [row for row in number_rows(sta) if len(row) >= 5]
    return [
        Increment(int(step), int(increment), int(iterations), time)
        for step, increment, _, iterations, time, *_ in rows
    ]


def reason(
    folder: Path,
    job: str,
    outcome: Outcome,
    timeout: float | None,
) -> str | None:
    """Return one line on why a run did not end well; None when it says that it did."""
    log = folder / f"{job}.log"
    text = log_tail(log, 400)
    finished = increments(folder / f"{job}.sta")
    reached = (
        f"after step {finished[-1].step}, increment {finished[-1].increment}"
        if finished
        else "at once"
    )
    if outcome.timed_out:
        return f"did not end within {timeout:g} s: killed {reached}"
    full = disk_full(folder, text.splitlines(), outcome)
    if full:
        return f"disk full {reached}: {full}"
    if outcome.signal_name:
        return f"killed by {outcome.signal_name} {reached}"
    jacobian = _JACOBIAN.search(text)
    if jacobian:
        where = f" in element {jacobian[1]}" if jacobian[1] else ""
        return f"negative Jacobian{where} {reached}"
    if _TOO_SMALL.search(text):
        at = (
            f"step {finished[-1].step}, increment {finished[-1].increment + 1}"
            if finished
            else "increment 1"
        )
        return f"did not converge at {at}: the increments became too small or too many"
    error = _ERROR.search(text)
    if error:
        return f"{' '.join(error[1].split())} ({reached})"
    if outcome.exit_code != 0:
        return f"ended badly {reached}"
    if FINISHED not in text:
        return f"ended without '{FINISHED}' {reached}: is this CalculiX?"
    return None


def collapsed(folder: Path, job: str, outcome: Outcome) -> bool:
    """Return whether CalculiX gave up: what converged is a result, unlike at other bad ends."""
    text = log_tail(folder / f"{job}.log", 400)
    if outcome.timed_out or outcome.signal_name or disk_full(folder, text.splitlines(), outcome):
        return False
    return _GAVE_UP.search(text) is not None and _JACOBIAN.search(text) is None


class CalculixSettings(ExternalSettings):
    """The settings of CalculiX; `CalculixSolver` says what each key means."""

    paths = ("templates", "scratch", "licence_folder")
    programs = started = ("ccx",)
    overrides = (
        Override(
            "ccx",
            "The CalculiX to run.",
            metavar="PATH",
            look="A CalculiX to look at beside the ones found.",
        ),
        Override("templates", "Folder of your own input decks.", metavar="PATH", path=True),
        Override("element", "Shell element", "S8R or S4"),
    )

    ccx: str | None = None
    templates: str | None = None
    element: Literal["S8R", "S4"] = "S8R"
    timeout: Positive = 3600.0
    scratch: str | None = None
    keep: bool = False
    threads: Annotated[int, Field(ge=1)] = 1
