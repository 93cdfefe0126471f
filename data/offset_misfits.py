"""How badly heights of frames follow the pressures of a log, by the offset between the clocks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .rising import WITHIN, misfit_of, straightest

Array = NDArray[np.float64]

#: Offsets looked at: half a frame apart, no more than so many; then finer about the best.
MOST, FINE = 20_000, 20
#: Frames are at rest within so many standard deviations of the lowest, and below this share of the
#: most; share of the log that is below its least pressure, by noise.
SIGMAS, AT_REST, BELOW = 6.0, 0.02, 0.01


def log_at(offset: float, times: Array, log_times: Array, pressures: Array) -> Array:
    """(frames,) MPa, the log's pressures at an offset (s); NaN beyond the log."""
    return np.interp(times + offset, log_times, pressures, left=np.nan, right=np.nan)


def offset_misfits(
    times: Array, heights: Array, log_times: Array, pressures: Array
) -> tuple[Array, Array]:
    """Offsets (s), rising, closer together about the best; and the misfit at each.

    Parameters
    ----------
    times, heights : (frames,) s and mm, all known. log_times, pressures : (k,) s, rising, and MPa.

    Raises
    ------
    InputError : a log that is shorter than the frames.
    """
    order = np.argsort(times, kind="stable")
    t, h = times[order], heights[order]
    h = np.where(h > _rest_height(h), h, 0.0)
    rest = float(np.quantile(pressures, BELOW))

    def misfit(offset: float) -> float:
        return misfit_of(log_at(offset, t, log_times, pressures), h, rest)

    coarse = _offsets(t, log_times)
    h = h ** straightest(h, [log_at(s, t, log_times, pressures) for s in coarse])
    misfits = np.array([misfit(s) for s in coarse])
    step = coarse[1] - coarse[0]
    fine = coarse[np.argmin(misfits)] + step * np.linspace(-2, 2, 4 * FINE + 1)
    fine = fine[(fine >= coarse[0]) & (fine <= coarse[-1])]
    offsets = np.concatenate([coarse, fine])
    misfits = np.append(misfits, [misfit(s) for s in fine])
    order = np.argsort(offsets, kind="stable")
    return offsets[order], misfits[order]


def _offsets(t: Array, log_times: Array) -> Array:
    """The offsets at which enough frames lie within the log, half a frame apart."""
    enough = int(np.ceil(WITHIN * len(t)))
    least = log_times[0] - t[len(t) - enough]
    most = log_times[-1] - t[enough - 1]
    if least > most:
        problem = (
            f"the log lasts {np.ptp(log_times):g} s, the frames {np.ptp(t):g} s; are the units of"
            " time and the rate right?"
        )
        raise InputError(None, "", problem)
    gaps = np.diff(t)
    step = float(np.median(gaps[gaps > 0])) / 2 if (gaps > 0).any() else most - least
    count = 2 + int(min((most - least) / step if step else 0, MOST))
    return np.linspace(least, most, count)


def _rest_height(h: Array) -> float:
    """Up to where a frame is at rest, by the noise from one frame to the next."""
    noise = float(np.median(np.abs(np.diff(h, 2)))) / 0.6745 / np.sqrt(6)
    return min(float(h.min()) + SIGMAS * noise, AT_REST * float(h.max()))
