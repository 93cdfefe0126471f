"""Every ccx on this machine, tried on the bars."""

from __future__ import annotations

from pathlib import Path

from ...errors import BubblefitError
from ..bars import difference
from ..base import Diagnosis
from .executable import ADVICE, FOUND, NAMED, Executable, every_ccx
from .proof import prove


def diagnose(named: Path | str | None = None) -> list[Diagnosis]:
    """All there are (`named`: one more, by path).

    One that is not there at all is an entry without a path, expected only if it was named.
    """
    try:
        candidates = every_ccx(named)
    except BubblefitError as error:
        return [_absent(str(error), NAMED, True)]
    if not candidates:
        return [_absent(f"there is no ccx; {ADVICE}", "not found", False)]
    return [_tried(candidate) for candidate in candidates]


def _absent(advice: str, origin: str, expected: bool) -> Diagnosis:
    return Diagnosis("calculix", "", None, origin, expected, None, False, advice=advice)


def _tried(ccx: Executable) -> Diagnosis:
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
    carries = {True: "yes", False: "no", None: "cannot be seen"}[ccx.external]
    return Diagnosis("calculix", ccx.version, ccx.path, ccx.origin, expected, ccx.external,
                     usable, stresses, off, advice, f"external materials: {carries}")  # fmt: skip
