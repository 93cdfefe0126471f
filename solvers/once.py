"""An external solver that runs the same analysis once: a second time it is in the cache."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..content import digest_of
from ..errors import BubblefitError
from ..materials.law import HypoelasticLaw
from .base import BandedSolver, DifferentiatingSolver, History, ProgramSolver, Solver
from .decks import code_mark, program_mark
from .run_cache import RunCache
from .wrapped import WrappedBand, WrappedSolver

log = logging.getLogger(__name__)


def with_cache(solver: Solver, cache: RunCache, options: Mapping[str, Any]) -> Solver:
    """The solver with a cache before it, or as it is where that would be of no use.

    That is one that runs in this process, one that starts from a guess of its own path (it
    differentiates), and one that is asked to keep the folders of its runs.

    Parameters
    ----------
    options : what it was made with, as far as that changes a result.
    """
    if not solver.external or isinstance(solver, DifferentiatingSolver):
        return solver
    if getattr(solver, "keep", False):
        return solver
    kind = BandedOnce if isinstance(solver, BandedSolver) else Once
    return kind(solver, cache, options)


class Once(WrappedSolver):
    """A solver of the protocol `Solver`, whoever runs it, that looks into a cache before it runs.

    A run that fails is not kept: what made it fail (a licence, memory, a full disk) may be gone the
    next time, and its folder is there to look into.
    """

    def __init__(self, solver: Any, cache: RunCache, options: Mapping[str, Any]) -> None:
        super().__init__(solver)
        self.cache, self.options = cache, options

    def run(
        self,
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
    ) -> History:
        """The run from the cache (`History.from_cache`), else run and kept; as of the solver."""
        key = self.key(model, law)
        history = None if key is None else self.cache.read(key)
        if history is not None:
            return history
        given = {"scratch": scratch, "timeout": timeout}
        said = {name: value for name, value in given.items() if value is not None}
        begun = time.perf_counter()
        ended: History = self.solver.run(model, law, **said)
        if key is not None and isinstance(ended, History):
            seconds = time.perf_counter() - begun
            self.cache.write(key, ended, seconds)
            ended = replace(ended, seconds=seconds)
        return ended

    def key(self, model: Any, law: HypoelasticLaw) -> str | None:
        """Of everything that the run's result depends on; None where that cannot be said."""
        try:
            files = self.solver.programs if isinstance(self.solver, ProgramSolver) else ()
            program = [program_mark(path) for path in files]
            code = code_mark(type(self.solver).__module__)
            own = (self.name, self.solver.identity, dict(self.options), program, code)
            return digest_of("run", own, model, law)
        except (TypeError, BubblefitError) as error:  # whoever runs it is told of the latter
            log.info("runs of %s are not kept: %s", self.name, error)
            return None


class BandedOnce(WrappedBand, Once):
    """The same for a solver whose answer to some models is a band."""
