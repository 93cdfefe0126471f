"""Text from Jinja2 templates, all read in one way: what they ask for must be there.

A template may be a user's own, or lie beside a project that somebody else wrote. All are rendered
in a sandbox: they reach no further than the values they are given, and change none of them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2
from jinja2.sandbox import ImmutableSandboxedEnvironment

TEMPLATES = Path(__file__).resolve().parent / "templates"


def environment(loader: jinja2.BaseLoader, html: bool = False) -> jinja2.Environment:
    """Where templates are found, and how they are read.

    html : whether values are escaped.
    """
    return ImmutableSandboxedEnvironment(
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
