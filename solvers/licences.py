"""Licences of an external program: counted while it runs, asked for again where one is denied."""

from __future__ import annotations

import inspect
import os
import random
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeVar

from ..errors import LicenceDenied, SolverFailure
from ..materials.law import HypoelasticLaw
from .base import BandedSolver, DifferentiatingSolver, History, Solver, announce
from .process import check_wanted, kept_open
from .scratch import remove
from .settings import SCHEDULER, LicenceSettings, licence_settings
from .wrapped import WrappedBand, WrappedSolver

T = TypeVar("T")
#: Pauses between tries grow by GROWTH, up to MOST times the first one.
GROWTH, MOST = 2.0, 10.0


def licensed(solver: Solver, name: str, given: Mapping[str, Any]) -> Solver:
    """The solver, every run of which has a licence; itself where its licences do not matter.

    Parameters
    ----------
    name : by which its licences are counted. given : what options say of licences.

    Raises
    ------
    InputError : a value that cannot be meant.
    """
    plain = {key: value for key, value in given.items() if key != SCHEDULER}
    settings = licence_settings(name, plain)
    if not solver.external or (settings.licences is None and settings.wait <= 0):
        return solver
    # What it can do beside running a model must be asked of it as before.
    protocols = ((_Slopes, DifferentiatingSolver), (WrappedBand, BandedSolver))
    more: list[type] = [part for part, protocol in protocols if isinstance(solver, protocol)]
    # Not by asking for them: where there is no program that is an error, of whoever runs it.
    if inspect.getattr_static(solver, "programs", None) is not None:
        more.append(_Program)
    # A cache of runs asks which module a solver's code is in.
    own = {"__module__": type(solver).__module__}
    kind: Any = type("LicensedSolver", (LicensedSolver, *more), own)
    made: Solver = kind(solver, settings, given.get(SCHEDULER))
    return made


class LicensedSolver(WrappedSolver):
    """A solver that runs only while it has a licence.

    Parameters
    ----------
    solver : what runs; a run of it may start its program more than once, all with one licence.
    settings : how many there are, and what is done where one is denied. scheduler : address of the
    Dask scheduler that counts them too.
    """

    def __init__(
        self, solver: Solver, settings: LicenceSettings, scheduler: str | None = None
    ) -> None:
        super().__init__(solver)
        self.licences, self.scheduler = settings, scheduler

    def run(
        self,
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
        **more: Any,
    ) -> History:
        """Run the model with a licence; raises as the solver, and as `held`."""
        return self._with_one(lambda: self.solver.run(model, law, scratch, timeout, **more))

    def _with_one(self, run: Callable[[], T]) -> T:
        with held(self.name, self.licences, self.scheduler):
            return patiently(run, self.name, self.licences)


class _Slopes:
    """Of a solver that differentiates."""

    def run_with_sensitivity(self: Any, *given: Any, **named: Any) -> Any:
        """As the solver, with a licence."""
        return self._with_one(lambda: self.solver.run_with_sensitivity(*given, **named))


class _Program:
    """Of a solver that names the programs it runs."""

    @property
    def programs(self: Any) -> tuple[Path, ...]:
        """The solver's own."""
        found: tuple[Path, ...] = self.solver.programs
        return found


@contextmanager
def held(name: str, settings: LicenceSettings, scheduler: str | None = None) -> Iterator[None]:
    """Hold a licence of the program `name`, when one is free; nothing where they are not counted.

    First of the machine's, then of the cluster's where a scheduler counts too: in this order
    everywhere, so that nobody waits for one who waits for him.

    Raises
    ------
    InputError : nothing can be counted there. BubblefitError : the scheduler does not answer.
    """
    if settings.licences is None:
        yield
        return
    # Not where nothing is licensed: locks of files are Unix's, and Dask is an extra.
    from .licence_locks import locked

    me = f"{socket.gethostname()} {os.getpid()} {threading.get_ident()} {name}"
    said = False

    def waiting() -> None:
        nonlocal said
        check_wanted()
        if not said:
            announce(f"waiting for a licence of {name}", me)
        said = True

    folder = settings.licence_folder
    with ExitStack() as stack:
        try:
            file = stack.enter_context(
                locked(name, settings.licences, None if folder is None else Path(folder), waiting)
            )
            if scheduler is not None:
                from .licence_leases import leased

                stack.enter_context(leased(name, settings.licences, scheduler, waiting))
        finally:
            if said:
                announce("", me)
        stack.enter_context(kept_open(file))
        yield


def patiently(run: Callable[[], T], name: str, settings: LicenceSettings) -> T:
    """Run; where the program was denied a licence, again, until the time for that is over.

    Pauses double up to ten times the first one, each longer or shorter by chance, so that those
    who were denied together do not ask together again.

    Raises
    ------
    SolverFailure : as `run`; a licence was denied until the time was over (`LicenceDenied`).
    """
    begun, pause, tries = time.monotonic(), settings.licence_retry, 1
    while True:
        try:
            return run()
        except SolverFailure as failure:
            if not _denied(failure, settings):
                raise
            left = begun + settings.wait - time.monotonic()
            if left <= 0:
                reason = failure.reason
                if tries > 1:
                    reason += f"; {tries} tries in {settings.wait:g} s (licence_wait)"
                raise LicenceDenied(
                    reason, name, failure.exit_number, failure.log_tail, failure.scratch
                ) from None
            said, scratch = failure.reason, failure.scratch
        if scratch is not None:
            remove(scratch)  # of the last try only there is something to look into
        seconds = min(pause * random.uniform(0.5, 1.5), left)  # noqa: S311 (no secret)
        announce(f"{name}: {said}; trying again in {seconds:.3g} s, for {left:.0f} s more at most")
        time.sleep(seconds)
        pause, tries = min(GROWTH * pause, MOST * settings.licence_retry), tries + 1


def _denied(failure: SolverFailure, settings: LicenceSettings) -> bool:
    """Whether it failed for want of a licence, by its kind or by words of the site's own."""
    if isinstance(failure, LicenceDenied):
        return True
    text = f"{failure.reason}\n{failure.log_tail}".lower()
    return any(words.lower() in text for words in settings.licence_denied)
