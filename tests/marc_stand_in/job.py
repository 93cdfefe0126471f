"""One job from its deck to its files."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from bubblefit.errors import BubblefitError
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.membrane.solver import MembraneSolver
from numpy.typing import NDArray

from .analysis import model_of
from .command import Command
from .content import Content
from .faults import Fault
from .fields import DeckError
from .frames import vectors_of
from .hypela2 import NOT_COMPILED, NotCompiled, compiled, law_of_subroutine
from .journals import Journals
from .law import law_of_tables
from .postfile import PostFile
from .reading import read_deck
from .recording import State, recording
from .schedule import Schedule, schedule_of

NORMAL, NO_SMALLER_STEP = 3004, 3015


class Ended(Exception):
    """The job is over before its last increment, with this exit number."""

    def __init__(self, number: int, problem: str = "") -> None:
        self.number, self.problem = number, problem


def run(command: Command, environment: Mapping[str, str] | None = None) -> tuple[int, str]:
    """Run a job; what run_marc returns, and what it prints."""
    fault = Fault(os.environ if environment is None else environment, command.job)
    if fault.is_("silent"):
        return 0, ""
    if fault.is_("stale"):
        for left in (Path(fault.folder) / "stale").iterdir():
            shutil.copy2(left, command.folder / left.name)
        return 1, "could not obtain license for MARC"
    journals = Journals(command.folder, command.job)
    if fault.is_("licence"):
        # From what users quote of Marc's output; there is no exit number in the .sts.
        journals.error("could not obtain license: license server is down or has none free")
        journals.end(None)
        return 1, "could not obtain license for MARC"
    try:
        if command.user is not None and fault.is_("not compiled"):
            raise NotCompiled("hypela2.f:1: Error: told to fail")
        _solve(command, journals, fault)
        number = NORMAL
    except DeckError as error:
        where = f" in line {error.line} of the input" if error.line else ""
        journals.error(f"{error.problem}{where}")
        number = error.number
    except NotCompiled as error:
        journals.log(str(error))
        journals.end(None)
        (command.folder / f"{command.job}.sts").unlink()
        return NOT_COMPILED, f"{error}\n compile or link error\n Exit number {NOT_COMPILED}"
    except Ended as end:
        number = end.number
        if end.problem:
            journals.error(end.problem)
    journals.end(number)
    code = 0 if number == NORMAL else number % 256 or 1
    code = {"code0": 0, "code1": 1}.get(fault.kind, code)
    return code, f" Exit number {number}"


def _solve(command: Command, journals: Journals, fault: Fault) -> None:
    content = read_deck(command.folder / f"{command.job}.dat")
    law = _law(content, command, fault)
    schedule = schedule_of(content)
    model, rests = model_of(content, schedule, law)
    if fault.is_("inside out"):
        journals.out(" *** warning - element inside out at element 1, integration point 1")
    post = PostFile(command.folder / f"{command.job}.t19", content, content.parameters.title)
    running = Running(content, schedule, rests, journals, post, fault)
    running.begin()
    try:
        with recording(running.found):
            history = MembraneSolver().run(model, law)
        journals.out(" " + "; ".join(history.remarks))
        if running.increment < len(schedule.times):
            raise Ended(NO_SMALLER_STEP, "unable to reduce time step below minimum")
    except BubblefitError as error:
        journals.out(f" {error}")
        raise Ended(NO_SMALLER_STEP, "unable to reduce time step below minimum") from None
    finally:
        post.end()
        if fault.is_("truncated"):
            path = command.folder / f"{command.job}.t19"
            path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _law(content: Content, command: Command, fault: Fault) -> HypoelasticLaw:
    material = content.material
    assert material is not None
    if material.kind == "nlelast":
        if command.user is not None:
            compiled(command.user, command.folder)
        return law_of_tables(content)
    if command.user is None:
        raise DeckError("hypoelastic with a user subroutine, and none was given (-u)")
    if not command.user.exists():
        raise NotCompiled(f"{command.user.name}: no such file")
    return law_of_subroutine(compiled(command.user, command.folder), content.parameters.states)


class Running:
    """What is written with every increment."""

    def __init__(
        self,
        content: Content,
        schedule: Schedule,
        rests: NDArray[np.bool_],
        journals: Journals,
        post: PostFile,
        fault: Fault,
    ) -> None:
        self.content, self.schedule, self.journals = content, schedule, journals
        self.post, self.fault, self.increment, self.rests = post, fault, 0, rests
        count = int(np.count_nonzero(schedule.case == schedule.case[-1]))
        self.halfway = len(schedule.times) - count + max(1, count // 2)

    def begin(self) -> None:
        """Increment 0: nothing has moved."""
        zero = np.zeros((self.content.parameters.nodes, 3))
        state = State(zero, zero, None)
        self.post.frame(0, 0.0, vectors_of(self.content, self.schedule, 0, state))

    def found(self, state: State) -> None:
        """The solver's next increment; those after it in which nothing moves go by with it."""
        self._write(state)
        while self.increment < len(self.rests) and self.rests[self.increment]:
            self._write(state)

    def _write(self, state: State) -> None:
        i, s = self.increment, self.schedule
        self.increment += 1
        time, u = float(s.times[i]), state.displacement
        self.journals.increment(
            int(s.case[i]) + 1, i + 1, float(s.steps[i]), time, float(u.min()), float(u.max())
        )
        if (i + 1) % self.content.every == 0:
            self.post.frame(i + 1, time, vectors_of(self.content, s, i + 1, state))
        if i + 1 == self.halfway:
            self._halfway(i, time, u)

    def _halfway(self, i: int, time: float, u: np.ndarray) -> None:
        self.fault.hang_or_die()
        if self.fault.is_("3015", "code0"):
            raise Ended(NO_SMALLER_STEP, "unable to reduce time step below minimum")
        if self.fault.is_("early"):
            raise Ended(NORMAL)
        if self.fault.is_("repeated"):
            s = self.schedule
            self.journals.increment(
                int(s.case[i]) + 1, i + 1, float(s.steps[i]), time, float(u.min()), float(u.max())
            )
