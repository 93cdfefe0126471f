"""Find the offset between the clocks of a camera and a pressure log from heights and pressures.

At the right offset, apex heights and pressures are rising functions of each other. At a wrong one
they are not, wherever the pressure was held, released or raised unevenly. Both functions are found
by isotonic regression, with height zero at the lowest pressure of the log.
"""

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from ..errors import InputError
from ..light_dataclasses import dataclass
from .frames import Array

#: Fewest frames with a height from which the offset is found.
MIN_FRAMES = 6
#: Share of the frames that must lie within the log.
MIN_SHARE_IN_LOG = 0.8
#: Misfit above which the heights do not follow the pressures.
MAX_MISFIT = 0.05
#: Mean uncertainty of the frames' pressures, as a share of their range, above which the offset
#: counts as unknown.
MAX_DOUBT = 0.015


@dataclass(frozen=True, eq=False)
class ClockOffset:
    """The offset of two clocks, and the pressures of frames that follow from it.

    Attributes
    ----------
    offset : float, s
        Time by the log's clock less time by the camera's clock.
    lower, upper : float, s
        Range of the offsets that may be right.
    misfit : float or None
        Share of the variance that rising functions leave unexplained; None for a given offset.
    pressure : (frames,) array, MPa
        Pressure of each frame, NaN beyond the log.
    pressure_uncertainty : (frames,) array, MPa
        Half of the range of each frame's pressure over the offsets that may be right.
    times : (frames,) array, s
        Time of each frame by the camera's clock.
    heights : (frames,) array, mm
        Height of the apex in each frame.
    """

    offset: float
    lower: float
    upper: float
    misfit: float | None
    pressure: Array
    pressure_uncertainty: Array
    times: Array
    heights: Array


def given_offset(
    offset: float,
    times: Array,
    heights: Array,
    log_times: Array,
    pressures: Array,
) -> ClockOffset:
    """Return the pressures of frames for a known offset of the clocks.

    Parameters
    ----------
    offset : float, s
        Time by the log's clock less time by the camera's clock.
    times : (frames,) array, s
        Time of each frame by the camera's clock.
    heights : (frames,) array, mm
        Height of the apex in each frame.
    log_times : (k,) array, s
        Time of each reading of the log by its clock.
    pressures : (k,) array, MPa
        Pressure at each of these times.

    Raises
    ------
    InputError
        No frame lies within the log.
    """
    pressure = log_at(offset, times, log_times, pressures)
    if not np.isfinite(pressure).any():
        problem = (
            f"no frame lies within the log: frames from {times.min() + offset:.2f} to"
            f" {times.max() + offset:.2f} s by its clock, the log from {log_times[0]:.2f} to"
            f" {log_times[-1]:.2f} s"
        )
        raise InputError(None, "offset", problem)
    return ClockOffset(
        offset,
        lower=offset,
        upper=offset,
        misfit=None,
        pressure=pressure,
        pressure_uncertainty=np.zeros(len(times)),
        times=times,
        heights=heights,
    )


def find_offset(
    times: Array,
    heights: Array,
    log_times: Array,
    pressures: Array,
) -> ClockOffset:
    """Find the offset of the clocks at which the heights rise with the pressures.

    Parameters
    ----------
    times, heights, log_times, pressures
        As in `given_offset`; heights may be NaN.

    Raises
    ------
    InputError
        There are too few frames, no such offset, or several that differ in the frames' pressures.
    """
    has_height = np.isfinite(heights)
    if has_height.sum() < MIN_FRAMES:
        problem = f"{has_height.sum()} frames are too few to find it by; give it in s"
        raise InputError(None, "offset", problem)
    offsets, misfits = offset_misfits(times[has_height], heights[has_height], log_times, pressures)
    best = int(np.argmin(misfits))
    if misfits[best] > MAX_MISFIT:
        problem = (
            f"at no offset does the sheet rise with the pressure: at best, {offsets[best]:.2f} s,"
            f" {misfits[best]:.0%} of the variance is left; are these the log and the frames of one"
            " test, and their times right (no frames dropped, no leak)? else give the offset in s"
        )
        raise InputError(None, "offset", problem)
    may_be_right = _may_be_right(misfits)
    possible = offsets[may_be_right]
    offset = _middle_about(best, offsets, may_be_right)
    pressure = log_at(offset, times, log_times, pressures)
    pressure_uncertainty = _pressure_uncertainty(possible, times, log_times, pressures)
    lower = possible[0]
    upper = possible[-1]
    mean_uncertainty = np.nanmean(pressure_uncertainty)
    if mean_uncertainty > MAX_DOUBT * np.ptp(pressure[np.isfinite(pressure)]):
        problem = (
            f"cannot be found: offsets from {lower:.2f} to {upper:.2f} s do as well, and"
            f" leave the frames' pressures uncertain by {1e3 * mean_uncertainty:.3g} kPa on"
            " average; give it in s, and the frames' times if frames were dropped. Where the"
            " pressure was held, released or began to rise while"
            " frames were taken, it can be found"
        )
        raise InputError(None, "offset", problem)
    return ClockOffset(
        offset,
        lower=lower,
        upper=upper,
        misfit=misfits[best],
        pressure=pressure,
        pressure_uncertainty=pressure_uncertainty,
        times=times,
        heights=heights,
    )


