"""Optimisers: one file each, one line each in the registry."""

from __future__ import annotations

from ...errors import InputError
from .base import FitOptions, Method
from .cobyla import Cobyla
from .lm import LevenbergMarquardt
from .slsqp import Slsqp

METHODS: dict[str, Method] = {
    "lm": LevenbergMarquardt(),
    "slsqp": Slsqp(),
    "cobyla": Cobyla(),
}


def method_named(name: str) -> Method:
    """The optimiser of that name.

    Raises
    ------
    InputError : there is none.
    """
    if name not in METHODS:
        raise InputError(None, "method", f"{name!r} is not one of {', '.join(METHODS)}")
    return METHODS[name]


__all__ = ["METHODS", "FitOptions", "Method", "method_named"]
