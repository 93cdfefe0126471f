"""Read times of a wall clock, such as "12.03.2021 14:02:11,500" or "2021-03-12T14:02:11.5Z"."""

import re
from collections.abc import Sequence
from contextlib import suppress
from datetime import date

import numpy as np
from numpy.typing import NDArray

HALF_A_DAY = 43200.0  # s
#: "12.03.2021 14:02:11,500", "2021-03-12T14:02:11.5Z", "2:02:11 PM".
_STAMP = re.compile(
    r"(?:(?P<date>\d{1,4}[./-]\d{1,2}[./-]\d{1,4})[T,]? ?)?"
    r"(?P<h>\d{1,2}):(?P<m>[0-5]\d):(?P<s>[0-5]\d(?:[.,]\d+)?)"
    r"(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?(?: ?(?:Z|UTC|[+-]\d\d:?\d\d))?"
)
#: Where year, month and day stand in a date: 2021-3-12, 12.3.2021, 3/12/2021.
_DATE_ORDERS = ((0, 1, 2), (2, 1, 0), (2, 0, 1))


def is_stamp(cell: str) -> bool:
    """Return whether a cell holds a time of a wall clock, with or without its date."""
    return bool(_STAMP.fullmatch(cell))


def seconds_of_stamps(cells: Sequence[str]) -> NDArray[np.float64]:
    """Return times (n,) in s since midnight of the first day; ValueError if dates are not valid."""
    stamps = [stamp for cell in cells if (stamp := _STAMP.fullmatch(cell)) is not None]
    clock = np.array([_seconds_of_day(stamp) for stamp in stamps])
    dates = [stamp["date"] for stamp in stamps]
    if not any(dates):
        # A clock without dates that falls by half a day has passed midnight.
        days = np.cumsum(np.diff(clock, prepend=clock[0]) < -HALF_A_DAY, dtype=np.intp)
    elif all(dates):
        days = _day_numbers(dates)
    else:
        raise ValueError("dates before some of the times only")
    return np.asarray(clock + 2 * HALF_A_DAY * days)


def _seconds_of_day(stamp: re.Match[str]) -> float:
    hour = int(stamp["h"])
    half = stamp["half"]
    if half:
        hour = hour % 12 + 12 * (half in "Pp")
    return 3600.0 * hour + 60.0 * int(stamp["m"]) + float(stamp["s"].replace(",", "."))


def _day_numbers(dates: Sequence[str]) -> NDArray[np.intp]:
    """Return the days (n,) since the first date.

    Where day and month may be in either order, the order that gives the shorter time is taken.
    """
    parts = [[int(part) for part in re.split("[./-]", text)] for text in dates]
    candidates = []
    for order in _DATE_ORDERS:
        with suppress(ValueError):
            days = [date(*(numbers[i] for i in order)).toordinal() for numbers in parts]
            candidates.append(np.array(days) - days[0])
    return min(candidates, key=np.ptp)
