"""Charts of tangent moduli over strain: fits, bands, and what each test determines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .charts import Array, Chart, Charts, Series, dots, line, spans_a_decade

#: Title and axis of E1, E2 and G12.
PANELS = (
    ("E1, along the warp", "logarithmic strain ε1, %"),
    ("E2, along the fill", "logarithmic strain ε2, %"),
    ("G12, in shear", "shear strain γ12, %"),
)
MODULUS = "tangent modulus, MPa"
PERCENT = 100.0
#: Deviation (%) below which curves are the same to machine precision, and decades drawn of it.
SAME, DECADES = 1e-10, 7
#: Percent; a modulus known no better than this is not determined.
NOT_DETERMINED = 1000.0
#: Percent; nothing is known better than this, and a zero has to stand somewhere.
SMALLEST = 1e-3
#: Times what the curves need, to which an axis is stretched for a band.
MOST = 3.0


def moduli_charts(
    strains: Array, fits: Array, truth: Array | None = None, band: Array | None = None,
    caption: str = "",
) -> Charts:  # fmt: skip
    """Return charts of E1, E2 and G12 (Fig. 4.9), with deviations from a known solution.
    strains : (3, k) logarithmic strain for E1, E2, G12, each from zero to the largest reached.
    fits : (fits, 3, k) MPa, best fit first, in the same order. truth : (3, k) MPa; a second row
    of charts then shows the deviation from it in percent. band : (2, 3, k) MPa, ends of the band
    of the first fit; not drawn where it is not finite."""
    x, charts = PERCENT * strains, []
    for m, (title, label) in enumerate(PANELS):
        own = None if band is None else (band[0, m], band[1, m])
        dot = band is not None and truth is None
        series = [line("best", x[m], fits[0, m], own, ends=dot)]
        series += [line(x=x[m], y=curve, **_next(fits)) for curve in fits[1:, m]]
        drawn = [fits[:, m].max()]
        if truth is not None:
            series.append(line("known", x[m], truth[m], colour=1, dashes=1))
            drawn.append(truth[m].max())
        first, *_, last = fits[0, m]
        top, cut = axis_top(1.12 * float(max(drawn)), () if own is None else own[1])
        alt = f"{title}: from {first:.3g} MPa at rest to {last:.3g} MPa at {x[m, -1]:.3g} %"
        charts.append(Chart(f"{title}{cut}", label, MODULUS, series, alt, from_zero=True, top=top))
    if truth is not None:
        charts += [_deviation(m, x[m], fits[:, m], truth[m]) for m in range(3)]
    return Charts("moduli", charts, caption, columns=3)


def axis_top(curves: float, upper: ArrayLike) -> tuple[float, str]:
    """Return the end of the axis, and words where the band goes beyond `MOST` of the curves'."""
    band = np.asarray(upper, dtype=float)
    high = float(band[np.isfinite(band)].max(initial=0.0))
    if high <= MOST * curves:
        return max(curves, 1.04 * high), ""
    return MOST * curves, f": its band goes to {high:.3g} MPa"


def _next(fits: Array) -> dict[str, Any]:
    """Return name and look of every fit after the best."""
    return {"name": f"next {len(fits) - 1}", "colour": 6, "faint": True}


def _deviation(m: int, strain: Array, fits: Array, truth: Array) -> Chart:
    percent = np.maximum(100 * np.abs(fits / truth - 1), SAME)
    worst = float(percent[0].max())
    # Dips where curves cross say nothing.
    least = float(percent.max()) / 10**DECADES
    first, *others = np.maximum(percent, least)
    series = [line("best", strain, first), *(line(x=strain, y=y, **_next(fits)) for y in others)]
    label, said = "deviation from known, %", f"best: at most {worst:.2g} %"
    return Chart(f"{PANELS[m][0]}: {said}", PANELS[m][1], label, series, said, log_y=True)


def moduli_together(strains: Array, moduli: Array) -> Charts:
    """Return one chart of all three moduli, each up to its failure strain (Fig. 3.8).
    strains, moduli : (3, k) logarithmic strain from zero to failure, MPa, of E1, E2, G12. The axis
    is logarithmic where the moduli are positive and span more than a decade."""
    x = PERCENT * strains
    names = ("E1(ε1), warp", "E2(ε2), fill", "G12(γ12), shear")
    series = [line(name, x[m], moduli[m], colour=m, ends=True) for m, name in enumerate(names)]
    log, high = spans_a_decade(moduli), float(moduli.max())
    alt = f"moduli from {float(moduli.min()):.3g} to {high:.3g} MPa"
    top = None if log else 1.08 * high
    chart = Chart("", "logarithmic strain, %", MODULUS, series, alt, log, not log, top)
    return Charts("moduli together", [chart], "")


def pinned_charts(strains: ArrayLike, sigma: Mapping[str, ArrayLike], caption: str) -> Charts:
    """Return 1 sigma, % of the modulus, (3, k) by test; triangles above `NOT_DETERMINED`."""
    x, charts = PERCENT * np.asarray(strains, dtype=float), []
    for m, (title, label) in enumerate(PANELS):
        series: list[Series] = []
        marks: list[Series] = []
        for rank, (name, every) in enumerate(sigma.items()):
            values = np.asarray(every, dtype=float)[m]
            lost = ~(values <= NOT_DETERMINED)
            known = np.where(lost, np.nan, np.maximum(values, SMALLEST))
            series.append(line(name, x[m], known, colour=rank, dashes=rank // 8))
            if lost.any():
                # Triangles of several tests stand above each other.
                height = NOT_DETERMINED * 1.4 ** (rank + 1)
                at = dots(f"{name}, not determined", x[m][lost], np.full(lost.sum(), height),
                          most=12, colour=rank, shape="triangle-up")  # fmt: skip
                marks.append(at)
        level = NOT_DETERMINED if marks else None
        alt, up = f"uncertainty of {title} by test", "1 σ, % of the modulus"
        charts.append(Chart(title, label, up, series + marks, alt, log_y=True, level=level))
    words = f"{caption}; above {NOT_DETERMINED:g} % a modulus is not determined: triangles"
    return Charts("pinned", charts, words)
