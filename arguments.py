"""Checks of the arguments of public functions against their type annotations, call by call.

Pydantic's `validate_call` does not serve: strict, it refuses numbers of numpy as `int`, and arrays
and columns of pandas as sequences; lenient, it takes True and "3" for numbers; it cannot check
protocols, hands over copies of sequences, and names a union member by member.
"""

import functools
import inspect
import re
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ParamSpec, TypeVar

from .errors import InputError
from .light_dataclasses import dataclass

P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class AtLeast:
    """A limit in an annotation: the argument must be an integer of `smallest` or more."""

    smallest: int


#: Annotations of integer arguments with a smallest value.
Positive = typing.Annotated[int, AtLeast(1)]
NotNegative = typing.Annotated[int, AtLeast(0)]
TwoOrMore = typing.Annotated[int, AtLeast(2)]
#: What an error says about getting an argument, by the words that describe its annotation.
_ADVICE = {
    "Project": "; read_project(FILE) reads one",
    "Test | Definition": "; project.tests[NAME] is one",
    "MaterialCard": "; read_card(FILE) reads one",
}
_annotations = functools.cache(functools.partial(typing.get_type_hints, include_extras=True))


def checked_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """Check the arguments of every call against the annotations of a function.

    Parameters
    ----------
    function : callable
        Numbers and sequences may be those of numpy and pandas; True is no number, and a text no
        sequence of texts.

    Returns
    -------
    callable
        The function, which raises InputError with the name of the first argument that is wrong.
    """
    signature = inspect.signature(function)

    @functools.wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        annotations = _annotations(function)
        for name, value in signature.bind(*args, **kwargs).arguments.items():
            if name in annotations and not _fits(value, annotations[name]):
                expected = _describe(annotations[name])
                problem = f"expected {expected}, got {repr(value)[:60]}"
                raise InputError(None, name, problem + _ADVICE.get(expected, ""))
        return function(*args, **kwargs)

    return wrapped


def _describe(annotation: Any) -> str:
    """Return what an annotation allows in words for an error, without names of modules and None."""
    origin = typing.get_origin(annotation)
    parts = typing.get_args(annotation)
    if origin is typing.Annotated and isinstance(parts[1], AtLeast):
        return f"{_describe(parts[0])} of {parts[1].smallest} or more"
    if origin is typing.Literal:
        return f"one of {', '.join(map(repr, parts))}"
    if origin in (typing.Union, types.UnionType):
        return " | ".join(_describe(part) for part in parts if part is not types.NoneType)
    return re.sub(r"\b(\w+\.)+(?=\w)", "", inspect.formatannotation(annotation))


def _fits(value: Any, annotation: Any) -> bool:
    """Return whether a value fits an annotation, with the items of sequences and mappings."""
    origin = typing.get_origin(annotation)
    if origin in _CHECKS:
        return _CHECKS[origin](value, *typing.get_args(annotation))
    if annotation is Any:
        return True
    if annotation in (int, float):
        return _is_number(value, annotation)
    return _is_instance(value, origin or annotation)


def _fits_union(value: Any, *members: Any) -> bool:
    return any(_fits(value, member) for member in members)


def _fits_limit(value: Any, annotation: Any, limit: object) -> bool:
    """Return whether a value fits an annotation and is not below its limit, if it has one."""
    return _fits(value, annotation) and not (isinstance(limit, AtLeast) and value < limit.smallest)


def _fits_sequence(value: Any, item: Any) -> bool:
    is_sequence = hasattr(value, "__len__") and not isinstance(value, (str, bytes, Mapping))
    return is_sequence and all(_fits(element, item) for element in value)


def _fits_mapping(value: Any, key: Any, item: Any) -> bool:
    return isinstance(value, Mapping) and all(
        _fits(name, key) and _fits(element, item) for name, element in value.items()
    )


def _is_number(value: Any, number: type) -> bool:
    """Return whether a value may be used as an int or a float; True, for Python an int, may not."""
    is_truth = type(value).__name__ in ("bool", "bool_")
    method = "__index__" if number is int else "__float__"
    return hasattr(value, method) and not is_truth


def _is_instance(value: Any, annotation: Any) -> bool:
    """Return whether a value is of a class; of a protocol, whether it has one of its methods.

    A plug-in's object may have some of the methods only.
    """
    if getattr(annotation, "_is_protocol", False):
        methods = [name for name, member in vars(annotation).items() if inspect.isfunction(member)]
        return any(hasattr(value, name) for name in methods if not name.startswith("_"))
    return isinstance(value, annotation) if isinstance(annotation, type) else True


_CHECKS: dict[Any, Callable[..., bool]] = {
    typing.Union: _fits_union,
    types.UnionType: _fits_union,
    typing.Annotated: _fits_limit,
    typing.Literal: lambda value, *choices: value in choices,
    Sequence: _fits_sequence,
    Mapping: _fits_mapping,
}
