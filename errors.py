"""Exceptions that bubblefit raises on purpose, whose messages say what to do next."""

import difflib
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

#: Unicode categories of characters that would break a line or control a terminal.
_UNSEEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}


class BubblefitError(Exception):
    """Base of every deliberate error; `exit_code` is what the command line returns."""

    exit_code = 2


class InputError(BubblefitError):
    """An input that cannot be used.

    Parameters
    ----------
    path : path or None
        The file of the input; None if it came from Python or the command line.
    field : str
        The key, column, line, argument or option; "" for the whole file.
    problem : str
        What is wrong, and what to do about it.
    """

    def __init__(self, path: Path | str | None, field: str, problem: str) -> None:
        self.path = path
        self.field = field
        self.problem = problem
        # The key of a damaged file may be as long as the file, so that it is cut.
        short_field = field if len(field) <= 200 else f"{field[:200]}..."
        place = ": ".join(str(part) for part in (path, short_field) if part)
        super().__init__(one_line(f"{place}: {problem}" if place else problem)[:4000])

    def __reduce__(self) -> tuple:
        # Exceptions cross process borders: rebuild from the fields, not from the text.
        return type(self), (self.path, self.field, self.problem)


class InputErrors(InputError):
    """Several errors of one input; as one line it is the first, with the number of the others.

    Parameters
    ----------
    errors : sequence of InputError
        At least one.
    """

    def __init__(self, errors: Sequence[InputError]) -> None:
        self.errors = tuple(errors)
        first = errors[0]
        remark = f" ({len(errors) - 1} more)" if len(errors) > 1 else ""
        super().__init__(first.path, first.field, first.problem + remark)

    def __reduce__(self) -> tuple:
        return type(self), (self.errors,)


class Problems:
    """Collect the errors of steps that do not depend on each other.

    Attributes
    ----------
    errors : list of InputError
    """

    def __init__(self) -> None:
        self.errors: list[InputError] = []

    @contextmanager
    def collected(self) -> Iterator[None]:
        """End the block at an InputError, which is kept."""
        try:
            yield
        except InputErrors as several:
            self.errors += several.errors
        except InputError as error:
            self.errors.append(error)

    def raise_if_any(self) -> None:
        """Raise the errors that were collected, if any: one as it is, several as InputErrors."""
        if len(self.errors) == 1:
            raise self.errors[0]
        if self.errors:
            raise InputErrors(self.errors)


def check_one_of(
    value: object, allowed: Iterable[object], field: str, path: Path | str | None = None
) -> None:
    """Check that a value is None or one of those that are allowed.

    Parameters
    ----------
    value : object
        The value.
    allowed : iterable
        The values allowed, all of which the error names.
    field : str
        Argument, key or option that holds the value.
    path : path, optional
        File that holds it.

    Raises
    ------
    InputError
        The value is not allowed.
    """
    allowed = list(allowed)
    if value is not None and value not in allowed:
        problem = f"expected one of {', '.join(map(str, allowed))}, got {value!r}"
        raise InputError(path, field, problem)


def did_you_mean(typed: object, names: Iterable[str]) -> str:
    """Return "; did you mean NAME?" with the name most similar to `typed`, or ""."""
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
    """An analysis that ended without a result.

    Parameters
    ----------
    reason : str
        Why it failed, in one line.
    solver : str
        Name of the solver.
    exit_number : int or None
        Exit number of another program.
    log_tail : str
        Last lines of that program's log.
    scratch : path or None
        Scratch folder that is kept.
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
        """Return the reason and the scratch folder, if that is kept, in one line."""
        return f"{self.reason}; scratch kept in {self.scratch}" if self.scratch else self.reason

    def __reduce__(self) -> tuple:
        fields = (self.reason, self.solver, self.exit_number, self.log_tail, self.scratch)
        return type(self), fields


class LicenceDenied(SolverFailure):
    """A failure of a program that found no free licence; another try may succeed."""


def one_line(text: str) -> str:
    """Return the text with escapes in place of characters that break a line or steer a terminal."""
    if text.isprintable():
        return text
    return "".join(
        c.encode("unicode_escape").decode() if unicodedata.category(c) in _UNSEEN else c
        for c in text
    )
