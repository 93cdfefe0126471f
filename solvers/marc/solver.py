"""MSC Marc behind the solver protocol: a deck, a run of run_marc, its results."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from ...errors import InputError, SolverFailure
from ...materials.exports.marc_hypela2 import hypela2_source
from ...materials.law import HypoelasticLaw
from ...models.bubble import BubbleModel
from ...models.cylinder import CylinderModel
from ...models.uniaxial import UniaxialModel
from ..base import History, SolverCheck
from ..process import Watch, run_process
from ..pulls import as_the_membrane, corrected, direct, evenly
from ..scratch import remove, run_folder
from .bubble import bubble_deck
from .command import find_marc, run_command
from .deck import JOB
from .reasons import ending
from .results import bubble_history, opened, strip_history
from .settings import MarcSettings, marc_settings
from .strip import strip_deck
from .sts import Increment, increments

log = logging.getLogger(__name__)

SCREEN = "screen.txt"
SUBROUTINE = "hypela2.f"
#: Settings that change what the deck or the subroutine says.
DECK_SETTINGS = (
    "law", "element", "increments", "pressure_type", "pressure_sign", "own_state", "symmetric",
    "templates",
)  # fmt: skip
Model = BubbleModel | UniaxialModel | CylinderModel
T = TypeVar("T")
#: Makes something of the .t19 file and the number of iterations.
Reader = Callable[[Path, int], T]


class NoLicence(SolverFailure):
    """Marc never began, for want of a licence: another try may do."""


class MarcSolver:
    """A licensed MSC Marc as a subprocess.

    Parameters
    ----------
    marc : run_marc, or a file of the site's settings (.toml); BUBBLEFIT_MARC, else run_marc on
        the PATH, unless given.
    progress : called with every increment that ended while a run is under way.
    settings : those of `MarcSettings` by name; None: not given.

    Raises
    ------
    InputError : a setting that cannot be used.
    """

    name = "marc"
    external = True

    def __init__(
        self,
        marc: Path | str | None = None,
        progress: Callable[[Increment], None] | None = None,
        **settings: Any,
    ) -> None:
        self.settings: MarcSettings = marc_settings(settings, None if marc is None else str(marc))
        self.progress = progress

    @property
    def identity(self) -> str:
        """All that changes a result: the settings of the deck, and the site's own blocks."""
        return repr([
            *(getattr(self.settings, name) for name in DECK_SETTINGS),
            *((name, Path(file).read_bytes()) for name, file in self.settings.include.items()),
        ])  # fmt: skip

    def check(self) -> SolverCheck:
        """Whether there is a run_marc. That it carries the law, `doctor` and docs/marc.md show."""
        try:
            find_marc(self.settings)
        except SolverFailure as failure:
            return SolverCheck(self.name, False, self.settings.version, False, failure.reason)
        return SolverCheck(self.name, True, self.settings.version, True)

    def run(
        self,
        model: Model,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
    ) -> History:
        """Inflate or pull the model.

        Parameters
        ----------
        scratch : the folder below which the run's own is made.
        timeout : s, of one run of Marc; waiting for a licence is not counted.

        Raises
        ------
        SolverFailure : it did not end well; the scratch folder is kept and named.
        InputError : a template or file that cannot be used, a Marc that cannot be started.
        """
        repeats: list[int] = []

        def once(deck: str, units: int, read: Reader[T]) -> T:
            return self._once(deck, law, units, read, scratch, timeout, repeats)

        if isinstance(model, BubbleModel):
            deck = bubble_deck(model, law, self.settings)
            history = once(
                deck, len(model.increments), lambda t19, n: bubble_history(t19, model, n)
            )
        elif isinstance(model, UniaxialModel):
            history = self._strip(model, law, once)
        else:
            raise InputError(None, "model", "Marc bends no cylinders yet")
        if sum(repeats):
            remark = f"{sum(repeats)} increments were repeated after they did not converge"
            history = replace(history, remarks=(*history.remarks, remark))
        return history

    def _strip(
        self, model: UniaxialModel, law: HypoelasticLaw, once: Callable[..., Any]
    ) -> History:
        """A strip, its grips driven as `pulls` tells."""
        driven = direct(model)
        pulls = driven if driven is not None else as_the_membrane(model, law)
        if pulls is None:
            even = evenly(model)
            deck = strip_deck(model, law, self.settings, even)
            gauge = once(deck, len(even), lambda t19, _: opened(t19, model, len(even)))
            pulls = corrected(model, even, gauge, self.name)
        count = len(pulls)

        def read(t19: Path, iterations: int) -> History:
            return strip_history(t19, model, count, driven is not None, iterations)

        history: History = once(strip_deck(model, law, self.settings, pulls), count, read)
        return history

    def _once(
        self,
        deck: str,
        law: HypoelasticLaw,
        units: int,
        read: Reader[T],
        scratch: Path | None,
        timeout: float | None,
        repeats: list[int],
    ) -> T:
        """One run in a fresh scratch folder; again while there is no licence and time to wait."""
        settings = self.settings
        find_marc(settings)
        parent = scratch or (None if settings.scratch is None else Path(settings.scratch))
        seconds = timeout or settings.timeout
        last = time.monotonic() + settings.licence_wait
        while True:
            try:
                with run_folder("marc", parent, settings.keep, self.name, SCREEN) as folder:
                    return self._in(folder, deck, law, units, read, seconds, repeats)
            except NoLicence as failure:
                if time.monotonic() + settings.licence_retry > last:
                    raise
                log.info("%s; trying again in %g s", failure.reason, settings.licence_retry)
                if failure.scratch is not None:
                    remove(failure.scratch)
                time.sleep(settings.licence_retry)

    def _in(
        self,
        folder: Path,
        deck: str,
        law: HypoelasticLaw,
        units: int,
        read: Reader[T],
        timeout: float,
        repeats: list[int],
    ) -> T:
        """One run in a folder that is empty at its start."""
        subroutine = None
        try:
            (folder / f"{JOB}.dat").write_text(deck, encoding="ascii", errors="replace")
            if self.settings.law == "hypela2":
                subroutine = SUBROUTINE
                (folder / SUBROUTINE).write_text(self._source(law), encoding="ascii")
        except OSError as error:
            raise SolverFailure(f"the deck cannot be written: {error.strerror}") from None
        outcome = run_process(
            run_command(self.settings, JOB, subroutine),
            folder,
            folder / SCREEN,
            timeout,
            self.settings.environment,
            self._watch(folder / f"{JOB}.sts"),
        )
        end = ending(folder, JOB, SCREEN, outcome, timeout, float(units))
        if end.problem is not None:
            kind = NoLicence if end.licence else SolverFailure
            raise kind(end.problem, self.name, end.number, end.said)
        repeats.append(end.repeated)
        return read(folder / f"{JOB}.t19", end.iterations)

    def _source(self, law: HypoelasticLaw) -> str:
        """The user subroutine with the law's constants."""
        own_state, symmetric = self.settings.own_state, self.settings.symmetric
        return hypela2_source({1: law}, own_state=own_state, symmetric=symmetric)

    def _watch(self, sts: Path) -> Watch[Increment] | None:
        return None if self.progress is None else Watch(lambda: increments(sts), self.progress)
