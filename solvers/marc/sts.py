"""Marc's status file (.sts): how far a job is, and with which number it ended."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

_EXIT = re.compile(r"exit\s++number\s*+:?\s*+(\d{1,9})(?!\d)", re.IGNORECASE)
COLUMNS = 13


@dataclass(frozen=True)
class Increment:
    """One line of the .sts file: load case, increment, iterations, cut-backs, total time."""

    case: int
    increment: int
    iterations: int
    cut_backs: int
    time: float


def increments(sts: Path) -> list[Increment]:
    """Increments that ended so far, repeated ones as often as they are there.

    Half a line at the end is left for the next look; lines that are not of 13 numbers are the
    header and the end.
    """
    text = _text(sts)
    found = []
    for line in text[: text.rfind("\n") + 1].splitlines():
        parts = line.split()
        if len(parts) != COLUMNS:
            continue
        try:
            case, increment, cycles, _, cuts = (int(part) for part in parts[:5])
            found.append(Increment(case, increment, cycles, cuts, float(parts[10])))
        except ValueError:
            continue
    return found


def exit_number(*files: Path) -> int | None:
    """The last exit number in the first of the files that has one; None: it never ended.

    Of nine digits at most: Marc's have four.
    """
    for file in files:
        numbers = _EXIT.findall(_text(file))
        if numbers:
            return int(numbers[-1])
    return None


def repeated(done: list[Increment]) -> int:
    """How many increments were tried again after they did not converge."""
    numbers = [one.increment for one in done]
    return len(numbers) - len(set(numbers))


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="latin-1").replace("\r\n", "\n")
    except OSError:
        return ""
