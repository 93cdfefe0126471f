"""Input decks from Jinja2 templates, ours or the user's."""

from __future__ import annotations

import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
from jinja2.sandbox import SandboxedEnvironment

from ..errors import InputError

OURS = Path(__file__).resolve().parent.parent / "templates"


def render(solver: str, name: str, context: Mapping[str, Any], folder: Path | None = None) -> str:
    """The deck that template `name` of `solver` makes of `context`.

    Parameters
    ----------
    folder : the user's own templates; `name` must be there, and may include or extend ours.

    Raises
    ------
    InputError : the template is not there or not readable; a variable that it asks for does not
        exist, a mistake in its syntax or its arithmetic: template, line and what is wrong.
    """
    folders = [OURS / solver]
    if folder is not None:
        if not (folder / name).is_file():
            problem = f"holds no {name}; copy {OURS / solver / name} there and change it"
            raise InputError(folder, "templates", problem)
        folders.insert(0, folder)
    environment = SandboxedEnvironment(
        loader=jinja2.FileSystemLoader(folders),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    environment.filters["number"] = _number
    try:
        return environment.get_template(name).render(context)
    except jinja2.TemplateSyntaxError as error:
        where = Path(error.filename or folders[0] / name)
        raise InputError(where, f"line {error.lineno}", error.message or "syntax error") from None
    except jinja2.TemplateNotFound as error:
        raise InputError(folders[0] / name, "include", f"no template {error.name}") from None
    except UnicodeDecodeError:
        raise InputError(folders[0] / name, "", "is not a text file in UTF-8") from None
    except Exception as error:  # whatever the template's expressions do
        where, line = _place(error, folders[0] / name)
        known = ""
        if isinstance(error, jinja2.UndefinedError):
            known = f"; there are: {', '.join(sorted(context))}"
        raise InputError(where, f"line {line}", f"{error}{known}") from None


def _number(value: float) -> str:
    """Shortest decimal of 13 digits: 0.81, not 0.8100000000000001.

    At most 20 characters: CalculiX reads no more, and would lose the end of an exponent.
    """
    return f"{value:.13g}"


def _place(error: BaseException, default: Path) -> tuple[Path, int]:
    """Template file and line where an error arose: Jinja2 puts them into the traceback."""
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        if frame.filename.endswith(".j2"):
            return Path(frame.filename), frame.lineno or 0
    return default, 0
