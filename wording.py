"""Numbers and tables in words."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence


def distinct_numbers(a: float, b: float, digits: int = 3) -> tuple[str, str]:
    """Return two numbers as text, with more significant digits where they would look alike.

    Parameters
    ----------
    a, b : float
        The numbers.
    digits : int
        Significant digits that they have at least.

    Examples
    --------
    >>> distinct_numbers(21.96, 22.0), distinct_numbers(15.3, 10)
    (('21.96', '22'), ('15.3', '10'))
    """
    for count in range(digits, 10):  # beyond it, rounding
        pair = f"{a:.{count}g}", f"{b:.{count}g}"
        if pair[0] != pair[1]:
            break
    return pair


def percent(value: float) -> str:
    """Return a fraction as percent with two significant digits, whole from 100 % on."""
    return f"{100 * value:.0f} %" if value >= 0.995 else f"{100 * value:.2g} %"


def html_table(caption: str, header: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """Return a table for a notebook.

    Parameters
    ----------
    caption : str
        Above the table.
    header : sequence
        Titles of the columns.
    rows : iterable of sequences
        Cells, whose text is escaped as all others.
    """
    head = _html_row("th", header)
    body = "".join(_html_row("td", row) for row in rows)
    title = html.escape(caption)
    return f"<table><caption>{title}</caption><thead>{head}</thead><tbody>{body}</tbody></table>"


def _html_row(tag: str, cells: Sequence[object]) -> str:
    """Return a row of a table."""
    return f"<tr>{''.join(f'<{tag}>{html.escape(str(cell))}</{tag}>' for cell in cells)}</tr>"
