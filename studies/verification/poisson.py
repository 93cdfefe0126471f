"""Fig. 4.2 of the thesis: the largest displacement at 300 kPa for five nu12."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...solvers.membrane.solver import MembraneSolver
from .marc_bubble import known_bubble, known_law
from .number import Number

#: Over the mean of the five, by nu12, read off the figure to three decimals.
FIGURE = {0.05: 1.029, 0.15: 1.016, 0.25: 1.0015, 0.35: 0.985, 0.45: 0.967}
#: Marc's pressure did not follow the surface (docs/validation/published-bubble.md): with dead
#: pressure ours are within 0.0005, with pressure that follows as a gas does at most 0.0070 off.
ALLOWED = 0.0075
SOURCE = "thesis Fig. 4.2"


def poisson_ratios() -> Iterator[Number]:
    """Largest displacement relative to the mean of the five."""
    model, largest = known_bubble(), []
    for nu12 in FIGURE:
        history = MembraneSolver().run(model, known_law(nu12))
        largest.append(float(np.linalg.norm(history.displacement[-1], axis=1).max()))
    mean = float(np.mean(largest))
    for (nu12, theirs), ours in zip(FIGURE.items(), largest, strict=True):
        what = f"largest displacement over the mean, nu12 {nu12:g}"
        yield Number(what, ours / mean, theirs, "", ALLOWED, SOURCE, absolute=True)