def _may_be_right(misfits: Array, noise: float = 1e-6, factor: float = 2.0) -> NDArray[np.bool_]:
    """Return the mask of offsets that may be right.

    Parameters
    ----------
    misfits : (offsets,) array
    noise : float
        Share of the variance that is noise in any measurement (0.1 % of the amplitude).
    factor : float
        Largest misfit of such an offset, as a multiple of the smallest misfit.
    """
    return misfits <= factor * max(misfits.min(), noise)


def _middle_about(best: int, offsets: Array, may_be_right: NDArray[np.bool_]) -> float:
    """Return the middle of the range around the best offset in which all offsets may be right.

    Parameters
    ----------
    best : int
        Index of the best offset.
    offsets : (n,) array, s
        In rising order.
    may_be_right : (n,) array of bool
        Which offsets may be right.
    """
    wrong = np.flatnonzero(~may_be_right)
    first = wrong[wrong < best].max(initial=-1) + 1
    last = wrong[wrong > best].min(initial=len(offsets)) - 1
    return float(offsets[first] + offsets[last]) / 2


def _pressure_uncertainty(
    offsets: Array,
    times: Array,
    log_times: Array,
    pressures: Array,
    samples: int = 200,
) -> Array:
    """Return half of the range (frames,) MPa of each frame's pressure over a sample of offsets.

    Parameters
    ----------
    offsets : (n,) array, s
        Offsets that may be right.
    times : (frames,) array, s
        Times of the frames by the camera's clock.
    log_times, pressures : (m,) array
        Times (s) and pressures (MPa) of the log.
    samples : int
        Number of offsets that are looked at, about.
    """
    sampled = np.append(offsets[:: max(1, len(offsets) // samples)], offsets[-1])
    possible = np.array([log_at(offset, times, log_times, pressures) for offset in sampled])
    # fmax and fmin pass over NaN, and are NaN where a frame is beyond the log at every offset.
    return (np.fmax.reduce(possible) - np.fmin.reduce(possible)) / 2


def log_at(
    offset: float,
    times: Array,
    log_times: Array,
    pressures: Array,
) -> Array:
    """Return the log's pressure (frames,) MPa at each frame by an offset; NaN beyond the log.

    Parameters
    ----------
    offset : float, s
    times : (frames,) array, s
        Times of the frames by the camera's clock.
    log_times, pressures : (m,) array
        Times (s) and pressures (MPa) of the log.
    """
    return np.interp(times + offset, log_times, pressures, left=np.nan, right=np.nan)


def offset_misfits(
    times: Array,
    heights: Array,
    log_times: Array,
    pressures: Array,
    refinement: int = 20,
) -> tuple[Array, Array]:
    """Return the misfit between heights and pressures at many offsets.

    Parameters
    ----------
    times, heights, log_times, pressures
        As in `given_offset`.
    refinement : int
        Factor by which offsets around the best one are closer together.

    Returns
    -------
    offsets : (offsets,) array, s
        Offsets, rising.
    misfits : (offsets,) array
        Share of the variance that rising functions leave unexplained, see `_misfit`.
    """
    order = np.argsort(times, kind="stable")
    t = times[order]
    h = heights[order]
    h = np.where(h > _rest_height(h), h, 0.0)
    coarse = _offsets(t, log_times)
    h = h ** _straightest_power(h, [log_at(s, t, log_times, pressures) for s in coarse])
    # The lowest pressure of the log is that of its hundredth part, as noise goes below it.
    rest_pressure = float(np.quantile(pressures, 0.01))

    def misfits_at(offsets: Array) -> Array:
        return np.array(
            [_misfit(log_at(s, t, log_times, pressures), h, rest_pressure) for s in offsets]
        )

    misfits = misfits_at(coarse)
    step = coarse[1] - coarse[0]
    fine = coarse[np.argmin(misfits)] + step * np.linspace(-2, 2, 4 * refinement + 1)
    fine = fine[(fine >= coarse[0]) & (fine <= coarse[-1])]
    offsets = np.concatenate([coarse, fine])
    misfits = np.append(misfits, misfits_at(fine))
    order = np.argsort(offsets, kind="stable")
    return offsets[order], misfits[order]


def _offsets(t: Array, log_times: Array, max_count: int = 20_000) -> Array:
    """Return the offsets (s) at which most frames lie within the log, half a frame apart.

    Parameters
    ----------
    t : (frames,) array, s
        Rising times of the frames.
    log_times : (m,) array, s
        Times of the log.
    max_count : int
        Largest number of offsets, about.
    """
    required = int(np.ceil(MIN_SHARE_IN_LOG * len(t)))
    lowest = log_times[0] - t[len(t) - required]
    highest = log_times[-1] - t[required - 1]
    if lowest > highest:
        durations = f"the log lasts {np.ptp(log_times):g} s, the frames {np.ptp(t):g} s"
        raise InputError(None, "", f"{durations}; are the units of time and the rate right?")
    gaps = np.diff(t)
    step = float(np.median(gaps[gaps > 0])) / 2 if (gaps > 0).any() else highest - lowest
    count = min((highest - lowest) / step if step else 0, max_count)
    return np.linspace(lowest, highest, 2 + int(count))


def _rest_height(h: Array, deviations: float = 6.0, max_share: float = 0.02) -> float:
    """Return the height (mm) up to which the sheet counts as at rest, by the noise of heights.

    Parameters
    ----------
    h : (frames,) array, mm
        Heights in order of time.
    deviations : float
        Standard deviations of the noise that this height is above the lowest one.
    max_share : float
        Upper limit of this height, as a share of the largest height.
    """
    # The median of |normal deviate| is 0.6745; a second difference has 1 + 4 + 1 times the variance
    # of a height.
    noise = float(np.median(np.abs(np.diff(h, 2)))) / 0.6745 / np.sqrt(6)
    return min(float(h.min()) + deviations * noise, max_share * float(h.max()))


def _straightest_power(h: Array, pressures: Sequence[Array]) -> int:
    """Return the power of the heights that correlates best with the pressures at any offset.

    The height of a taut sheet rises linearly with the pressure, that of a flat sheet with its cube
    root. With the right power noise has the same weight at all heights; the offset itself can be
    found with any rising function of the heights.

    Parameters
    ----------
    h : (frames,) array
        Heights of the frames.
    pressures : sequence of (frames,) arrays, MPa
        Pressures of the frames by each offset, NaN beyond the log.
    """
    best = {}
    for power in (1, 2, 3):
        raised = h**power
        best[power] = max((_correlation(raised, p) for p in pressures), default=0.0)
    return max(best, key=lambda power: best[power])


def _correlation(raised: Array, p: Array) -> float:
    """Return the correlation of heights with pressures; 0 where it is negative or unknown.

    Parameters
    ----------
    raised : (frames,) array
        A power of the heights.
    p : (frames,) array, MPa
        Pressures, NaN beyond the log.
    """
    in_log = np.isfinite(p)
    if not _are_enough(in_log):
        return 0.0
    x = raised[in_log] - raised[in_log].mean()
    y = p[in_log] - p[in_log].mean()
    size = np.sqrt((x @ x) * (y @ y))
    return max(0.0, float(x @ y) / size) if size > 0 else 0.0


def _are_enough(in_log: NDArray[np.bool_]) -> bool:
    """Return whether enough frames lie within the log; one may be beyond its end by rounding.

    Parameters
    ----------
    in_log : (frames,) array of bool
        Which frames lie within it.
    """
    return bool(in_log.sum() >= max(MIN_FRAMES, MIN_SHARE_IN_LOG * len(in_log) - 1))


def _misfit(p: Array, h: Array, rest_pressure: float) -> float:
    """Return the share of the variance that rising functions leave unexplained.

    It is the mean over heights as a function of pressure, and pressure as a function of height; 1
    where there is no variance or too few frames lie within the log.

    Parameters
    ----------
    p : (frames,) array, MPa
        Pressure of each frame, NaN beyond the log.
    h : (frames,) array
        Heights, raised to a power.
    rest_pressure : float, MPa
        Pressure at which the height is zero.
    """
    in_log = np.isfinite(p)
    if not _are_enough(in_log):
        return 1.0
    p = p[in_log]
    h = h[in_log]
    # In fitting the functions, the state of rest has the weight of all frames together.
    return (_unexplained(p, h, rest_pressure, 0.0) + _unexplained(h, p, 0.0, rest_pressure)) / 2


def _unexplained(
    x: Array,
    y: Array,
    x_rest: float,
    y_rest: float,
) -> float:
    """Return the share of the variance of y that a rising function of x leaves unexplained.

    The function goes near (x_rest, y_rest), the state of rest.

    Parameters
    ----------
    x, y : (n,) array
        Pressures and raised heights, either way round.
    """
    total = np.sum((y - y.mean()) ** 2)
    if not total > 0:
        return 1.0
    weight = np.append(np.ones(len(x)), len(x))
    # Readings at the same x are averaged, since a function has one value there.
    group = np.unique(np.append(x, x_rest), return_inverse=True)[1]
    sums = np.bincount(group, weight)
    means = np.bincount(group, weight * np.append(y, y_rest)) / sums
    rising = scipy.optimize.isotonic_regression(means, weights=sums).x
    return float(np.sum((y - rising[group[:-1]]) ** 2) / total)
