"""What a fit says on the terminal: the moduli, what is left, the warning that matters, the page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..notes import NOTES, Note, foremost
from ..notes import lines as note_lines
from ..runs.result import answers
from .ending import written_to

if TYPE_CHECKING:
    from ..runs.result import Fit

#: What a modulus is of.
WORDS = {"E1": "along warp", "E2": "along fill", "G12": "in shear"}


def lines_of(fit: Fit, folder: Path, every: bool = False) -> list[str]:
    """The answer first, where the page is last; `every` note instead of the one that matters."""
    return [
        *modulus_lines(fit),
        *misfit_lines(fit),
        *test_lines(fit),
        *sure_lines(fit),
        *start_lines(fit),
        *(note_lines(fit.notes) if every else warning_lines(fit.notes, folder)),
        written_to(folder),
    ]


def modulus_lines(fit: Fit) -> list[str]:
    """A table: each modulus at a few strains, in MPa and kN/m, with sigma and band."""
    from ..inference.posterior import LEVEL
    from ..reports.fit_page import sigma_words
    from ..reports.html import percent

    sure = fit.best.certainty
    of = "noise alone" if sure is not None and sure.mesh is None else "noise and mesh"
    lines = [
        f"{fit.project.title}: tangent moduli at logarithmic strains, with what {of} leave open "
        f"within the bounds; kN/m: times {fit.thickness:.4g} mm",
        f"{'':18}{'strain':>8}{'MPa':>10}{'1 sigma':>10}"
        f"{f'{percent(LEVEL)} band, MPa':>20}{'kN/m':>10}",
    ]
    before = ""
    for one in answers(fit):
        name = f"{one.modulus}, {WORDS[one.modulus]}" if one.modulus != before else ""
        before = one.modulus
        sigma = "not known" if one.sigma is None else sigma_words(one.sigma)
        band = "not known" if one.band is None else "{:.4g} to {:.4g}".format(*one.band)
        lines.append(
            f"{name:18}{100 * one.strain:>6.3g} %{one.value:>10.4g}{sigma:>10}{band:>20}"
            f"{one.per_width:>10.4g}{'  (the end)' if one.end else ''}"
        )
    return lines


def misfit_lines(fit: Fit) -> list[str]:
    """What is left of every comparison beside the noise of its data."""
    lines = []
    for name, m in fit.misfits.items():
        times = f"{m.ratio:.2g} times the noise ({m.noise:.3g} {m.unit}, {m.noise_is})"
        beside = times if m.noise > 0 else "no noise to compare with"
        lines.append(f"misfit of {name}: {m.rms:.3g} {m.unit} RMS, {beside}")
    return lines


def test_lines(fit: Fit) -> list[str]:
    """What the fit means for each test."""
    several = len(fit.findings) > 1
    return [
        f"{name}: {line}" if several else line
        for name, findings in fit.findings.items()
        for line in findings.lines
    ]


def sure_lines(fit: Fit) -> list[str]:
    """Unknowns beside the moduli, and what each test pins down."""
    from ..reports.fit_page import sigma_words

    lines = [
        f"{verdict.name}: {verdict.words}"
        for verdict in fit.verdicts
        if verdict.shared or verdict.prior is None
    ]
    for source, sigmas in fit.result.get("pinned", {}).items():
        parts = ", ".join(
            f"{name} {sigma_words(s['median'])} (at worst {sigma_words(s['largest'])})"
            for name, s in sigmas.items()
        )
        lines.append(f"1 sigma from {source}: {parts}")
    return lines


def start_lines(fit: Fit) -> list[str]:
    """How the best was found."""
    result, best = fit.result, fit.best
    runs, cached = result["external_runs"], result["cached_runs"]
    kept = f", {cached} from the cache" if cached else ""
    external = f" ({runs} of {result['solver']}{kept})" if runs or cached else ""
    middle = float(np.median([r.objective for r in best.ranked if r.objective is not None]))
    lines = [
        f"{len(best.ranked)} of {len(best.records)} starts ended with a fit; "
        f"{result['objective_is']}: best {fit.objective:.3g}, median {middle:.3g}; "
        f"{result['analyses']} analyses{external}, {result['wall_s']:.0f} s"
    ]
    return [*lines, f"coarse to fine: {fit.stages}"] if fit.stages else lines


def warning_lines(notes: Sequence[Note], folder: Path) -> list[str]:
    """The note that matters most, and where the others are."""
    first = foremost(notes)
    if first is None:
        return []
    more = len(notes) - 1
    where = f"{folder / NOTES} (or --verbose)"
    further = [f"{more} further note{'s' * (more > 1)}: {where}"] if more else []
    return [f"warning: {first.line}", *further]
