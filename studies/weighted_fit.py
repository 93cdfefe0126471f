"""One fit of a study of weights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

#: Shares of the strain reached at which moduli are followed.
PLACES = (0.0, 0.5, 1.0)


@dataclass(frozen=True)
class WeightedFit:
    """The optimum where the tests of a kind count so many times.

    relative : mean relative RMS error by test; rms : by comparison, in its unit. moduli : MPa at
    the `PLACES` of the strain that the fit at the project's weights reached. unknowns : the
    optimiser's. failure : why there is no fit, and nothing else.
    """

    count: float
    relative: Mapping[str, float]
    rms: Mapping[str, float]
    moduli: Mapping[str, Sequence[float]]
    unknowns: Sequence[float]
    analyses: int
    failure: str = ""

    def to_json(self) -> dict[str, Any]:
        """Plain values, exact in JSON."""
        return asdict(self)
