"""Compute the work of a law along a closed path of strain: zero for a law that has an energy."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..compilation import compiled
from .forms.base import UNLIMITED
from .law import HypoelasticLaw
from .point_law import stress_update
from .point_state import PointState, point_response

#: Log strain to which the path goes along yarns whose moduli have no range.
DEFAULT_END = 0.05


@dataclass(frozen=True)
class ClosedPath:
    """The work of a law along strains 0, (a, 0), (a, b), (0, b), 0 of warp and fill.

    Attributes
    ----------
    ends : (float, float)
        a and b, log strain.
    work : float, MPa
        Of the whole path; NaN where the law ends on the way.
    share : float
        Of the work from rest to (a, b).
    """

    ends: tuple[float, float]
    work: float
    share: float

    @property
    def words(self) -> str:
        """Return a sentence with the path, its work and the share."""
        corners = "0, (a, 0), (a, b), (0, b), 0"
        words = f"Work of the path of log strains {corners} with a, b = {self.ends[0]:.4g}, "
        words += f"{self.ends[1]:.4g}"
        if not np.isfinite(self.work):
            return f"{words} is not known: the law ends on the way."
        return f"{words}: {self.work:.3g} MPa, {100 * self.share:.2g} % of that to (a, b)."


def closed_path(
    law: HypoelasticLaw, ends: Sequence[float] | None = None, increments: int = 40
) -> ClosedPath:
    """Compute the work of first loading along a closed path.

    Parameters
    ----------
    law : HypoelasticLaw
    ends : (2,) sequence of float, optional
        Log strains a and b of `ClosedPath`; by default the ends of the law's range, or
        `DEFAULT_END` where it has none.
    increments : int
        Of each of the four sides.
    """
    range_ends = [float(end) for end in law.strain_range[:2]]
    a, b = ends or [end if end < UNLIMITED else DEFAULT_END for end in range_ends]
    first_loading = law if law.memory is None else replace(law, memory=None)
    shares = np.arange(1, increments + 1)[:, None] / increments
    corners = [np.array([*corner, 0.0]) for corner in ((0, 0), (a, 0), (a, b), (0, b), (0, 0))]
    path = np.concatenate([start + shares * (end - start) for start, end in pairwise(corners)])
    work = _work(first_loading.compiled, path)
    share = work.sum() / work[: 2 * increments].sum()
    return ClosedPath((a, b), float(work.sum()), float(share))


@compiled()
def _work(law, path):  # type: ignore[no-untyped-def]
    """Return (n,) MPa, the work of each increment of strain from rest to path (n, 3), or NaN."""
    work = np.full(len(path), np.nan)
    written = point_response().law
    strain = np.zeros(3)
    stress = np.zeros(3)
    stress_old = np.zeros(3)
    for n in range(len(path)):
        before = PointState(strain, stress_old)
        if not stress_update(law, before, PointState(path[n], stress), written):
            break
        work[n] = 0.5 * ((stress + stress_old) * (path[n] - strain)).sum()
        strain = path[n]
        stress_old = stress.copy()
    return work
