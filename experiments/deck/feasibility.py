"""Conditions on the parameters of a deck, evaluated in the sandbox of templates."""

from collections.abc import Mapping

from ...errors import InputError
from ...storage.templates import template_environment


def holds(condition: str, values: Mapping[str, float]) -> bool:
    """Return whether a condition such as "C10 + C01 > 0" holds; an empty one always does.

    It does not hold where it has no value, as 1 / 0. Raise InputError where it is no condition.
    """
    import jinja2

    environment = template_environment(jinja2.BaseLoader())
    try:
        compiled = environment.compile_expression(condition or "true", undefined_to_none=False)
        return bool(compiled(**values))
    except (jinja2.TemplateError, TypeError) as error:
        problem = f"{condition!r}: {error}; there are: {', '.join(values)}"
        raise InputError(None, "feasible", problem) from None
    except ArithmeticError:
        return False
