"""Errors that are raised on purpose; the message says what to do next."""

from __future__ import annotations

import difflib
import unicodedata
from collections.abc import Iterable
from pathlib import Path

#: Kinds of characters that would break a line, or steer a terminal.
_UNSEEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}


class BubblefitError(Exception):
    """Base of every deliberate error; `exit_code` is what the command line returns."""

    exit_code = 2


class InputError(BubblefitError):
    """An unusable input: its file or None; its key, column or line; what is wrong, what to do."""

    def __init__(self, path: Path | str | None, field: str, problem: str) -> None:
        self.path = path
        self.field = field
        self.problem = problem
        # A key may be as long as its file.
        short_field = field if len(field) <= 200 else f"{field[:200]}..."
        place = ": ".join(str(part) for part in (path, short_field) if part)
        super().__init__(one_line(f"{place}: {problem}" if place else problem)[:4000])

    def __reduce__(self) -> tuple:
        # Exceptions cross process borders: rebuild from the fields, not from the text.
        return type(self), (self.path, self.field, self.problem)


def check_one_of(
    value: object, allowed: Iterable[object], field: str, path: Path | str | None = None
) -> None:
    """Check that a value is one of those that are allowed, or None.

    Parameters
    ----------
    value : object
        The value.
    allowed : iterable
        What it may be; the error names all.
    field : str
        Argument, key or option that holds the value.
    path : path, optional
        File that holds it.

    Raises
    ------
    InputError
        It is none of them.
    """
    allowed = list(allowed)
    if value is not None and value not in allowed:
        problem = f"expected one of {', '.join(map(str, allowed))}, got {value!r}"
        raise InputError(path, field, problem)


def did_you_mean(typed: object, names: Iterable[str]) -> str:
    """Return a question with the most similar name; "" where none is similar."""
    matches = difflib.get_close_matches(str(typed), list(names), n=1, cutoff=0.5)
    return f"; did you mean {matches[0]!r}?" if matches else ""


class OutputError(BubblefitError):
    """An output folder that cannot be written (read-only, full, in use)."""


class PlugInFailure(BubblefitError):
    """A plug-in that does not work; the message names its distribution."""


class NoFeasibleStart(BubblefitError):
    """A search in which no random start inside the bounds satisfied the constraints."""

    exit_code = 3


class SolverFailure(BubblefitError):
    """An analysis without a result: one-line reason, exit number, log, scratch folder or None."""

    exit_code = 4

    def __init__(
        self,
        reason: str,
        solver: str = "membrane",
        exit_number: int | None = None,
        log_tail: str = "",
        scratch: Path | None = None,
    ) -> None:
        self.reason = reason
        self.solver = solver
        self.exit_number = exit_number
        self.log_tail = log_tail
        self.scratch = scratch
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
