"""The solver MSC Marc: it writes input decks, runs run_marc, and reads the results."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import BubblefitError, SolverFailure
from ...materials.exports.subroutines import hypela2_source
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.cylinder_model import CylinderModel
from ...meshes.strip_models import UniaxialModel
from ...notes import Note, NoteKind
from ..bars import BARS, bar_law, bar_model, checked_stresses, difference, stress_of
from ..base import EARLY, Diagnosis, History, Progress, SolverCheck, analysis_of
from ..decks import JOB, UserDeck, file_mark, in_words, templates_mark
from ..settings import KEYS
from . import analyses
from .deck import MarcRun
from .job import SUBROUTINE, MarcJobs, find_marc
from .settings import VARIABLE, MarcSettings, marc_settings

REPEATED = NoteKind("repeated increments")

#: Settings that change what the deck or the subroutine says, or what Marc makes of them.
MATTERING = (
    "law",
    "element",
    "increments",
    "pressure_type",
    "pressure_sign",
    "own_state",
    "symmetric",
    "arguments",
)


def analyse_user_deck(
    model: UserDeck,
    law: HypoelasticLaw,
    settings: MarcSettings,
    run: MarcRun,
) -> History:
    """Run a deck of the user's; SolverFailure if the run fails or its results lack a value."""
    deck = str(model.files[f"{JOB}.dat"])
    return run(deck, 0, lambda t19, iterations: model.reader.read(t19.parent))


#: Analyses by the class of the model.
ANALYSES: dict[type, Callable[[Any, HypoelasticLaw, MarcSettings, MarcRun], History]] = {
    BubbleModel: analyses.analyse_bubble,
    UniaxialModel: analyses.analyse_strip,
    CylinderModel: analyses.analyse_cylinder,
    UserDeck: analyse_user_deck,
}


class MarcSolver:
    """Solver that runs a licensed MSC Marc.

    Parameters
    ----------
    marc : Path or str or None
        run_marc, or a site's .toml file of settings; unless given, by the environment variable
        BUBBLEFIT_MARC, else on the PATH.
    settings : object
        See `MarcSettings`.
    """

    name = "marc"
    external = True

    def __init__(
        self,
        marc: Path | str | None = None,
        progress: Callable[[Progress], None] | None = None,
        **settings: Any,
    ) -> None:
        self.settings: MarcSettings = marc_settings(settings, None if marc is None else str(marc))
        self.progress = progress

    @property
    def identity(self) -> str:
        """Return the settings of the deck; the site's templates and blocks by what is in them."""
        settings = self.settings
        return in_words(
            self.name,
            settings.version,
            **{name: getattr(settings, name) for name in MATTERING},
            include={name: file_mark(Path(file)) for name, file in settings.include.items()},
            templates=templates_mark(
                None if settings.templates is None else Path(settings.templates)
            ),
        )

    @property
    def programs(self) -> tuple[Path, ...]:
        """Return run_marc; none where only the site's modules know where it is."""
        program = find_marc(self.settings)
        return () if program is None else (program,)

    @property
    def keep(self) -> bool:
        """Return whether the folders of runs that end well stay."""
        return self.settings.keep

    @property
    def site_licences(self) -> dict[str, Any]:
        """Return what the site's file says of licences; the project's own words count more."""
        return {
            key: getattr(self.settings, key)
            for key in KEYS
            if key in self.settings.model_fields_set
        }

    def check(self) -> SolverCheck:
        """Return whether there is a run_marc; that it carries the law, `doctor` shows."""
        try:
            find_marc(self.settings)
        except SolverFailure as failure:
            return SolverCheck(self.name, False, self.settings.version, False, failure.reason)
        return SolverCheck(self.name, True, self.settings.version, True)

    def run(
        self,
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
    ) -> History:
        """Run the analysis of a model and return its history; see `Solver.run`.

        SolverFailure of a failed run names its scratch folder. InputError for a model, a law or a
        template that cannot be used.
        """
        settings = self.settings
        files = dict[str, Any]()
        source: str | None = None
        if isinstance(model, UserDeck):
            files |= model.files
            source = files.get(SUBROUTINE)
            timeout = timeout or model.timeout
        elif settings.law == "hypela2":
            own_state = settings.own_state
            symmetric = settings.symmetric
            source = hypela2_source({1: law}, own_state=own_state, symmetric=symmetric)
        parent = scratch or (None if settings.scratch is None else Path(settings.scratch))
        jobs = MarcJobs(
            settings,
            source,
            parent,
            timeout=timeout,
            on_progress=self.progress,
            files=files,
        )
        history = analysis_of(ANALYSES, model, self.name)(model, law, settings, jobs)
        early = jobs.early
        remarks = [*history.remarks]
        if early:
            remarks.append(Note(EARLY, early))
        if jobs.repeats:
            words = f"{jobs.repeats} increments were repeated after they did not converge"
            remarks.append(Note(REPEATED, words))
        reason = f"{history.early}: {early}" if history.early and early else history.early
        return replace(history, remarks=tuple(remarks), early=reason)


def prove(solver: MarcSolver, timeout: float = 600.0) -> tuple[float, ...]:
    """Return the stresses (MPa) at the ends of the published bars BARS, computed by this Marc.

    SolverFailure if one is off by more than TOLERANCE.
    """
    stresses = []
    for bar in BARS:
        # The table of the modulus ends with the bar: to the reach of a law without a range its
        # points would lie so far apart that the warp bar is 2e-4 off.
        end = np.full(3, np.log1p(bar.elongation))
        model = bar_model(bar)
        law = replace(bar_law(bar.model), strain_range=end)
        stresses.append(stress_of(model, solver.run(model, law, timeout=timeout)))
    return checked_stresses(tuple(stresses), "this Marc", solver.name)


NAMED = "named"
ON_PATH = "PATH"


def diagnose(named: Path | str | None = None) -> list[Diagnosis]:
    """Return the diagnosis of Marc in a list, which is empty if it is neither found nor named.

    Parameters
    ----------
    named
        run_marc or a site's .toml file to be tried.
    """
    origin = NAMED if named is not None else VARIABLE if os.environ.get(VARIABLE) else ON_PATH
    expected = origin != ON_PATH
    path = None
    stresses = None
    off = None
    advice = ""
    version = ""
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
    return [
        Diagnosis(
            name="marc",
            version=version,
            path=path,
            origin=origin,
            expected=expected,
            usable=stresses is not None,
            stresses=stresses,
            difference=off,
            advice=advice,
        )
    ]
