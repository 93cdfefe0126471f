"""Every solver on this machine, tried on bars whose end stresses are published."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import __version__
from ..errors import BubblefitError
from ..materials.law import HypoelasticLaw
from ..materials.responses import bar
from .bars import BARS, INCREMENTS, TOLERANCE, bar_law, difference, strip_stresses
from .calculix.executable import ADVICE, FOUND, NAMED, Executable, every_ccx
from .calculix.proof import prove
from .marc.command import find_marc
from .marc.proof import prove as prove_marc
from .marc.settings import VARIABLE
from .marc.solver import MarcSolver
from .plugins import PlugIn, plug_ins
from .registry import SOLVERS, checked, solver_named

EMBEDDED = "embedded"
Stresses = tuple[float, ...] | None


@dataclass(frozen=True)
class Diagnosis:
    """One solver: what it is, where, and what the bars showed.

    external_materials: whether it can load material libraries (None: embedded, a plug-in, or not
    to be seen). stresses: end stresses of the bars (MPa) in the order of `bars.BARS`, difference:
    the largest relative one from Marc's; None where the bars did not run. expected: somebody chose
    this solver, so that it has to work. advice: one line, what to do or what was not tried.
    """

    name: str
    version: str
    path: Path | None
    origin: str
    expected: bool
    external_materials: bool | None
    usable: bool
    stresses: tuple[float, ...] | None = None
    difference: float | None = None
    advice: str = ""


def diagnose(ccx: Path | str | None = None, marc: Path | str | None = None) -> list[Diagnosis]:
    """The embedded solver, every ccx (`ccx`: one more, by path), Marc, every plug-in, each tried.

    A ccx that is not there at all is one entry without a path, expected only if it was named. A
    Marc (`marc`: the one to look at) has an entry only if it is there or was named.
    """
    plugged = (_plug_in(one) for one in plug_ins())
    return [_membrane(), *_every_calculix(ccx), *_marc(marc), *plugged]


def _every_calculix(named: Path | str | None) -> list[Diagnosis]:
    try:
        candidates = every_ccx(named)
    except BubblefitError as error:
        return [_absent(str(error), NAMED, True)]
    if not candidates:
        return [_absent(f"there is no ccx; {ADVICE}", "not found", False)]
    return [_calculix(candidate) for candidate in candidates]


def _marc(named: Path | str | None) -> list[Diagnosis]:
    origin = NAMED if named is not None else VARIABLE if os.environ.get(VARIABLE) else FOUND
    expected = origin != FOUND
    path, stresses, off, advice, version = None, None, None, "", ""
    try:
        solver = MarcSolver(named)
        version = solver.settings.version or "?"
        path = find_marc(solver.settings)
        stresses = prove_marc(solver)
        off = difference(stresses)
    except BubblefitError as error:
        if path is None and not expected:
            return []
        advice = str(error).splitlines()[0]
    return [Diagnosis("marc", version, path, origin, expected, None, stresses is not None,
                      stresses, off, advice)]  # fmt: skip


def _absent(advice: str, origin: str, expected: bool) -> Diagnosis:
    return Diagnosis("calculix", "", None, origin, expected, None, False, advice=advice)


def _membrane() -> Diagnosis:
    stresses = tuple(
        _end_stress(bar_law(bar.model), bar.elongation, 0 if bar.direction == "warp" else 1)
        for bar in BARS
    )
    off = difference(stresses)
    good = off < TOLERANCE
    advice = "" if good else "the embedded law is broken; install bubblefit and numba again"
    return Diagnosis("membrane", __version__, None, EMBEDDED, True, None, good,
                     stresses, off, advice)  # fmt: skip


def _calculix(ccx: Executable) -> Diagnosis:
    expected = ccx.origin != FOUND
    usable, stresses, off, advice = False, None, None, ""
    if ccx.external is False:
        advice = f"cannot load material libraries; {ADVICE}"
    else:
        try:
            stresses = prove(ccx.path)
            usable, off = True, difference(stresses)
        except BubblefitError as error:
            advice = str(error).splitlines()[0]
    return Diagnosis("calculix", ccx.version, ccx.path, ccx.origin, expected, ccx.external,
                     usable, stresses, off, advice)  # fmt: skip


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
        return found(check.version, str(plug_in.failure("fails on a strip", error)))
    off = difference(stresses)
    advice = "" if off < TOLERANCE else f"does not carry the law: {off:.2g} from Marc's end stress"
    return found(check.version, advice, off < TOLERANCE, stresses)


def _end_stress(law: HypoelasticLaw, elongation: float, pulled: int) -> float:
    """Cauchy stress (MPa) of a bar pulled along warp (0) or fill (1), the other direction free.

    The law's own increments, the ones the membrane solver takes.
    """
    ends = np.log1p(elongation * np.arange(1, INCREMENTS + 1) / INCREMENTS)
    return float(bar(law, pulled, ends)[1][-1, pulled])
