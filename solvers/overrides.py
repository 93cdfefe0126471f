"""What the command line may say of solvers in place of a project's [solver.NAME]."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import InputError
from ..section_errors import first_error
from .registry import solver_sections
from .settings import Override

#: Any setting of any solver, those of plug-ins among them, as KEY=VALUE.
ANY = "solver-option"


def command_line() -> list[Override]:
    """The options there are, each once; its values say which are whose."""
    found: dict[str, Override] = {}
    values: dict[str, list[str]] = {}
    for name, section in solver_sections().items():
        for one in section.overrides:
            found.setdefault(one.name, one)
            if one.values:
                values.setdefault(one.name, []).append(f"{one.values} ({name})")
    return [
        replace(one, what=f"{one.what}: {', '.join(values[one.name])}.") if one.values else one
        for one in found.values()
    ]


def overridden(
    name: str,
    options: Mapping[str, Any],
    given: Mapping[str, Any],
    settings: Sequence[str] = (),
) -> dict[str, Any]:
    """The options of the solver `name` with what the command line says.

    Parameters
    ----------
    options : as `registry.solver_settings` has them.
    given : by the name of an option of `command_line`; None: not given.
    settings : each "KEY=VALUE", the value as in a project file (text needs no quotes); paths are
        from where we are.

    Raises
    ------
    InputError : an option of another solver; a setting that there is not.
    """
    mine = {option: value for option, value in given.items() if value is not None}
    for option in mine:
        if option not in options:
            raise InputError(None, f"--{option}", f"means nothing to the solver {name!r}")
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not (key and equals):
            raise InputError(None, f"--{ANY}", f"expected KEY=VALUE, got {setting!r}")
        mine[key.strip()] = _checked(name, key.strip(), _value(text))
    return {**options, **mine}


def _value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):  # beside its own, tomllib lets these through
        return text


def _checked(name: str, key: str, value: Any) -> Any:
    """A value of a solver of ours as its settings take it; that of a plug-in as it is."""
    section = solver_sections().get(name)
    if section is None:
        return value
    try:
        return section.model_validate({key: value}).given(Path.cwd())[key]
    except ValidationError as error:
        found = first_error(None, error, section)
        raise InputError(None, f"--{ANY} {found.field}", found.problem) from None
