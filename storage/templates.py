"""Rendering of the Jinja templates of input decks and pages, in a sandbox."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .writing import TEMPLATES

if TYPE_CHECKING:
    import jinja2


class CompiledTemplates:
    """Templates that this process compiled, in the form of a memcached client for Jinja."""

    def __init__(self) -> None:
        self.codes: dict[str, bytes] = {}

    def get(self, key: str) -> bytes:
        """Return a compiled template; Jinja compiles it where that is a KeyError."""
        return self.codes[key]

    def set(self, key: str, value: bytes, timeout: int | None = None) -> None:
        """Keep a compiled template."""
        self.codes[key] = value


COMPILED = CompiledTemplates()


def template_environment(
    loader: jinja2.BaseLoader, *, escapes_html: bool = False
) -> jinja2.Environment:
    """Return a sandboxed Jinja environment in which a missing variable is an error.

    Parameters
    ----------
    loader : jinja2.BaseLoader
        Finds the templates.
    escapes_html : bool
        Whether inserted values are escaped for HTML.
    """
    import jinja2
    from jinja2.sandbox import ImmutableSandboxedEnvironment

    return ImmutableSandboxedEnvironment(
        loader=loader,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=escapes_html,
        bytecode_cache=jinja2.MemcachedBytecodeCache(COMPILED),
    )


def render(template: str, /, **context: Any) -> str:
    """Return the text of a template below templates/; a missing variable is an UndefinedError."""
    import jinja2

    environment = template_environment(jinja2.FileSystemLoader(TEMPLATES))
    return environment.get_template(template).render(context)
