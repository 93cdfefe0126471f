"""Every solver on this machine, tried on bars whose end stresses are published."""

from __future__ import annotations

from pathlib import Path

from ..errors import BubblefitError
from .bars import TOLERANCE, difference, strip_stresses
from .base import Diagnosis
from .offer import Offer
from .plugins import PlugIn, plug_ins
from .registry import SOLVERS, checked, solver_named

Stresses = tuple[float, ...] | None


def diagnose(**programs: Path | str | None) -> list[Diagnosis]:
    """The embedded solver first, then our others as each says itself, then every plug-in.

    programs : by the option that names a solver's program (`ccx`, `marc`), the one to look at.
    """
    ours = [make for make in SOLVERS.values() if isinstance(make, Offer)]
    ours.sort(key=lambda offer: offer.program is not None)  # what needs no program is embedded
    found = []
    for offer in ours:
        found += offer.diagnose(programs.get(offer.program.name) if offer.program else None)
    return [*found, *(_plug_in(one) for one in plug_ins())]


def _plug_in(plug_in: PlugIn) -> Diagnosis:
    """Its own word, and the bars where it runs strips; whatever it does, the others are told."""
    origin = f"plug-in of {plug_in.distribution}"

    def found(
        version: str, advice: str, usable: bool = False, stresses: Stresses = None
    ) -> Diagnosis:
        off = None if stresses is None else difference(stresses)
        return Diagnosis(plug_in.name, version, None, origin, False, None, usable,
                         stresses, off, advice)  # fmt: skip

    if plug_in.name in SOLVERS:
        advice = f"{plug_in.name} is bubblefit's own: the plug-in needs another name"
        return found("", f"{advice}; tell those who make it")
    try:
        solver = solver_named(plug_in.name)
        check = checked(plug_in.name, solver)
    except BubblefitError as error:
        return found("", str(error).splitlines()[0])
    if not (check.available and check.carries_law):
        return found(check.version, check.advice or "says that it is not usable, and not why")
    try:
        stresses = strip_stresses(solver)
    except BubblefitError as error:
        # It may be for bubbles only, or have failed: the reader knows which.
        return found(check.version, f"its law was not tried: {str(error).splitlines()[0]}", True)
    except Exception as error:
        return found(check.version, str(plug_in.solver_failure("fails on a strip", error)))
    off = difference(stresses)
    advice = "" if off < TOLERANCE else f"does not carry the law: {off:.2g} from Marc's end stress"
    return found(check.version, advice, off < TOLERANCE, stresses)
