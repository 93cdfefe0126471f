"""Whether a fit can be trusted: what is left beside the noise, doubts, stability, assumptions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..reports import Facts, Section, Table, Words, percent
from ..reports.content import Part

if TYPE_CHECKING:
    from .result import Fit

TITLE = "Can it be trusted?"
NO_WARNING = "No warning: nothing that the program looks at speaks against these numbers."


def trust_section(fit: Fit) -> Section:
    """What a reader should know before using the numbers, and what the fit leaves."""
    result = fit.result
    parts: list[Part] = [
        Words([f"{_said_by_tests(fit)}", *_checked(fit)]),
        warnings_of(fit),
        misfit_table(fit),
        *known_solution_table(result.get("moduli_error", {}), result.get("moduli_error_range", {})),
        Facts(assumed(fit)),
    ]
    return Section(TITLE, parts)


def _said_by_tests(fit: Fit) -> str:
    said = "; ".join(
        f"{name}: {f.summary}" if len(fit.findings) > 1 else f.summary
        for name, f in fit.findings.items()
    )
    return f"Best of {len(fit.best.ranked)} starts: objective {fit.objective:.3g}; {said}."


def _checked(fit: Fit) -> list[str]:
    """What the look at the data before the fit, and the solver's look at stability, showed."""
    lines = []
    if fit.judgements:
        doubts = sum(len(judgement.doubts) for judgement in fit.judgements)
        seen = f"{doubts} doubts, told below" if doubts else "nothing doubtful"
        tests = ", ".join(judgement.test for judgement in fit.judgements)
        lines.append(f"The data were looked at before the fit ({tests}): {seen}.")
    leading = (fit.best.differentiated or fit.best.point).histories
    stable = [
        beside.stable if history.stable is None else history.stable
        for history, beside in zip(fit.best.point.histories, leading, strict=True)
    ]
    if all(stable):
        lines.append("Every equilibrium at a reported load is stable.")
    elif False in stable:
        lines.append("Equilibria at some of the reported loads are unstable: see the warnings.")
    else:
        lines.append("The solver did not look whether every equilibrium is stable.")
    return lines


def warnings_of(fit: Fit) -> Words:
    """Every note of the fit, or that there is none."""
    lines = [note.line for note in fit.notes]
    return Words(lines, marked=True, warning=True) if lines else Words([NO_WARNING])


def misfit_table(fit: Fit) -> Table:
    """The residual of every comparison beside the noise of its data."""
    rows: list[list[object]] = [
        [name, m.rms, m.noise, m.unit, m.noise_is, m.ratio] for name, m in fit.misfits.items()
    ]
    header = ["compared", "RMS residual", "noise", "unit", "noise is", "residual over noise"]
    note = (
        "Noise: as the project gives it (noise of the test), else the scatter of the specimens, "
        "else what such an instrument is good for. The uncertainty reckons with the larger of "
        "noise and residual."
    )
    return Table("Residual beside the noise", header, rows, note, text=(3, 4))


def known_solution_table(
    errors: dict[str, float], ranges: dict[str, tuple[float, float]]
) -> list[Table]:
    """The largest errors of the moduli, where the solution is known."""
    rows: list[list[object]] = [
        [name, percent(error), *ranges.get(name, (None, None))] for name, error in errors.items()
    ]
    note = (
        "Against the known solution, over the range of logarithmic strain in the table, which is "
        "what the tests reached. Single coefficients are not compared: the highest powers hardly "
        "act at these strains, so quite different coefficients give the same moduli."
    )
    header = ["modulus", "largest error", "from strain", "to strain"]
    return [Table("Errors of the moduli", header, rows, note)] if rows else []


def assumed(fit: Fit) -> list[tuple[str, object]]:
    """What was not measured here but taken as known."""
    unknowns, project = fit.project.fit.unknowns, fit.project
    fitted = {name: getattr(unknowns, name) is not None for name in ("nu12", "thickness")}
    thick = f"{fit.thickness:.4g} mm, {project.fabric.thickness_change}"
    return [
        (f"Poisson's ratio nu12 ({'fitted' if fitted['nu12'] else 'fixed'})", fit.law.nu12),
        ("thickness (fitted)" if fitted["thickness"] else "thickness", thick),
        ("form of the moduli", fit.law.form.name),
    ]
