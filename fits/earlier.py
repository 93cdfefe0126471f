"""Starts from earlier evaluations: the history of another fit of the same law to the same tests."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..identification.starts import ProposedStarts
from .running_files import HEADER, HISTORY
from .store import PARTS, RUN

#: What has to be the same: where moduli mean the same, and are between the same bounds. Data, seed
#: and solver may be others.
SAME = ("law", "tests")
KEY = "fit.earlier (or --earlier)"


def proposals(
    folder: Path, parts: dict[str, str], columns: list[str], scale: float
) -> ProposedStarts:
    """What the evaluations in the folder of an earlier fit propose.

    Parameters
    ----------
    parts : digests of this fit, by what they are of. columns : names of the coefficients in a
    history. scale : MPa per unit of it.

    Raises
    ------
    InputError : no such folder, a fit of another model, no evaluation; no scikit-learn.
    """
    try:
        before = dict(json.loads((folder / RUN).read_text(encoding="utf-8"))[PARTS])
        text = (folder / HISTORY).read_text(encoding="utf-8", errors="replace")
    except (OSError, ValueError, KeyError, TypeError):
        problem = f"expected the folder of a fit, with {RUN} and {HISTORY}"
        raise InputError(folder, KEY, problem) from None
    other = [name for name in SAME if before.get(name) != parts[name]]
    if other:
        problem = f"is a fit of another model: its {' and '.join(other)} differ from this fit's"
        raise InputError(folder, KEY, f"{problem}; name a fit of this model, or start elsewhere")
    head, *rows = csv.reader(text[: text.rfind("\n") + 1].splitlines())
    if any(column not in head for column in columns):
        raise InputError(folder / HISTORY, KEY, f"has not the columns {', '.join(columns)}")
    places, value = [head.index(column) for column in columns], HEADER.index("objective")
    whole = [row for row in rows if len(row) == len(head) and row[value]]
    try:
        coefficients = np.array([[float(row[k]) for k in places] for row in whole]) * scale
        objectives = np.array([float(row[value]) for row in whole])
    except ValueError as error:
        raise InputError(folder / HISTORY, KEY, f"is damaged: {error}") from None
    good = np.isfinite(objectives)
    if not good.any():
        raise InputError(folder / HISTORY, KEY, "holds no evaluation that ended well")
    good &= np.isfinite(coefficients).all(axis=1)
    return ProposedStarts(coefficients[good], objectives[good])
