"""The forms of the moduli that a comparison asks: a project for each of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..errors import InputError
from ..fits.project import Project
from ..fits.setup import make_solver
from ..materials.forms.registry import form_names, form_settings, of_load_ratio
from ..solvers.base import carries_load_ratios

#: Of a spline, where neither the project nor the caller says how many.
KNOTS = 6


def candidates(project: Project, names: Sequence[str] = ()) -> dict[str, Project]:
    """The project with each of the forms asked for, by name; with all unless any is.

    All are those that the project's solver carries.

    names : of forms; "spline:8" is a spline of eight knots for each modulus.

    Raises
    ------
    InputError : no such form, or bounds that do not go with every form.
    """
    bounds = project.law.bounds
    if bounds is not None and (bounds.lower is not None or bounds.upper is not None):
        problem = "comparing forms needs bounds on the moduli themselves: E1, E2, G12"
        raise InputError(project.path, "law.bounds", problem)
    own = project.law.model_extra or {}
    chosen: dict[str, Project] = {}
    for asked in names or _carried(project):
        form, _, knots = asked.partition(":")
        settings: dict[str, Any] = {}
        if form not in form_names():
            problem = f"there is no form {form!r}; there are: {', '.join(form_names())}"
            raise InputError(None, "--form", problem)
        if knots and (not knots.isdecimal() or "knots" not in form_settings(form)):
            problem = f"expected a form, or one with its number of knots (spline:8), got {asked!r}"
            raise InputError(None, "--form", problem)
        if knots:
            settings = {"knots": int(knots)}
        elif "knots" in form_settings(form) and "knots" not in own:
            asked, settings = f"{form}:{KNOTS}", {"knots": KNOTS}
        chosen[asked] = project.with_law(form, settings)
    return chosen


def _carried(project: Project) -> list[str]:
    carries = carries_load_ratios(make_solver(project))
    return [name for name in form_names() if carries or not of_load_ratio(name)]


def plain(name: str) -> str:
    """A form's name as that of a folder."""
    return name.replace(":", "-")
