"""Charts over names instead of numbers: tests left out, forms, tests that could be made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .charts import Chart, Charts, Series, dots
from .laws import LawRow
from .plan import MOST
from .style import spans_a_decade

#: How far dots of one place stand apart, all of them together.
ASIDE = 0.3


def held_out_charts(
    tests: Sequence[str],
    foretold: Mapping[str, Sequence[float]],
    fitted: Mapping[str, Sequence[float]],
    caption: str,
) -> Charts:
    """Relative errors by law (its name), at each test: foretold, and by the fit to all of them."""
    errors = {f"{law}, foretold": 100 * np.asarray(own) for law, own in foretold.items()}
    errors |= {f"{law}, fitted": 100 * np.asarray(own) for law, own in fitted.items()}
    alt = f"errors at {', '.join(tests)}"
    chart = _chart("left out", "relative RMS error, %", tests, errors, alt)
    return Charts("held out", [chart], caption)


def law_charts(rows: Sequence[LawRow], noise: float, label: str, caption: str) -> Charts:
    """Errors of each form, at what it was fitted to and at what was left out; a line at noise."""
    names = [f"{row.name} ({row.coefficients})" for row in rows]
    errors = {
        "error of the fit": np.array([row.fitted for row in rows]),
        "cross-validated error": np.array([row.validated for row in rows]),
    }
    alt = "; ".join(
        f"{name}: fit {row.fitted:.4g}, cross-validated {row.validated:.4g}"
        for name, row in zip(names, rows, strict=True)
    )
    across = "form of the moduli (number of coefficients)"
    return Charts("laws", [_chart(across, label, names, errors, alt, noise)], caption)


def plan_charts(tests: Sequence[str], sigma: Mapping[str, Sequence[float]], caption: str) -> Charts:
    """1 sigma, %, of each modulus with each test; what is not known has no dot."""
    known = {name: np.where(np.asarray(own) < MOST, own, np.nan) for name, own in sigma.items()}
    words = f"{caption}. From {MOST:g} % on a modulus is not known, and there is no dot."
    alt = f"1 sigma of {', '.join(sigma)} with {', '.join(tests)}"
    return Charts("plan", [_chart("test", "1 σ, % of the modulus", tests, known, alt)], words)


def _chart(
    across: str,
    up: str,
    names: Sequence[str],
    values: Mapping[str, np.ndarray],
    alt: str,
    level: float | None = None,
) -> Chart:
    place = np.arange(len(names)) + 1.0
    aside = ASIDE * (np.linspace(-0.5, 0.5, len(values)) if len(values) > 1 else np.zeros(1))
    series: list[Series] = [
        dots(name, place + by, own, colour=rank)
        for rank, ((name, own), by) in enumerate(zip(values.items(), aside, strict=True))
    ]
    every = np.concatenate([*values.values(), [np.nan if level is None else level]])
    log = spans_a_decade(every)
    return Chart(
        "", across, up, series, alt, log_y=log, from_zero=not log, level=level, x_names=tuple(names)
    )
