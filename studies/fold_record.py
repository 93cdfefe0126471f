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
    known = {} if folder is None else written_folds(folder / VALIDATION, mark)
    for event in validate(setup, folds, starts, tuple(known)):
        if event is not None:
            known[event.fold] = event
            if folder is not None:
                plain = [known[fold].to_json() for fold in sorted(known)]
                write_marked(folder, VALIDATION, mark, {"folds": plain})
        tell(event)
    return tuple(known[fold] for fold in sorted(known))


def written_folds(path: Path, mark: str) -> dict[int, FoldError]:
    """What an interrupted run has validated already, by fold; nothing of another fit."""
    found = read_marked(path, mark, lambda told: [FoldError(**fold) for fold in told["folds"]])
    return {error.fold: error for error in found or ()}
