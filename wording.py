"""Numbers as text, and tables as HTML for notebooks."""

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
    for count in range(digits, 10):  # further digits would show rounding errors
        pair = f"{a:.{count}g}", f"{b:.{count}g}"
        if pair[0] != pair[1]:
            break
    return pair


def percent(value: float) -> str:
    """Return a fraction in percent: two significant digits, or a whole number from 100 % on."""
    return f"{100 * value:.0f} %" if value >= 0.995 else f"{100 * value:.2g} %"


def html_table(caption: str, header: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """Return a table as HTML, as a notebook shows it.

    Parameters
    ----------
    caption : str
        Title above the table.
    header : sequence
        Titles of the columns.
    rows : iterable of sequences
        Cells of each row; all text is escaped.
    """
    head = _html_row("th", header)
    body = "".join(_html_row("td", row) for row in rows)
    title = html.escape(caption)
    return f"<table><caption>{title}</caption><thead>{head}</thead><tbody>{body}</tbody></table>"


def _html_row(tag: str, cells: Sequence[object]) -> str:
    """Return the HTML of a row whose cells have the tag "th" or "td"."""
    return f"<tr>{''.join(f'<{tag}>{html.escape(str(cell))}</{tag}>' for cell in cells)}</tr>"
