"""Text from Jinja2 templates, all read in one way: what they ask for must be there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2
from jinja2.sandbox import SandboxedEnvironment

TEMPLATES = Path(__file__).resolve().parent / "templates"


def environment(
    loader: jinja2.BaseLoader, html: bool = False, trusted: bool = True
) -> jinja2.Environment:
    """Where templates are found, and how they are read.

    html : whether values are escaped. trusted : whether the templates are ours; a user's own reach
    no further than the values they are given.
    """
    kind = jinja2.Environment if trusted else SandboxedEnvironment
    return kind(
        loader=loader,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=html,
    )


def render(template: str, /, **context: Any) -> str:
    """Text of `template` (a path below templates/).

    Raises
    ------
    jinja2.UndefinedError : the template asks for what the context does not have.
    """
    return environment(jinja2.FileSystemLoader(TEMPLATES)).get_template(template).render(context)
