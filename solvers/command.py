"""The solver "command": it runs decks of the user's own by the words of their command."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from ..errors import SolverFailure
from ..materials.law import HypoelasticLaw
from .base import Diagnosis, History, SolverCheck
from .decks import UserDeck
from .process import Outcome, disk_full, log_tail, run_process
from .scratch import run_folder, write_deck
from .settings import ExternalSettings

LOG = "deck.log"
TIMEOUT_S = 3600.0


class CommandSettings(ExternalSettings):
    """The settings of commands that decks name: [solver.command]."""

    paths = ("scratch", "licence_folder")

    timeout: Annotated[float, Field(gt=0)] = TIMEOUT_S
    scratch: str | None = None
    keep: bool = False


@dataclass(eq=False)
class CommandSolver:
    """Solver that runs the command of a deck in the deck's folder.

    Attributes
    ----------
    timeout : float, s
        Time after which a run is ended, unless the deck says another.
    scratch : Path, optional
        Folder in which runs get their scratch folders.
    keep : bool
        Whether the scratch folders of successful runs are kept, too.
    """

    name = identity = "command"
    external = load_ratios = True
    progress = None

    timeout: float = TIMEOUT_S
    scratch: Path | None = None
    keep: bool = False

    def check(self) -> SolverCheck:
        """Return that commands can be run; whether a deck's program is there is the deck's."""
        return SolverCheck(self.name, True, "", True)

    def run(
        self,
        model: UserDeck,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
    ) -> History:
        """Run a deck; SolverFailure where its command fails, or writes no such results."""
        seconds = timeout or model.timeout or self.timeout
        with run_folder("deck", scratch or self.scratch, self.keep, self.name, LOG) as folder:
            write_deck(folder, model.files)
            log = folder / LOG
            outcome = run_process(
                model.command,
                folder,
                log,
                seconds,
            )
            problem = reason(folder, outcome, seconds)
            if problem:
                raise SolverFailure(problem, self.name, outcome.exit_code)
            return model.reader.read(folder)


def reason(folder: Path, outcome: Outcome, timeout: float) -> str:
    """Return why a command did not end well, "" where it did."""
    if outcome.timed_out:
        return f"did not end within {timeout:g} s"
    full = disk_full(folder, log_tail(folder / LOG).splitlines(), outcome)
    if full:
        return f"disk full: {full}"
    if outcome.signal_name:
        return f"killed by {outcome.signal_name}"
    return f"ended with exit code {outcome.exit_code}" if outcome.exit_code else ""


def diagnose(named: Path | str | None = None) -> list[Diagnosis]:
    """Return nothing: only decks know their programs."""
    return []
