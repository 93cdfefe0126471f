"""Doubts about the strips of a test: units, preloads, failures, grips, directions and specimens.

Specimens are doubted beside their twins, those of the same direction.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ...readers.curves import LoadCurve
from ...readers.units import STRAIN_UNITS
from ...solvers.base import Array
from ..doubts import USUAL_MODULI, Doubt, Expected, force_unit_doubt
from .data import Strip


@dataclass(frozen=True)
class CurveLimits:
    """Limits beyond which a load curve is doubtful for a coated fabric.

    Unless said otherwise, loads are shares of the largest load of the curve, and elongations are
    shares of its last elongation.
    """

    end_strain: tuple[float, float] = (0.002, 1.5)  # least and largest strain at the end
    preload: float = 0.05  # largest load at no elongation: more is a preload, or a wrong zero
    start_share: float = 0.01  # largest elongation at which a curve is taken to begin
    failure_share: float = 0.7  # of the load so far: a load that falls below it is a failure
    possible_failure_share: float = (
        0.9  # of the load so far: a load that falls below it may be a failure
    )
    load_at_end: float = 0.2  # an extensometer is lost if the load rises by more than this
    still: float = 0.002  # ... while the elongation changes by less than this, at its end
    largest_repeated: int = 3  # rows at exactly the largest load: a limit of the load cell
    largest_span: float = 0.02  # ... if they span more of the elongation than this
    slack_load: float = 0.002  # load up to which a strip counts as slack
    slack: float = 0.1  # elongation up to which it may be slack
    slope_at: float = 0.5  # of the largest strain: where the modulus of a curve is taken
    stiffer: float = 1.15  # modulus of the fill over that of the warp: swapped beyond


LIMITS = CurveLimits()
#: Modulus whose bounds the curve of a direction is checked against.
MODULUS_ALONG = {"warp": "E1", "fill": "E2"}


def doubts_of_strips(
    strips: Mapping[str, Strip],
    width: float,
    thickness: float,
    expected: Expected,
    grip_distance: float,
    by_points: bool,
) -> Sequence[Doubt]:
    """Return the doubts about the strips of a test: units, preload, failure, grips, directions.

    Parameters
    ----------
    strips : mapping
        Data by direction.
    width, thickness : float, mm
        Width of the strips and thickness of the fabric.
    expected : Expected
        Bounds that the project gives the moduli.
    grip_distance : float, mm
        Free length of the strips between the grips.
    by_points : bool
        Whether points are matched, and not polynomials, in which rows beyond the end count too.
    """
    doubts: list[Doubt] = []
    moduli: dict[str, list[float]] = {}
    for direction, strip in strips.items():
        doubts += _between_grips(direction, strip, grip_distance)
        for specimen, elongation, load in curves_of(strip):
            name = f"{direction}, {specimen}" if specimen else direction
            doubts += _of_curve(name, strip, elongation, load)
            doubts += _of_failure(name, strip, elongation, load, by_points)
            if direction in MODULUS_ALONG and expected.moduli:
                modulus = _modulus(strip, elongation, load) / (width * thickness)
                moduli.setdefault(direction, []).append(modulus)
                doubts += _of_modulus(name, direction, modulus, expected)
    doubts += doubts_of_specimens(strips)
    if set(MODULUS_ALONG) <= set(strips) and expected.moduli and expected.warp_is_stiffer:
        doubts += _of_directions(moduli)
    return doubts


def _modulus(strip: Strip, elongation: Array, load: Array) -> float:
    """Return load over strain (N) half way along a curve; NaN where the strain is not positive.

    Parameters
    ----------
    elongation, load : (n,) array
        Of the curve, in mm and N.
    """
    strain = np.log1p(np.clip(elongation / strip.gauge_length, -0.9, None))
    distance = np.abs(strain - LIMITS.slope_at * float(strain.max()))
    rows = np.argsort(distance)[:5]
    value = np.median(load[rows] / np.where(strain[rows] > 0, strain[rows], np.nan))
    return float(value) if np.isfinite(value) else float("nan")


def _of_modulus(
    name: str,
    direction: str,
    modulus: float,
    expected: Expected,
) -> Iterator[Doubt]:
    """Yield a doubt if the modulus (MPa) of a curve is far outside the bounds of its direction."""
    unlikely = expected.outside(modulus, [MODULUS_ALONG[direction]])
    unusual = force_unit_doubt(modulus, USUAL_MODULI[direction])
    if unlikely:
        text = (
            f"{name}: load over strain is a modulus of about {unlikely}: are load and elongation "
            "in the units that are said and not exchanged, and are width and thickness right?"
        )
        yield Doubt("load-unit", True, text)
    elif unusual:
        text = f"{name}: load over strain is {unusual}; say load_unit in [strips.data]"
        yield Doubt("force-unit", False, text)


def _of_directions(moduli: Mapping[str, Sequence[float]]) -> Iterator[Doubt]:
    """Yield a doubt if warp and fill seem to be swapped, by their `moduli` (MPa)."""
    warp, fill = (float(np.median(moduli.get(name) or np.nan)) for name in MODULUS_ALONG)
    if fill > LIMITS.stiffer * warp:
        text = (
            f"the fill's modulus is about {fill:.3g} MPa, the warp's {warp:.3g} MPa, and the "
            "bounds have the warp stiffer: warp and fill seem to be swapped"
        )
        yield Doubt("swapped", False, text)


def curves_of(strip: Strip) -> list[tuple[str, Array, Array]]:
    """Return name, elongation (mm) and load (N) of every specimen, or else of the polynomial."""
    if strip.curves:
        return [(curve.specimen, curve.elongation, curve.load) for curve in strip.curves]
    if strip.polynomial is None:
        return []
    elongation = np.linspace(0.0, strip.elongation, 50)
    return [("", elongation, strip.polynomial(elongation))]


def _between_grips(direction: str, strip: Strip, distance: float) -> Iterator[Doubt]:
    """Yield a doubt if elongations are the travel of grips that are `distance` (mm) apart."""
    columns = list(dict.fromkeys(c.between_grips for c in strip.curves if c.between_grips))
    if not columns:
        return
    units = [c.source.units.get("elongation") for c in strip.curves if c.source]
    is_strain = any(unit in STRAIN_UNITS for unit in units)
    share = strip.gauge_length / distance
    modulus = MODULUS_ALONG.get(direction, "G12")
    effect = f"{modulus} comes out too low by the slip in the grips and the machine's own give"
    alternative = ""
    if share < 0.95 and not is_strain:
        alternative = ", or say the grips' distance as the gauge_length"
        effect = (
            f"over a gauge of {strip.gauge_length:.4g} mm between grips {distance:.4g} mm apart "
            f"{modulus} comes out at about {share:.0%} of what it is, and lower still by the slip"
        )
    text = (
        f"{direction}: the elongation, column {' and '.join(map(repr, columns))}, is by its name"
        f" the machine's travel from grip to grip: {effect}; name one that was measured on the "
        f"strip (columns = {{ elongation = ... }}){alternative}"
    )
    yield Doubt("grip-travel", False, text)


def _of_curve(
    name: str,
    strip: Strip,
    elongation: Array,
    load: Array,
) -> Iterator[Doubt]:
    """Yield doubts about one curve: units of elongation, a preload, a gauge that stands still.

    Parameters
    ----------
    elongation, load : (n,) array
        Of the curve, in mm and N.
    """
    strain = elongation[-1] / strip.gauge_length
    if not LIMITS.end_strain[0] < strain < LIMITS.end_strain[1]:
        text = (
            f"{name}: the curve ends at an elongation of {strain:.3g} gauge lengths: is it a length"
            " in the unit that is said (not percent, not a strain, not the load), and is the gauge "
            "length right?"
        )
        yield Doubt("elongation-unit", True, text)
    yield from _of_beginning(name, elongation, load)
    yield from _of_still_gauge(name, strip, elongation, load)


def _of_beginning(name: str, elongation: Array, load: Array) -> Iterator[Doubt]:
    """Yield a doubt if the load is not zero where the curve begins.

    Parameters
    ----------
    elongation, load : (n,) array
        Of the curve, in mm and N.
    """
    largest = float(load.max())
    # A curve may begin where the strip is elongated already.
    first = load[np.abs(elongation) <= LIMITS.start_share * float(elongation.max())]
    level = float(np.median(first)) / largest if first.size and largest > 0 else 0.0
    if abs(level) >= LIMITS.preload:
        text = (
            f"{name}: the load is {level * largest:.3g} N ({level:.0%} of the largest) where the "
            "curve begins: a preload, or a zero that was not set; begin the elongation where the "
            "load does"
        )
        yield Doubt("preload", False, text)


def _of_still_gauge(
    name: str,
    strip: Strip,
    elongation: Array,
    load: Array,
) -> Iterator[Doubt]:
    """Yield doubts about a gauge that stands still: at its end, at a load limit, or while slack.

    Parameters
    ----------
    elongation, load : (n,) array
        Of the curve, in mm and N.
    """
    end = float(elongation[elongation <= strip.elongation * (1 + 1e-9)].max(initial=0.0))
    at_end = load[(elongation >= (1 - LIMITS.still) * end) & (elongation <= end)]
    if at_end.size and at_end.max() - at_end[0] > LIMITS.load_at_end * float(load.max()):
        text = (
            f"{name}: the load rises from {at_end[0]:.3g} to {at_end.max():.3g} N while the "
            f"elongation stands still at {end:.3g} mm: the extensometer was taken off or is at its "
            "end; say a shorter final_length"
        )
        yield Doubt("gauge-still", True, text)
    at_largest = elongation[load == load.max()]
    span = float(np.ptp(at_largest)) / float(elongation.max())
    if len(at_largest) >= LIMITS.largest_repeated and span > LIMITS.largest_span:
        text = (
            f"{name}: the load is exactly {load.max():.5g} N in {len(at_largest)} rows, over "
            f"{span:.0%} of the elongation: were the load cell or its amplifier at their limit? "
            "Leave these rows out"
        )
        yield Doubt("load-limit", False, text)
    first_taut = int(np.argmax(np.abs(load) > LIMITS.slack_load * load.max()))
    slack = float(elongation[:first_taut].max(initial=0.0)) / float(elongation.max())
    if LIMITS.slack < slack:
        text = (
            f"{name}: the load begins at {slack:.0%} of the elongation: the strip was slack in the "
            "grips; begin the elongation where the load begins"
        )
        yield Doubt("slack-strip", False, text)


def _of_failure(
    name: str,
    strip: Strip,
    elongation: Array,
    load: Array,
    by_points: bool,
) -> Iterator[Doubt]:
    """Yield a doubt if the load falls while the strip is pulled further.

    Parameters
    ----------
    elongation, load : (n,) array
        Of the curve, in mm and N.
    by_points : bool
        As in `doubts_of_strips`.
    """
    end = strip.elongation
    rows_after_end = np.flatnonzero(elongation > end * (1 + 1e-9))
    end_row = rows_after_end[0] if len(rows_after_end) else len(load)
    largest_until = np.maximum.accumulate(np.maximum(load, 0.0))
    is_late = elongation > LIMITS.slope_at * end
    for share in (LIMITS.failure_share, LIMITS.possible_failure_share):
        fallen_rows = np.flatnonzero((load < share * largest_until) & is_late)
        if len(fallen_rows) and (fallen_rows[0] < end_row or not by_points):
            row = fallen_rows[0]
            is_within = bool(row < end_row)
            remedy = ", or say a shorter final_length"
            if not is_within:
                remedy = ' or match = "points": the polynomial goes through them too'
            text = (
                f"{name}: the load falls from {largest_until[row]:.3g} to {load[row]:.3g} N at an "
                f"elongation of {elongation[row]:.3g} mm: rows after failure; cut them off with "
                f"until_largest_load = true{remedy}"
            )
            yield Doubt("after-failure", is_within and share == LIMITS.failure_share, text)
            return


@dataclass(frozen=True)
class TwinLimits:
    """Limits of differences between specimens, as shares of the largest load of a direction."""

    copy: float = 3e-4  # largest RMS deviation from the median, below which specimens are copies
    odd: float = 0.1  # RMS deviation from the median of all, above which a specimen is odd ...
    times: float = 4.0  # ... if it is as many times the deviation that its twins have
    pair: float = 0.3  # RMS difference of two specimens without a third
    exchanged: float = 0.6  # deviation from another direction over that from its twins


TWIN_LIMITS = TwinLimits()
#: Strains at which specimens are compared, as shares of that which all of them reach.
PLACES = np.linspace(0.2, 0.98, 40)


def doubts_of_specimens(strips: Mapping[str, Strip]) -> list[Doubt]:
    """Return the doubts about specimens that are alike to the digit, or unlike their twins."""
    doubts = list(_copies([(d, curve) for d, strip in strips.items() for curve in strip.curves]))
    for direction, strip in strips.items():
        if len(strip.curves) > 1:
            doubts += _odd_specimens(direction, strips)
    return doubts


def _copies(curves: Sequence[tuple[str, LoadCurve]]) -> Iterator[Doubt]:
    """Yield the doubt that two specimens hold the same readings."""
    for (direction, first), (other_direction, second) in combinations(curves, 2):
        is_copy = np.array_equal(first.load, second.load)
        if is_copy and np.array_equal(first.elongation, second.elongation):
            text = (
                f"{_name(direction, first)} and {_name(other_direction, second)} hold the same "
                "readings to the last digit: one curve is given twice, and would count as two "
                "specimens without scatter"
            )
            yield Doubt("repeated-specimen", True, text)
            return


def _name(direction: str, curve: LoadCurve) -> str:
    """Return how a curve is called: direction, specimen and file."""
    file = "" if curve.path is None else f" ({curve.path.name})"
    return f"{direction}, {curve.specimen}{file}"


def _odd_specimens(direction: str, strips: Mapping[str, Strip]) -> Iterator[Doubt]:
    """Yield the doubts about specimens of a direction that are unlike their twins, or too alike."""
    strip = strips[direction]
    end = min(float(curve.elongation.max()) for curve in strip.curves) / strip.gauge_length
    loads = _loads_at(strip, end)
    largest = float(np.abs(loads).max())
    if not end > 0 or not largest > 0:
        return
    deviations = np.array([_rms(load - np.median(loads, axis=0)) / largest for load in loads])
    if 0 < deviations.max() < TWIN_LIMITS.copy:
        text = (
            f"the {len(loads)} specimens of the {direction} differ by {deviations.max():.2%} of "
            "the largest load, and specimens of a fabric by some per cent: is it one curve saved "
            "several times?"
        )
        yield Doubt("repeated-specimen", False, text)
    if len(loads) == 2:
        yield from _odd_pair(direction, strip, _rms(loads[0] - loads[1]) / largest)
        return
    for k in np.flatnonzero(deviations > TWIN_LIMITS.odd):
        usual = float(np.median(np.delete(deviations, k)))
        if deviations[k] > TWIN_LIMITS.times * usual:
            name = _name(direction, strip.curves[k])
            distance = deviations[k] * largest
            likeness = _like_other_direction(direction, strips, loads[k], end, distance)
            text = (
                f"{name}: its loads differ by {deviations[k]:.0%} (RMS, of the largest load) from "
                f"those of its {len(loads) - 1} twins, which differ by {usual:.1%}: {likeness}"
                "look at its curve, and leave the file out if it slipped or is mislabelled"
            )
            yield Doubt("odd-specimen", False, text)


def _odd_pair(direction: str, strip: Strip, difference: float) -> Iterator[Doubt]:
    """Yield the doubt about two specimens, without a third, of which nobody knows which is odd."""
    first, second = (_name(direction, curve) for curve in strip.curves)
    if difference > TWIN_LIMITS.pair:
        text = (
            f"{first} and {second} differ by {difference:.0%} (RMS, of the largest load): one of "
            "them slipped, is mislabelled or has other columns; look at both curves"
        )
        yield Doubt("odd-specimen", False, text)


def _like_other_direction(
    direction: str,
    strips: Mapping[str, Strip],
    load: Array,
    end: float,
    distance: float,
) -> str:
    """Return words that name the direction whose specimens have about this load; "" for none.

    Parameters
    ----------
    load : (places,) array, N
        Loads of the specimen at `PLACES`.
    end : float
        Strain of the gauge that all specimens reach.
    distance : float, N
        RMS deviation of the load from its twins.
    """
    for name, strip in strips.items():
        if name == direction or not strip.curves:
            continue
        if _rms(load - np.median(_loads_at(strip, end), axis=0)) < TWIN_LIMITS.exchanged * distance:
            return f"it is like those of the {name}, so that labels may be exchanged; "
    return ""


def _loads_at(strip: Strip, end: float) -> Array:
    """Return the loads (specimens, places), N, at shares of a strain `end` of the gauge."""
    strains = end * PLACES
    return np.array(
        [
            np.interp(strains, curve.elongation / strip.gauge_length, curve.load)
            for curve in strip.curves
        ]
    )


def _rms(values: Array) -> float:
    """Return the root of the mean square of values (n,)."""
    return float(np.sqrt(np.mean(values**2)))
