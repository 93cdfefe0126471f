"""Auditor of bubble tests within a fit."""

import numpy as np


def objective(audit, test, section):
    """Return e: the sum of RMS errors over the largest measured value, by pressure and direction.

    Among several tests it is their mean.
    """
    rows = audit.blocks[test]
    total, count = 0.0, 0
    kind = section.get("objective", "e")
    for _, own in rows.groupby(["frame", "quantity"], sort=False):
        rms = float(np.sqrt(np.mean(own["difference"] ** 2)))
        largest = float(own["measured"].abs().max())
        total += rms / largest if kind == "e" or audit.several else rms
        count += 1
    if section.get("sheet") or section.get("nuisance"):
        # Priors of the sheet are part of the objective.
        return None
    return total / count if audit.several else total


def audit(audit, test, section, numbers):
    """Audit numbers, tables and files of one bubble."""
