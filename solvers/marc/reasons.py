"""What Marc's files say about how a job ended."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from ..disk import WORDS, disk_full
from ..process import Outcome, log_tail
from .sts import exit_number, increments, repeated

NORMAL, NO_SMALLER, TURNED = 3004, 3015, 1005
#: Exit numbers that public sources explain; others are reported as they are.
MEANINGS = {
    NO_SMALLER: "the time step could not get smaller: no convergence",
    TURNED: "an element was turned inside out",
    3: "run_marc could not compile or link the user subroutine",
}
#: Total time that may be missing at the end: the .sts has few digits.
NEAR = 1e-3
MOST_LINES = 12
_ERROR = re.compile(r"\*\*\*\s*error", re.IGNORECASE)
_INSIDE_OUT = re.compile(r"inside[ -]out(?:\s+at\s+element\s+(\d+))?", re.IGNORECASE)
_LICENCE = re.compile(r"licen[cs]e", re.IGNORECASE)
_REFUSED = re.compile(
    r"error|fail|denied|unable|could not|cannot|(not |un)available|exhausted|no such feature",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Ending:
    """How a job ended: `problem` in one line, None when well; what Marc said of it.

    licence: it never began, for want of a licence. iterations, repeated: of all increments.
    """

    problem: str | None
    number: int | None
    said: str
    licence: bool
    iterations: int
    repeated: int

    @property
    def collapse(self) -> bool:
        """Whether Marc itself gave up, its time step as small as it may be.

        What it wrote until then is a result that ends early; after any other bad end (killed, out
        of time, an element inside out) there is none.
        """
        said = self.problem is not None and self.problem.startswith(MEANINGS[NO_SMALLER])
        return self.number == NO_SMALLER and said


def ending(
    folder: Path, job: str, screen: str, outcome: Outcome, timeout: float, time: float
) -> Ending:
    """Judge a job from its files: well is number 3004, the whole time, and no element inside out.

    Parameters
    ----------
    screen : name of the file with what run_marc printed.
    timeout : s, that it had. time : total time at its end when it ends well.

    The return code of run_marc is not asked: scripts around Marc give any.
    """
    done = increments(folder / f"{job}.sts")
    number = exit_number(
        *(folder / f"{job}.{end}" for end in ("sts", "log", "out")), folder / screen
    )
    texts = [folder / f"{job}.out", folder / f"{job}.log", folder / screen]
    errors, licence_lines, turned, complaints = _lines(texts)
    full = disk_full(folder, complaints, outcome)
    reached = f"after increment {done[-1].increment}" if done else "before the first increment"
    licence = bool(licence_lines) and not done
    problem = None
    if outcome.timed_out:
        problem, licence = f"did not end within {timeout:g} s: killed {reached}", False
    elif licence and number != NORMAL:
        problem = f"no licence: {licence_lines[0]}"
    elif full and number != NORMAL:
        problem = f"disk full {reached}: {full}"
    elif outcome.exit_code < 0 or (outcome.signal_name and number is None):
        problem = f"killed by {outcome.signal_name} {reached}"
    elif number is None:
        what = "said no exit number" if (folder / f"{job}.sts").exists() else f"wrote no {job}.sts"
        problem = f"{what}, {reached}; run_marc returned {outcome.exit_code}: is this Marc?"
    elif turned is not None:
        problem = f"an element was turned inside out{turned}, {reached}"
    elif number != NORMAL:
        meaning = MEANINGS.get(number, "did not end well")
        problem = f"{meaning}, {reached}"
    elif not done or done[-1].time < time - NEAR * max(1.0, time):
        at = done[-1].time if done else 0.0
        problem = f"ended at time {at:g} of {time:g}, {reached}"
    said = "\n".join(errors or licence_lines) or log_tail(folder / f"{job}.log")
    return Ending(problem, number, said, licence and problem is not None,
                  sum(one.iterations for one in done), repeated(done))  # fmt: skip


def _lines(files: list[Path]) -> tuple[list[str], list[str], str | None, list[str]]:
    """`*** error` lines, refusals of a licence, which element was inside out ("" unknown), and
    complaints of a full disk.
    """
    errors: list[str] = []
    full: list[str] = []
    refusals: list[str] = []
    turned: str | None = None
    for file in files:
        try:
            # The .out of a long job is large: line by line.
            with file.open(encoding="latin-1") as text:
                for line in text:
                    found = _INSIDE_OUT.search(line)
                    if found is not None and turned is None:
                        turned = f" (element {found[1]})" if found[1] else ""
                    if any(words.lower() in line.lower() for words in WORDS):
                        _add(full, line)
                    if _ERROR.search(line):
                        _add(errors, line)
                    if _LICENCE.search(line) and _REFUSED.search(line):
                        _add(refusals, line)
        except OSError:
            continue
    return errors, refusals, turned, full


def _add(lines: list[str], line: str) -> None:
    text = " ".join(line.split())
    if text not in lines and len(lines) < MOST_LINES:
        lines.append(text)
