"""The options of `bubblefit gauge` that depend on each other."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ..errors import InputError
from ..experiments.curves import direction_named
from ..experiments.gauge_frames import PLAIN_COLUMNS

OF_LOADS = frozenset(
    "direction specimen load_column load_unit decimal"
    " frame_times frame_time_column frame_interval time_column time_offset".split()
)


def check_options(options: Mapping[str, Any]) -> None:
    """Refuse options that would have no effect or contradict each other.

    Raises
    ------
    InputError : naming the option.
    """
    given = {name for name, value in options.items() if value is not None}
    timed = given & {"frame_times", "frame_interval"}
    if "loads" not in given:
        _refuse(given & OF_LOADS, "--loads")
    elif "direction" not in given:
        problem = "this option is missing; a load curve needs it: warp, fill or bias"
        raise InputError(None, "--direction", problem)
    else:
        direction_named(options["direction"], field="--direction")
    if len(timed) > 1:
        raise InputError(None, "--frame-times, --frame-interval", "give one of them, not both")
    if not timed:
        _refuse(given & {"time_column", "time_offset"}, "--frame-times or --frame-interval")
    if "frame_times" not in given:
        _refuse(given & {"frame_time_column"}, "--frame-times")
    for name in ("max_gap", "frame_interval", "time_offset"):
        if name in given and not math.isfinite(options[name]):
            problem = f"expected a finite number, got {options[name]:g}"
            raise InputError(None, f"--{name.replace('_', '-')}", problem)
    specimen = options["specimen"]
    if specimen is not None and not (specimen.strip() and specimen.isprintable()):
        raise InputError(None, "--specimen", f"expected a name on one line, got {specimen!r}")


def _refuse(useless: set[str], needs: str) -> None:
    for name in sorted(useless):
        raise InputError(None, f"--{name.replace('_', '-')}", f"means nothing without {needs}")


def column_names(given: str | None) -> dict[str, str]:
    """Names in the files of x, y, z, dx, dy, dz; "x=X,dz=W" changes some of them.

    Raises
    ------
    InputError : not of this form, another quantity, one name for two.
    """
    names = dict(PLAIN_COLUMNS)
    for part in given.split(",") if given is not None else ():
        quantity, equals, name = (piece.strip() for piece in part.partition("="))
        if not (equals and name):
            problem = f"expected such as x=X,y=Y,z=Z,dx=U,dy=V,dz=W, got {part.strip()!r}"
            raise InputError(None, "--columns", problem)
        if quantity not in names:
            problem = f"unknown quantity {quantity!r}; expected {', '.join(names)}"
            raise InputError(None, "--columns", problem)
        names[quantity] = name
    for quantity, name in names.items():
        first = next(other for other in names if names[other] == name)
        if first != quantity:
            problem = f"column {name!r} is named for {first} and for {quantity}"
            raise InputError(None, "--columns", problem)
    return names
