"""Frozen dataclasses that share their methods, for modules that every start imports.

Python compiles six methods of each frozen dataclass from text, 1 ms a class: a third of the time
of the first `read_project`, which imports 200. Here `__init__` alone is compiled.
"""

import dataclasses
import reprlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

T = TypeVar("T")


def light_dataclass(
    *,
    frozen: bool = False,
    eq: bool = True,
    repr: bool = True,
    **options: Any,
) -> Callable[[type[T]], type[T]]:
    """Return a decorator that does what `dataclasses.dataclass` does.

    Parameters
    ----------
    frozen, eq, repr, **options
        Those of `dataclasses.dataclass`. Classes that are not frozen, derive from a dataclass, or
        define equality themselves are left to it.
    """

    def decorate(cls: type[T]) -> type[T]:
        is_derived = any("__dataclass_fields__" in vars(base) for base in cls.__mro__[1:])
        if not frozen or is_derived or {"__eq__", "__hash__"} & vars(cls).keys():
            return dataclasses.dataclass(frozen=frozen, eq=eq, repr=repr, **options)(cls)
        methods = {"__setattr__": _set_once, "__delattr__": _refuse_deletion}
        if repr and "__repr__" not in vars(cls):
            methods["__repr__"] = _repr
        if eq:
            methods |= {"__eq__": _is_equal, "__hash__": _hash}
        for name, method in methods.items():
            setattr(cls, name, method)
        dataclasses.dataclass(eq=False, repr=False, **options)(cls)
        # So that a class that derives from this one is frozen, too.
        vars(cls)["__dataclass_params__"].frozen = True
        return cls

    return decorate


if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:
    dataclass = light_dataclass


def _set_once(instance: Any, name: str, value: object) -> None:
    """Set a field for the first time, in `__init__`, or another attribute of a plain subclass."""
    is_field = name in instance.__dataclass_fields__
    is_plain_subclass = "__dataclass_fields__" not in vars(type(instance))
    if name in vars(instance) if is_field else not is_plain_subclass:
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
    object.__setattr__(instance, name, value)


def _refuse_deletion(instance: Any, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


@reprlib.recursive_repr()
def _repr(instance: Any) -> str:
    shown = (field.name for field in dataclasses.fields(instance) if field.repr)
    values = ", ".join(f"{name}={getattr(instance, name)!r}" for name in shown)
    return f"{type(instance).__qualname__}({values})"


def _compared(instance: Any) -> tuple[object, ...]:
    """Return the values of the fields that count for equality."""
    return tuple(
        getattr(instance, field.name) for field in dataclasses.fields(instance) if field.compare
    )


def _is_equal(instance: Any, other: object) -> bool:
    if type(other) is not type(instance):
        return NotImplemented
    return _compared(instance) == _compared(other)


def _hash(instance: Any) -> int:
    return hash(_compared(instance))
