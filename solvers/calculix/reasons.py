"""What CalculiX's files say about how far it came and why it stopped."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from ..disk import disk_full
from ..process import Outcome, log_tail

FINISHED = "Job finished"
_ERROR = re.compile(r"^\s*\*ERROR\b:?\s*(.*(?:\n {6,}\S.*)*)", re.MULTILINE)
_JACOBIAN = re.compile(r"nonpositive jacobian.*?element\s*(\d*)", re.IGNORECASE | re.DOTALL)
_TOO_SMALL = re.compile(
    r"increment size smaller than minimum|max\. # of increments|too many cutbacks", re.IGNORECASE
)

#: CalculiX' own word for an increment that it cannot make any smaller.
_GAVE_UP = re.compile(r"increment size smaller than minimum|too many cutbacks", re.IGNORECASE)


@dataclass(frozen=True)
class Increment:
    """One line of the .sta file: step and increment, its attempt, iterations, total time."""

    step: int
    increment: int
    attempt: int
    iterations: int
    time: float


def increments(sta: Path) -> list[Increment]:
    """Increments that converged so far; half a line at the end is left for the next look.

    Attempts that were given up are marked with a U in the file and left out here.
    """
    try:
        text = sta.read_text(encoding="ascii", errors="replace")
    except OSError:
        return []
    found = []
    for line in text[: text.rfind("\n") + 1].splitlines():
        parts = line.split()
        try:
            step, increment, attempt, iterations = (int(part) for part in parts[:4])
            found.append(Increment(step, increment, attempt, iterations, float(parts[4])))
        except (ValueError, IndexError):
            continue  # the two header lines
    return found


def reason(folder: Path, job: str, outcome: Outcome, timeout: float | None) -> str | None:
    """One line on why a run did not end well; None when it says that it did."""
    log = folder / f"{job}.log"
    text = log_tail(log, 400)
    done = increments(folder / f"{job}.sta")
    reached = f"after step {done[-1].step}, increment {done[-1].increment}" if done else "at once"
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
        at = f"step {done[-1].step}, increment {done[-1].increment + 1}" if done else "increment 1"
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
    """Whether CalculiX itself gave up, its increment as small as it may be.

    What converged until then is a result that ends early. After any other bad end (killed, out of
    time, disk full, an element inside out, an error) there is none.
    """
    text = log_tail(folder / f"{job}.log", 400)
    if outcome.timed_out or outcome.signal_name or disk_full(folder, text.splitlines(), outcome):
        return False
    return _GAVE_UP.search(text) is not None and _JACOBIAN.search(text) is None
