"""Errors of the folds of one fit: computed, or as an interrupted comparison has written them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..fits.result import Fit
from ..fits.setup import FitSetup, fingerprints
from .folds import FoldError, validate
from .marked import mark_of, read_marked, write_marked

VALIDATION = "validation.json"


def validated_folds(
    setup: FitSetup,
    found: Fit,
    folds: int,
    starts: int,
    folder: Path | None,
    tell: Callable[[FoldError | None], None],
) -> tuple[FoldError, ...]:
    """Errors of the folds, as they were written where they are of this fit.

    folds, starts : how many folds at most, and random starts of each. folder : of the fit, where
    the errors are written; None where nothing is. tell : hears each fold that ended, and time pass.
    """
    parts = {**fingerprints(setup, found.problem), "folds": folds, "starts": starts}
    mark = mark_of(parts)
    known = None if folder is None else written_folds(folder / VALIDATION, mark)
    if known is not None:
        return known
    ended: dict[int, FoldError] = {}
    for event in validate(setup, folds, starts):
        if event is not None:
            ended[event.fold] = event
        tell(event)
    errors = tuple(ended[fold] for fold in sorted(ended))
    if folder is not None:
        write_marked(folder, VALIDATION, mark, {"folds": [fold.to_json() for fold in errors]})
    return errors


def written_folds(path: Path, mark: str) -> tuple[FoldError, ...] | None:
    """What an interrupted run has validated already; None when it is not of this fit."""
    return read_marked(path, mark, lambda told: tuple(FoldError(**fold) for fold in told["folds"]))
