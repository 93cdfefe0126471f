"""What the thesis saw in its bending tests (chapter 6), checked on the runs that are there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from ..projects.bend import BendCase, BendProject
from .bend_measures import PLACES, BendMeasures

Found = Mapping[tuple[str, str], BendMeasures]

#: Nearly linear: least R^2 and largest deviation up to half of the buckling load.
LEAST_R2, MOST_OFF = 0.99, 0.05
#: Strain that the inflated models were to reach at the three pressures, and how near is near.
INFLATION, NEAR = (0.06, 0.08, 0.10), 0.01
#: Table 6.1, MPa by diameter in mm.
PRESSURES = {150.0: (0.09, 0.11, 0.14), 200.0: (0.06, 0.08, 0.10), 250.0: (0.05, 0.065, 0.085)}
#: Up to 30 %.
SPREAD = (0.2, 0.4)
#: Almost double.
RATIO = (1.7, 2.1)
#: kPa that the pressure rose by, of 150 mm at 140 kPa to 240 mm, and how near is near, of it.
RISE, CLOSE = 1.1, 0.25
TOLERANCES = (
    f"Near a strain: within {NEAR:g}. Up to 30 % (at {PLACES[0]:g} mm): {100 * SPREAD[0]:.0f} to "
    f"{100 * SPREAD[1]:.0f} %. Almost twice: {RATIO[0]:g} to {RATIO[1]:g}. Nearly linear: "
    f"R² of {LEAST_R2:g} or more and at most {100 * MOST_OFF:g} % off a straight line up to half "
    f"of the buckling load. Pressure: the rise within {100 * CLOSE:g} % with any of the cards, as "
    "the thesis does not say with which."
)


@dataclass(frozen=True)
class Statement:
    """One sentence of the thesis against the runs.

    thesis : what it says and where. found : what the runs say. holds : None where they do not
    allow a check. part : of how many checks how many hold, where there are several.
    """

    thesis: str
    found: str
    holds: bool | None
    part: tuple[int, int] = (0, 1)

    @property
    def verdict(self) -> str:
        """In a word."""
        if self.holds is False and self.part[0]:
            return f"holds in {self.part[0]} of {self.part[1]}"
        return {True: "holds", False: "does not hold", None: "not checked"}[self.holds]


def statements(project: BendProject, found: Found) -> list[Statement]:
    """All of them, in the order of the thesis.

    found : measures of the runs that ended, by names of case and card.
    """
    checks = (
        _inflation,
        _pressure,
        _spread,
        _buckling,
        _diameter,
        _linear,
        _gas,
        _soft,
        _under,
        _over,
    )
    return [check(project, found) for check in checks]


def _inflation(project: BendProject, found: Found) -> Statement:
    text = (
        "Inflated, the model with the uniaxial card reaches a strain of 0.06, 0.08 and 0.10 at the "
        "three pressures of each diameter (6.2)"
    )
    said, good = [], []
    for card in _named(project, "uniaxial"):
        for diameter, pressures in PRESSURES.items():
            for gauge, strain in zip(pressures, INFLATION, strict=True):
                for case in project.cases:
                    same = _same(case.diameter, diameter) and _same(case.pressure, gauge)
                    if same and (case.name, card) in found:
                        value = max(found[case.name, card].body_strain)
                        good.append(abs(value - strain) <= NEAR)
                        said.append(f"{case.name} {value:.3f} ({strain:.2f})")
    return _verdict(text, said, good, "needs a uniaxial card and a case of Table 6.1")


def _pressure(project: BendProject, found: Found) -> Statement:
    text = "Stiffer with more pressure (6.3)"
    return _order(text, project, found, _by_pressure(project), "two pressures of one diameter")


def _spread(project: BendProject, found: Found) -> Statement:
    text = "At one deflection the load changes by up to 30 % from lowest to highest pressure (6.3)"
    said, good = [], []
    for card in project.cards:
        changes = []
        for group in _by_pressure(project):
            runs = [found[c.name, card] for c in group if (c.name, card) in found]
            first, last = (runs[0].loads[0], runs[-1].loads[0]) if len(runs) > 1 else (None, None)
            if first is not None and last is not None and first > 0:
                changes.append(last / first - 1)
        if changes:
            good.append(SPREAD[0] <= max(changes) <= SPREAD[1])
            said.append(f"{card} {100 * max(changes):.0f} %")
    return _verdict(text, said, good, f"needs two pressures of one diameter to {PLACES[0]:g} mm")


def _diameter(project: BendProject, found: Found) -> Statement:
    text = "Stiffer with larger diameter: lowest, middle and highest pressure of each (6.3)"
    return _order(text, project, found, _by_diameter(project), "two diameters of Table 6.1")


def _buckling(project: BendProject, found: Found) -> Statement:
    text = "150 mm: the buckling load at 140 kPa is almost twice that at 90 kPa (6.3)"
    low, high = (_case(project, 150.0, p) for p in (0.09, 0.14))
    said, good = [], []
    for card in project.cards if low and high else ():
        assert low is not None and high is not None
        one, two = found.get((low.name, card)), found.get((high.name, card))
        if one is None or two is None:
            continue
        for kind in ("limit", "knee"):  # like with like
            first, second = getattr(one, kind), getattr(two, kind)
            if first and second:
                ratio = second[1] / first[1]
                good.append(RATIO[0] <= ratio <= RATIO[1])
                words = "limit points" if kind == "limit" else "knees"
                said.append(f"{card} {ratio:.2f} ({words} {first[1]:.0f}, {second[1]:.0f} N)")
                break
    return _verdict(text, said, good, "needs both cases, buckling with one card")


def _linear(project: BendProject, found: Found) -> Statement:
    text = "Load over deflection is nearly linear before buckling (6.3)"
    lines = {key: m.straightness for key, m in found.items() if m.straightness is not None}
    good = [r2 >= LEAST_R2 and off <= MOST_OFF for r2, off in lines.values()]
    if not lines:
        return Statement(text, "needs runs with four frames before buckling", None)
    worst = min(lines, key=lambda key: lines[key][0])
    r2, off = lines[worst]
    part = sum(good), len(good)
    tail = f"worst {worst[0]} with {worst[1]}: R² {r2:.4f}, {100 * off:.1f} % off a straight line"
    return Statement(text, f"to half of the buckling load; {tail}", all(good), part)


def _gas(project: BendProject, found: Found) -> Statement:
    text = "150 mm at 140 kPa: the pressure rises to 141.1 kPa at 240 mm (6.4, Fig. 6.11)"
    case = _case(project, 150.0, 0.14)
    said, good = [], []
    for card in project.cards if case else ():
        assert case is not None
        run = found.get((case.name, card))
        if run is not None and run.reached >= PLACES[-1] * (1 - 1e-9):
            good.append(abs(run.pressure_rise - RISE) <= CLOSE * RISE)
            said.append(f"{card} +{run.pressure_rise:.2f} kPa")
    # The thesis does not say with which card: one is enough.
    near = [True] if any(good) else good[:1]
    return _verdict(text, said, near, "needs this case to 240 mm")


def _soft(project: BendProject, found: Found) -> Statement:
    text = "The uniaxial card makes the beam softer than every bubble card (6.5)"
    said, good = [], []
    for case in project.cases:
        loads = {
            card: found[case.name, card].loads[0]
            for card in project.cards
            if (case.name, card) in found
        }
        for soft in _named(project, "uniaxial"):
            for stiff in _named(project, "bubble"):
                one, other = loads.get(soft), loads.get(stiff)
                if one is not None and other is not None:
                    good.append(one < other)
                    if not one < other:
                        said.append(f"not in {case.name}: {one:.0f} N, {stiff} {other:.0f} N")
    said.insert(0, f"{sum(good)} of {len(good)} pairs at {PLACES[0]:g} mm")
    return _verdict(text, said if good else [], good, "needs a uniaxial and a bubble card")


def _under(project: BendProject, found: Found) -> Statement:
    text = "The uniaxial card underestimates the measured loads in all tests (6.5)"
    return _against(text, project, found, "uniaxial", lambda mean: mean < 0)


def _over(project: BendProject, found: Found) -> Statement:
    text = "The bubble cards overestimate the measured loads (6.5)"
    return _against(text, project, found, "bubble", lambda mean: mean > 0)


def _against(
    text: str, project: BendProject, found: Found, test: str, good: Callable[[float], bool]
) -> Statement:
    errors = [
        m.error.mean
        for (_, card), m in found.items()
        if project.cards[card].test == test and m.error is not None
    ]
    kept = [good(mean) for mean in errors]
    if not errors:
        return Statement(text, f"needs measured loads and a {test} card", None)
    spread = f"mean {min(errors):+.0f} to {max(errors):+.0f} N"
    return _verdict(text, [f"{sum(kept)} of {len(kept)} runs; {spread}"], kept, "")


def _order(
    text: str, project: BendProject, found: Found, groups: Sequence[Sequence[BendCase]], need: str
) -> Statement:
    """Whether the stiffness rises along each group, with each card."""
    said, good, changes = [], [], []
    for group in groups:
        for card in project.cards:
            for one, other in pairwise([c for c in group if (c.name, card) in found]):
                first = found[one.name, card].stiffness
                second = found[other.name, card].stiffness
                if first is None or second is None:
                    continue
                good.append(second > first)
                changes.append(second / first - 1)
                if not second > first:
                    words = f"{first:.2f} and {second:.2f} N/mm"
                    said.append(f"not {one.name} to {other.name} with {card}: {words}")
    if good:
        low, high = 100 * min(changes), 100 * max(changes)
        steps = f"{sum(good)} of {len(good)} steps, {low:+.0f} to {high:+.0f} %"
        said.insert(0, steps)
    return _verdict(text, said, good, f"needs {need}")


def _by_pressure(project: BendProject) -> list[list[BendCase]]:
    groups: dict[float, list[BendCase]] = {}
    for case in sorted(project.cases, key=lambda c: c.pressure):
        groups.setdefault(round(case.diameter, 6), []).append(case)
    return list(groups.values())


def _by_diameter(project: BendProject) -> list[list[BendCase]]:
    """The lowest, the middle and the highest pressures of Table 6.1."""
    groups = []
    for rank in range(len(INFLATION)):
        row = [_case(project, d, PRESSURES[d][rank]) for d in sorted(PRESSURES)]
        groups.append([case for case in row if case is not None])
    return groups


def _case(project: BendProject, diameter: float, pressure: float) -> BendCase | None:
    fits = (c for c in project.cases if _same(c.diameter, diameter) and _same(c.pressure, pressure))
    return next(fits, None)


def _named(project: BendProject, test: str) -> Iterator[str]:
    return (name for name, card in project.cards.items() if card.test == test)


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= 1e-6 * abs(other)


def _verdict(text: str, said: Sequence[str], good: Sequence[bool], need: str) -> Statement:
    if not good:
        return Statement(text, need, None)
    return Statement(text, "; ".join(said), all(good), (sum(good), len(good)))
