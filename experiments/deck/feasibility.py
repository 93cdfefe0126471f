"""Conditions on the parameters of a deck, evaluated in the sandbox of templates.

Those that are linear are inequalities of the optimiser as well.
"""

import ast
from collections.abc import Mapping, Sequence

import numpy as np

from ...errors import InputError
from ...inference.nuisance import LinearCondition
from ...materials.forms.base import Array
from ...storage.templates import template_environment

#: Share of the widths of the bounds by which a linear condition is kept, so that ">" holds as well.
MARGIN = 1e-9


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


def linear_conditions(
    condition: str, bounds: Mapping[str, tuple[float, float]]
) -> tuple[LinearCondition, ...]:
    """Return the linear ones of conditions that "and" joins, such as "C10 + C01 > 0".

    Parameters
    ----------
    condition : str
    bounds : mapping of (float, float)
        Bounds of each parameter.
    """
    try:
        tree = ast.parse(condition, mode="eval").body
    except SyntaxError:
        return ()
    parts = [tree]
    if isinstance(tree, ast.BoolOp) and isinstance(tree.op, ast.And):
        parts = tree.values
    widths = np.array([upper - lower for lower, upper in bounds.values()])
    conditions = []
    for part in parts:
        for difference in _differences(part, list(bounds)):
            *slopes, constant = difference.tolist()
            margin = MARGIN * float(np.abs(slopes) @ widths)
            if margin:
                conditions.append((dict(zip(bounds, slopes, strict=True)), margin - constant))
    return tuple(conditions)


def _differences(comparison: ast.expr, names: Sequence[str]) -> list[Array]:
    """Return larger minus smaller side of each pair that is compared, where both are linear.

    Each is an array (names + 1,), see `_linear`.
    """
    if not isinstance(comparison, ast.Compare):
        return []
    sides = [_linear(side, names) for side in (comparison.left, *comparison.comparators)]
    differences = []
    for operator, left, right in zip(comparison.ops, sides, sides[1:], strict=False):
        if left is None or right is None:
            continue
        if isinstance(operator, ast.Gt | ast.GtE):
            differences.append(left - right)
        elif isinstance(operator, ast.Lt | ast.LtE):
            differences.append(right - left)
    return differences


def _linear(node: ast.expr, names: Sequence[str]) -> Array | None:
    """Return slopes by each name, then the constant, (names + 1,); None if not linear."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return np.array([*np.zeros(len(names)), value])
        case ast.Name(id=name) if name in names:
            return np.array([*(float(name == other_name) for other_name in names), 0.0])
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            operand_slopes = _linear(operand, names)
            return None if operand_slopes is None else -operand_slopes
        case ast.BinOp(left=left, op=operator, right=right):
            return _joined(operator, _linear(left, names), _linear(right, names))
    return None


def _joined(operator: ast.operator, left: Array | None, right: Array | None) -> Array | None:
    """Return the slopes and the constant of two linear expressions that an operator joins.

    Parameters
    ----------
    left, right : (names + 1,) array
        Slopes and constant of each; None if it is not linear.
    """
    if left is None or right is None:
        return None
    match operator:
        case ast.Add():
            return left + right
        case ast.Sub():
            return left - right
        case ast.Mult() if not left[:-1].any():
            return left[-1] * right
        case ast.Mult() if not right[:-1].any():
            return left * right[-1]
        case ast.Div() if not right[:-1].any() and right[-1]:
            return left / right[-1]
    return None
