"""The folder of a finished fit: card, tables, figures, report.html, and last result.json."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..identification.bands import LEVEL
from ..identification.propagation import PRIOR
from ..materials.card import write_card
from ..materials.forms.base import COMPONENTS
from ..materials.law import HypoelasticLaw
from ..notes import NOTES, NOTES_ARE, write_notes
from ..reports import (
    Report,
    StartRow,
    Table,
    percent,
    plot_moduli,
    plot_optima,
    plot_pinned,
    write_report,
)
from ..writing import replacing
from .coefficients import coefficients_table
from .store import RESULT, Store

if TYPE_CHECKING:
    from .result import Fit

Array = NDArray[np.float64]

CARD, MODULI, RESIDUALS = "material.toml", "moduli.csv", "residuals.csv"
COEFFICIENTS = "coefficients.csv"
#: Strains at which curves are drawn.
SMOOTH = 121
#: A modulus is said to be unknown from here on: as uncertain as it was before, but for rounding.
UNKNOWN = 0.999 * PRIOR
FILES = (
    (RESULT, "all numbers of this page, for programs"),
    (CARD, "the material card"),
    (MODULI, "tangent moduli along their strains, with their bands"),
    (COEFFICIENTS, "every unknown with its standard deviation and its correlations"),
    (RESIDUALS, "every matched value beside the model's"),
    (NOTES, NOTES_ARE),
    ("history.csv", "one row an analysis"),
)


def write_fit(fit: Fit, folder: Path) -> Path:
    """Write everything; raises OutputError."""
    store = Store(folder)
    (folder / RESULT).unlink(missing_ok=True)
    if fit.record is not None:
        fit.record.write(folder)
    write_card(fit.card, folder / CARD, fit.project.scales.modulus_unit)
    tables = {MODULI: fit.moduli(), COEFFICIENTS: fit.coefficients(), RESIDUALS: fit.residuals()}
    for name, table in tables.items():
        with replacing(folder / name) as path:
            table.to_csv(path, index=False, float_format="%.9g")
    write_notes(folder, fit.notes)
    page = write_report(folder, _page(fit, folder))
    store.finish(fit.result)
    return page


def _page(fit: Fit, folder: Path) -> Report:
    result, project, best = fit.result, fit.project, fit.best
    exhibits = {
        t.test.name: t.show(
            fit.tests[t.test.name], fit.findings[t.test.name], fit.output(folder, t.test.name)
        )
        for t in fit.setup.tests
    }
    shown = list(exhibits.values())
    runs, cached = result["external_runs"], result["cached_runs"]
    external = [(f"of them by {project.fit.solver}", runs)] if runs or cached else []
    external += [("of them from the cache", cached)] if cached else []
    pins = fit.pinned
    own = [
        (label if len(shown) == 1 else f"{name}: {label}", value)
        for name, exhibit in exhibits.items()
        for label, value in exhibit.facts
    ]
    record = [] if fit.record is None else fit.record.tables()
    files = [
        *FILES,
        *([] if fit.record is None else fit.record.files),
        *(f for exhibit in shown for f in exhibit.files),
    ]
    return Report(
        title=project.title,
        summary=_summary(fit),
        facts=[
            (f"objective: {fit.setup.objective_is}", fit.objective),
            ("method", f"{project.fit.method} on {project.fit.solver}"),
            ("form of the moduli", fit.law.form.name),
            ("starts", f"{len(best.ranked)} feasible of {len(best.records)}"),
            *([("coarse to fine", fit.stages)] if fit.stages else []),
            ("analyses", result["analyses"]),
            *external,
            ("wall time, s", result["wall_s"]),
            (f"Poisson's ratio nu12 ({_fixed(fit, 'nu12')})", fit.law.nu12),
            (
                "thickness" if _fixed(fit, "thickness") == "fixed" else "thickness (fitted)",
                f"{fit.thickness:.4g} mm, {project.fabric.thickness_change}",
            ),
            *own,
        ],
        coefficients=_coefficients(fit),
        unit=project.scales.modulus_unit,
        moduli_error=result.get("moduli_error", {}),
        moduli_error_range=result.get("moduli_error_range", {}),
        strain_reached=result["strain_reached"],
        valid_strain=result["valid_strain"],
        warnings=[note.line for note in fit.notes],
        figures=[
            _optima(fit, folder),
            _moduli(fit, folder),
            *_pinned(fit, folder, pins),
            *(f for exhibit in shown for f in exhibit.figures),
        ],
        tables=[
            *_determined(fit),
            *_beside(fit),
            _left(fit),
            *_pinned_table(pins),
            *(t for exhibit in shown for t in exhibit.tables),
            *coefficients_table(fit),
            *record,
        ],
        starts=[StartRow(r.number, r.objective, r.status, r.analyses) for r in best.records],
        files=[f for f in files if f[0] == RESULT or (folder / f[0]).exists()],
        versions=result["versions"],
    )


def _fixed(fit: Fit, name: str) -> str:
    return "fitted" if getattr(fit.project.fit.unknowns, name) is not None else "fixed"


def _beside(fit: Fit) -> list[Table]:
    """What the data say of every unknown beside the moduli."""
    rows: list[list[object]] = [
        [v.name, v.unit, v.value, v.sigma if v.determined else "not determined", v.lower, v.upper,
         v.prior, v.words]
        for v in fit.verdicts
    ]  # fmt: skip
    header = ["unknown", "unit", "value", "1 sigma", "least", "largest", "known to", "verdict"]
    note = (
        "Known to: one standard deviation before the tests. Correlation: with a modulus in the "
        "middle of its strains, where it is above one half."
    )
    return [Table("Unknowns beside the moduli", header, rows, note, text=(1, 7))] if rows else []


def _left(fit: Fit) -> Table:
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


def _summary(fit: Fit) -> str:
    said = "; ".join(
        f"{name}: {f.summary}" if len(fit.findings) > 1 else f.summary
        for name, f in fit.findings.items()
    )
    return f"Best of {len(fit.best.ranked)} starts: objective {fit.objective:.3g}; {said}."


def _coefficients(fit: Fit) -> list[tuple[str, float, float, float]]:
    """Name, value, lower and upper bound of everything that was fitted of the law."""
    form, unknowns, scale = fit.law.form, fit.problem.unknowns, fit.project.scales.modulus
    rows = zip(form.free, *unknowns.box, strict=True)
    return [
        (form.labels[i], float(fit.law.beta[i] / scale), float(low / scale), float(high / scale))
        for i, low, high in rows
    ]


def _optima(fit: Fit, folder: Path) -> tuple[str, str]:
    values = [np.nan if r.objective is None else r.objective for r in fit.best.records]
    plot_optima(folder / "optima.png", values)
    words = f"Optimum of every start: {fit.setup.objective_is}, from worst to best"
    if fit.coarse_to_fine is not None:
        words += "; starts with the same optimum on the coarse mesh have one on the full mesh"
    return "optima.png", words


def _moduli(fit: Fit, folder: Path) -> tuple[str, str]:
    """The moduli over the strains that they are fitted to, as far as the card is valid."""
    strains = _strains(fit)
    known = next((t.known for t in fit.setup.tests if t.known is not None), None)
    curves = np.array([modulus_curves(law, strains) for law in fit.laws])
    band, sure = None, fit.best.certainty
    if sure is not None and sure.band:
        band = np.array(
            [
                [np.interp(x, sure.strain[name], end) for end in sure.band[name]]
                for name, x in zip(COMPONENTS, strains, strict=True)
            ]
        ).transpose(1, 0, 2)
    plot_moduli(
        folder / "moduli.png",
        strains,
        curves,
        None if known is None else modulus_curves(known, strains),
        band=None if known is not None else band,
    )
    words = ""
    if known is None and band is not None:
        words = (
            f", where a dot ends them; with their bands ({percent(LEVEL)}, noise and mesh together)"
        )
    return "moduli.png", f"Tangent moduli of the best fits over the strains reached{words}"


def _strains(fit: Fit, count: int = SMOOTH) -> Array:
    return np.array([np.linspace(0.0, fit.best.valid[c], count) for c in COMPONENTS.values()])


def modulus_curves(law: HypoelasticLaw, strains: Array) -> Array:
    """(3, k) E1, E2, G12 in MPa at strains (3, k)."""
    return np.array([law.modulus(n, x) for n, x in zip(COMPONENTS, strains, strict=True)])


def _pinned(fit: Fit, folder: Path, pins: dict[str, dict[str, Array]]) -> list[tuple[str, str]]:
    if not pins:
        return []
    sigma = {
        source: 100 * np.array([sigmas[name] for name in COMPONENTS])
        for source, sigmas in pins.items()
    }
    count = next(iter(sigma.values())).shape[1]
    plot_pinned(folder / "pinned.png", _strains(fit, count), sigma)
    return [("pinned.png", "What each test pins down: one standard deviation of the moduli")]


def sigma_words(value: float) -> str:
    """A relative uncertainty as percent, as long as it says anything."""
    return percent(value) if value < UNKNOWN else "unknown"


def _pinned_table(pins: dict[str, dict[str, Array]]) -> list[Table]:
    rows: list[list[object]] = [
        [source, name, sigma_words(float(np.median(s))), sigma_words(float(s.max()))]
        for source, sigmas in pins.items()
        for name, s in sigmas.items()
    ]
    note = (
        "noise of every test, its misfit or its scatter, whichever is larger, neighbours that err "
        "as one counted as one; before the "
        f"tests every modulus is taken to be known to {100 * PRIOR:.0f} %"
    )
    header = ["test", "modulus", "median 1 sigma", "largest 1 sigma"]
    return [Table("What each test pins down", header, rows, note)] if rows else []


def _together(alike: float) -> str:
    """How many neighbouring values count as one; nothing where each counts."""
    return f", {alike:.2g} neighbouring values err as one" if alike > 1.05 else ""


def _determined(fit: Fit) -> Sequence[Table]:
    """What the data determine, modulus by modulus; nothing where it is not known."""
    sure = fit.best.certainty
    if sure is None:
        return []
    mesh = {name: "not known" for name in sure.sigma}
    if sure.mesh is not None:
        mesh = {n: percent(round(float(np.abs(off).max()), 6)) for n, off in sure.mesh.items()}
    rows: list[list[object]] = [
        [name, percent(float(np.median(s))), percent(float(s.max())), mesh[name],
         percent(float(sure.total[name].max()))]
        for name, s in sure.sigma.items()
    ]  # fmt: skip
    units = {c.name: c.objective.unit for c in fit.problem.comparisons}
    noise = ", ".join(
        f"{value:.2g} {units[name]} ({name}{_together(sure.alike[name])})"
        for name, value in sure.noise.items()
    )
    note = (
        f"noise of {noise} on everything matched; a law or a model of the wrong form is not in it; "
        "single coefficients are far less certain than the moduli they make. Mesh: "
        "by how much a modulus would be another on ever finer meshes, from one run of a finer "
        "model at the best fit"
    )
    header = ["modulus", "median 1 sigma", "largest 1 sigma", "mesh, largest", "together, largest"]
    return [Table("What the data determine", header, rows, note)]
