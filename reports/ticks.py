"""Round numbers along an axis, and how they are written."""

from __future__ import annotations

from math import ceil, floor, log10

#: About so many on an axis.
COUNT = 5
#: Of a decade of a logarithmic axis, where few decades are shown.
FINE = (1.0, 2.0, 5.0)


def ticks(low: float, high: float, count: int = COUNT) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten between the ends."""
    span = high - low
    if not span > 0:
        return [low]
    rough = span / count
    power = 10.0 ** floor(log10(rough))
    step = next(k * power for k in (1, 2, 5, 10) if k * power >= rough * (1 - 1e-9))
    first = ceil(low / step - 1e-9)
    return [k * step for k in range(first, floor(high / step + 1e-9) + 1)]


def log_ticks(low: float, high: float) -> list[float]:
    """Powers of ten between the ends, with 2 and 5 where there are fewer than three of them."""
    first, last = floor(log10(low) + 1e-9), ceil(log10(high) - 1e-9)
    decades = last - first
    every = max(1, ceil(decades / 7))
    parts = FINE if decades <= 3 else (1.0,)
    found = [k * 10.0**p for p in range(first, last + 1, every) for k in parts]
    return [v for v in found if low * (1 - 1e-9) <= v <= high * (1 + 1e-9)]


def written(value: float) -> str:
    """A tick's number, without the rounding of its multiplication."""
    if value == 0:
        return "0"
    small = f"{value:.4g}"
    if "e" in small:
        number, power = small.split("e")
        return f"{number}e{int(power)}"
    return small.replace("-", "\u2212")
