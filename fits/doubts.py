"""What the data of a fit's tests make doubtful: looked at before every fit, and by itself."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..experiments.doubts import Expected, Judgement, judged
from ..experiments.registry import kinds
from ..materials.forms.base import COMPONENTS
from .setup import FitSetup


def expected_of(setup: FitSetup) -> Expected:
    """The moduli at rest that the bounds of the law allow, MPa."""
    bounds, law = setup.bounds, setup.law
    if bounds.largest is not None:
        return Expected({n: (bounds.least[n], bounds.largest[n]) for n in COMPONENTS})
    assert bounds.lower is not None and bounds.upper is not None
    free = list(law.form.free)
    ends = []
    for entries in (bounds.lower, bounds.upper):
        beta = np.zeros(len(law.form.labels))
        beta[free] = entries
        ends.append({name: float(law.with_beta(beta).modulus(name, 0.0)) for name in COMPONENTS})
    low, high = ends
    least = {name: max(low[name], bounds.least[name]) for name in COMPONENTS}
    return Expected({n: (least[n], max(high[n], least[n])) for n in COMPONENTS})


def judge(setup: FitSetup) -> tuple[Judgement, ...]:
    """The doubts of every test whose kind looks at its data; some are trusted by the project.

    Raises
    ------
    InputError : the project trusts what is no doubt's name.
    """
    trust = setup.project.fit.trust
    known = sorted({name for kind in kinds().values() for name in getattr(kind, "doubts", ())})
    for name in trust:
        if name not in known:
            problem = f"there is no doubt {name!r}; there are: {', '.join(known)}"
            raise InputError(setup.project.path, "fit.trust", problem)
    expected = expected_of(setup)
    return tuple(
        judged(one.test.name, look(expected), trust)
        for one in setup.tests
        if (look := getattr(one, "doubts", None)) is not None
    )
