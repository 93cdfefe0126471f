"""The lines that a study of refinement prints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def lines(result: Mapping[str, Any]) -> list[str]:
    """From the numbers of `Refinement.result`."""
    words: list[str] = []
    for name, model in result["models"].items():
        head = list(model["quantities"])[-2:] or [""]
        words.append(f"{name}: {result['refined']} refined")
        words.append(f"{'quads':>9} {'steps':>6} {'seconds':>8}   " + "   ".join(head).rstrip())
        for level in model["levels"]:
            start = f"{level['elements']:9d} {level['increments']:6d} {level['seconds']:8.2f}   "
            own = "   (the project's own)" if level["factor"] == 1 else ""
            if level["values"] is None:
                words.append(start + f"failed: {level['failed']}{own}")
                continue
            numbers = [_number(level["values"].get(h), len(h)) for h in head if h]
            words.append((start + "   ".join(numbers) + own).rstrip())
        words += [_quantity(*item) for item in model["quantities"].items()]
        if "rms_N" in model:
            words.append(_rms(model["rms_N"]))
    return words


def _number(value: float | None, width: int) -> str:
    return f"{'-':<{width}}" if value is None else f"{value:<{width}.7g}"


def _quantity(name: str, found: Mapping[str, Any]) -> str:
    words = f"  {name}: {found['finest']:.7g} on the finest"
    if found["order"] is not None:
        words += f", order {found['order']:.2f}, limit {found['limit']:.7g}"
    if found["own_error"] is not None:
        percent, against = 100 * found["own_error"], found["own_error_against"]
        words += f"; the project's own is {percent:+.2g} % off the {against}"
    return words + (f" ({found['remark']})" if found["remark"] else "")


def _rms(found: Mapping[str, Any]) -> str:
    changes = ", ".join(f"{c:.3g}" for c in found["to_next_finer"])
    order = "" if found["order"] is None else f", order {found['order']:.2f}"
    return f"  RMS of the load to the next finer level: {changes} N{order}"
