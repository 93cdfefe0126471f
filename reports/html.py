"""The report of a fit: one HTML page beside its figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from math import inf, isfinite
from pathlib import Path

from jinja2 import FileSystemLoader

from ..rendering import TEMPLATES, environment
from ..writing import replacing


@dataclass(frozen=True)
class StartRow:
    """One start of the multistart, as result.json lists it."""

    seed: int
    objective: float | None
    status: str
    analyses: int


@dataclass(frozen=True)
class Table:
    """A further table; numbers are written with four significant digits, text as it is.

    text : columns that are words: set from the left, as the first always is.
    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[object]]
    note: str = ""
    text: Sequence[int] = ()


@dataclass(frozen=True)
class Report:
    """All that the page shows. Empty parts are left out.

    Parameters
    ----------
    title : of the project.
    summary : a sentence or two: how good is the fit.
    facts : label and value pairs for the head of the page, values as text or numbers.
    coefficients : rows (name, value, lower bound, upper bound) in `unit`.
    unit : of the coefficients, "GPa" unless the project says otherwise.
    moduli_error : largest relative error of E1, E2, G12 over the strain reached (0.01 is 1 %),
        where the solution is known; moduli_error_range : by the same names, the strain from and
        to which each was compared.
    strain_reached : largest warp, fill and shear strain in any test.
    valid_strain : by the same names, the ends up to which the moduli are fitted; as far as was
        reached unless given.
    warnings : what a reader must know before using the numbers.
    figures : (file relative to the page, caption), in order.
    tables : further tables (R^2 of the surfaces, residuals, nuisance parameters).
    starts : every start; shown best first.
    files : (name, what it is) of the output folder.
    versions : name and version of what computed this.
    """

    title: str
    summary: str = ""
    facts: Sequence[tuple[str, object]] = ()
    coefficients: Sequence[tuple[str, float, float, float]] = ()
    unit: str = "GPa"
    moduli_error: Mapping[str, float] = field(default_factory=dict)
    moduli_error_range: Mapping[str, Sequence[float]] = field(default_factory=dict)
    strain_reached: Mapping[str, float] = field(default_factory=dict)
    valid_strain: Mapping[str, float] = field(default_factory=dict)
    warnings: Sequence[str] = ()
    figures: Sequence[tuple[str, str]] = ()
    tables: Sequence[Table] = ()
    starts: Sequence[StartRow] = ()
    files: Sequence[tuple[str, str]] = ()
    versions: Mapping[str, str] = field(default_factory=dict)


def write_report(folder: Path | str, report: Report) -> Path:
    """Write `report.html` into the output folder.

    Raises
    ------
    OutputError : the file cannot be written.
    jinja2.UndefinedError : the template asks for what the report does not have.
    """
    html = environment(FileSystemLoader(TEMPLATES / "report"), html=True)
    html.filters["number"] = number
    html.filters["percent"] = percent
    template = html.get_template("report.html.j2")
    context = {f.name: getattr(report, f.name) for f in fields(report)}
    context["starts"] = sorted(report.starts, key=_best_first)
    page = template.render(context)
    path = Path(folder) / "report.html"
    with replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return path


def _best_first(start: StartRow) -> float:
    value = start.objective
    return value if value is not None and isfinite(value) else inf


def number(value: object) -> str:
    """Four significant digits for floats; text, counts and missing values as a reader expects."""
    if value is None:
        return "–"
    if not isinstance(value, float):
        return str(value)
    return f"{value:.4g}" if isfinite(value) else "–"


def percent(value: float) -> str:
    """A fraction as percent with two significant digits, whole from 100 % on."""
    return f"{100 * value:.0f} %" if value >= 0.995 else f"{100 * value:.2g} %"
