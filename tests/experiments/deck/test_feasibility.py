"""experiments/deck/feasibility.py: conditions on parameters, evaluated in the sandbox."""

import pytest
from bubblefit.experiments.deck.feasibility import holds, linear_conditions

from ...support.refusals import complaint

AT = {"a": 0.5, "b": 0.2}


@pytest.mark.parametrize(
    ("text", "result"),
    [
        ("a + b > 0", True),
        ("0 < b < a", True),
        ("a < b or not a > b", False),
        ("a**2 <= 0.25 and b < 1", True),
        ("1 / (a - 0.5) > 0", False),
        ("", True),
    ],
)
def test_condition_holds(text, result):
    assert holds(text, AT) is result


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("c > 0", "feasible: 'c > 0': 'c' is undefined; there are: a, b"),
        ("a >", "there are: a, b"),
        ("__import__('os').system('true') > 0", "'__import__' is undefined"),
        ("a.__class__.__mro__ > 0", "access to attribute '__class__'"),
    ],
)
def test_anything_else_is_refused(text, words):
    assert words in complaint(holds, text, AT)


@pytest.mark.parametrize(
    ("text", "slopes", "least"),
    [
        ("a + b > 0", [(1, 1)], [0]),
        ("2 * a - b / 4 <= 3 and a * b > 1", [(-2, 0.25)], [-3]),
        ("0.1 < b < a", [(0, 1), (1, -1)], [0.1, 0]),
        ("-(a - 1) * 2 >= b", [(-2, -1)], [-2]),
        ("a > 0 or b > 0", [], []),
        ("a**2 > 0", [], []),
        ("a | abs > 0", [], []),
        ("1 > 0", [], []),
        ("", [], []),
    ],
)
def test_linear_conditions_are_inequalities(text, slopes, least):
    conditions = linear_conditions(text, {"a": (0.0, 1.0), "b": (0.0, 1.0)})
    assert [(values["a"], values["b"]) for values, _ in conditions] == slopes
    assert [limit for _, limit in conditions] == pytest.approx(least, abs=1e-8)
