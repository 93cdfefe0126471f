"""Errors that bubblefit raises on purpose. Each message says what to do next."""

from __future__ import annotations

import unicodedata
from pathlib import Path

#: Letters of a field and of a message that are shown: a key may be as long as its file.
LONGEST, LONGEST_LINE = 200, 4000
#: Kinds of characters that would break a line, or steer a terminal.
_UNSEEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}


class BubblefitError(Exception):
    """Base of every deliberate error; `exit_code` is what the command line returns."""

    exit_code = 2


class InputError(BubblefitError):
    """A project, card, mesh or data file that is not usable.

    path : the file at fault, or None when the input did not come from a file. field : the key,
    column or line at fault. problem : what is wrong, what was expected and what to do.
    """

    def __init__(self, path: Path | str | None, field: str, problem: str) -> None:
        self.path, self.field, self.problem = path, field, problem
        shown = field if len(field) <= LONGEST else f"{field[:LONGEST]}..."
        where = ": ".join(str(part) for part in (path, shown) if part)
        super().__init__(one_line(f"{where}: {problem}" if where else problem)[:LONGEST_LINE])

    def __reduce__(self) -> tuple:
        # Exceptions cross process borders: rebuild from the fields, not from the text.
        return type(self), (self.path, self.field, self.problem)


class OutputError(BubblefitError):
    """An output folder that cannot be written (read-only, full, in use)."""


class PlugInFailure(BubblefitError):
    """A plug-in that does not work; the message names its distribution."""


class NoFeasibleStart(BubblefitError):
    """A search in which no random start inside the bounds satisfied the constraints."""

    exit_code = 3


class SolverFailure(BubblefitError):
    """An analysis that did not end well; there is no result.

    reason : one line: what happened, at which load. exit_number : the solver's own, where it has
    one. log_tail : last lines of the solver's log. scratch : folder kept for inspection, or None.
    """

    exit_code = 4

    def __init__(
        self,
        reason: str,
        solver: str = "membrane",
        exit_number: int | None = None,
        log_tail: str = "",
        scratch: Path | None = None,
    ) -> None:
        self.reason, self.solver, self.exit_number = reason, solver, exit_number
        self.log_tail, self.scratch = log_tail, scratch
        text = f"{solver}: {reason}"
        if exit_number is not None:
            text += f" (exit number {exit_number})"
        if scratch is not None:
            text += f"; scratch kept in {scratch}"
        if log_tail:
            text += f"\n{log_tail}"
        super().__init__(text)

    @property
    def line(self) -> str:
        """Return the reason and the folder that is kept, without the log."""
        return f"{self.reason}; scratch kept in {self.scratch}" if self.scratch else self.reason

    def __reduce__(self) -> tuple:
        fields = (self.reason, self.solver, self.exit_number, self.log_tail, self.scratch)
        return type(self), fields


class LicenceDenied(SolverFailure):
    """A program that never began for want of a licence; another try may succeed."""


def one_line(text: str) -> str:
    """Return the text with escapes in place of characters that break a line or steer a terminal."""
    if text.isprintable():
        return text
    return "".join(
        c.encode("unicode_escape").decode() if unicodedata.category(c) in _UNSEEN else c
        for c in text
    )
