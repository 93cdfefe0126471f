"""What a reader of bent cylinders should know first: how sure the loads are, what was assumed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...reports import percent
from .test import CylinderTest

if TYPE_CHECKING:
    from .outcome import CylinderOutcome

#: mm, of what a project may leave to the usual values.
SIZES: Mapping[str, Callable[[CylinderTest], float]] = {
    "span": lambda test: test.supports.span,
    "seam width": lambda test: test.seam_width,
    "length": lambda test: test.length,
    "diameter of the supports": lambda test: test.supports.diameter,
}


def how_sure(outcome: CylinderOutcome, tests: Sequence[CylinderTest]) -> list[str]:
    """What a reader should know before any load: how sure they are, and what was assumed."""
    lines = []
    if outcome.spreads:
        shares = [float(np.nanmax(s)) / float(np.max(outcome.bent[i].load))
                  for i, s in outcome.spreads.items() if not np.isnan(s).all()]  # fmt: skip
        if shares:
            lines.append(
                f"By what the cards leave open of their laws, loads are off by up to "
                f"{percent(max(shares))} of the largest (one standard deviation)."
            )
    lines += [f"{words[:1].upper()}{words[1:]}." for words in outcome.unsure]
    if len(outcome.band) > 1:
        ends = "; ".join(f"{end.name}: {end.meaning}" for end in outcome.band)
        lines.append(f"The solver's answer lies between walls ({ends}).")
    for words in dict.fromkeys(words for test in tests for words in test.assumed):
        own = [test for test in tests if words in test.assumed]
        told = sorted({f"{SIZES[words](t):g} mm" for t in own}) if words in SIZES else []
        of = "" if len(own) == len(tests) else f" for {', '.join(t.name for t in own)}"
        size = f" ({', '.join(told)})" if told else ""
        lines.append(f"Assumed{of}, as the project does not say: the usual {words}{size}.")
    return lines
