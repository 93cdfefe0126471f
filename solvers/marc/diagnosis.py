"""The Marc of this machine, tried on the bars."""

from __future__ import annotations

import os
from pathlib import Path

from ...errors import BubblefitError
from ..bars import difference
from ..base import Diagnosis
from .command import find_marc
from .proof import prove
from .settings import VARIABLE
from .solver import MarcSolver

NAMED, FOUND = "named", "PATH"


def diagnose(named: Path | str | None = None) -> list[Diagnosis]:
    """One entry (`named`: the one to look at), none where it is neither there nor was named."""
    origin = NAMED if named is not None else VARIABLE if os.environ.get(VARIABLE) else FOUND
    expected = origin != FOUND
    path, stresses, off, advice, version = None, None, None, "", ""
    try:
        solver = MarcSolver(named)
        version = solver.settings.version or "?"
        path = find_marc(solver.settings)
        stresses = prove(solver)
        off = difference(stresses)
    except BubblefitError as error:
        if path is None and not expected:
            return []
        advice = str(error).splitlines()[0]
    return [Diagnosis("marc", version, path, origin, expected, None, stresses is not None,
                      stresses, off, advice)]  # fmt: skip
