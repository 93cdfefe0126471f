"""MSC Marc behind the solver protocol: a deck, a run of run_marc, its results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from ...errors import SolverFailure
from ...materials.exports.marc_hypela2 import hypela2_source
from ...materials.law import HypoelasticLaw
from ...models.bubble import BubbleModel
from ...models.cylinder import CylinderModel
from ...models.uniaxial import UniaxialModel
from ..base import History, SolverCheck
from ..pulls import as_the_membrane, corrected, direct, evenly
from .bubble import bubble_deck
from .command import find_marc
from .cylinder import APPROACH, bending_deck, inflation_deck
from .cylinder_results import cylinder_history, inflated
from .job import Job, Reader, run_job
from .results import bubble_history, opened, strip_history
from .settings import MarcSettings, marc_settings
from .strip import strip_deck
from .sts import Increment

#: Settings that change what the deck or the subroutine says.
DECK_SETTINGS = (
    "law", "element", "increments", "pressure_type", "pressure_sign", "own_state", "symmetric",
    "templates",
)  # fmt: skip
Model = BubbleModel | UniaxialModel | CylinderModel
T = TypeVar("T")


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
        """Inflate, pull or bend the model.

        Parameters
        ----------
        scratch : the folder below which the run's own is made.
        timeout : s, of one run of Marc; waiting for a licence is not counted.

        Raises
        ------
        SolverFailure : it did not end well; the scratch folder is kept and named.
        InputError : a template or file that cannot be used, a Marc that cannot be started.
        """
        settings, repeats, early = self.settings, 0, ""
        parent = scratch or (None if settings.scratch is None else Path(settings.scratch))

        def once(deck: str, units: int, read: Reader[T], rescue: Reader[T] | None = None) -> T:
            nonlocal repeats, early
            job = Job(deck, units, self._subroutine(law))
            found, end = run_job(job, settings, read, rescue, parent, timeout, self.progress)
            repeats += end.repeated
            early = early or end.problem or ""
            return found

        if isinstance(model, BubbleModel):
            deck = bubble_deck(model, law, self.settings)
            history = once(
                deck, len(model.increments), lambda t19, n: bubble_history(t19, model, n)
            )
        elif isinstance(model, UniaxialModel):
            history = self._strip(model, law, once)
        else:
            history = self._cylinder(model, law, once)
        remarks = [*history.remarks, *([early] if early else [])]
        if repeats:
            remarks.append(f"{repeats} increments were repeated after they did not converge")
        return replace(history, remarks=tuple(remarks))

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

    def _cylinder(
        self, model: CylinderModel, law: HypoelasticLaw, once: Callable[..., Any]
    ) -> History:
        """Inflation alone, to know where collar and supports touch; then all, up to a collapse."""
        shape = once(
            inflation_deck(model, law, self.settings),
            len(model.inflation),
            lambda t19, _: inflated(t19, model),
        )
        history: History = once(
            bending_deck(model, law, self.settings, shape),
            len(model.inflation) + APPROACH + len(model.increments),
            lambda t19, n: cylinder_history(t19, model, n),
            lambda t19, n: cylinder_history(t19, model, n, ended=False),
        )
        return history

    def _subroutine(self, law: HypoelasticLaw) -> str | None:
        """HYPELA2 with the law's constants, where it is the way that was chosen."""
        settings = self.settings
        if settings.law != "hypela2":
            return None
        return hypela2_source({1: law}, own_state=settings.own_state, symmetric=settings.symmetric)
