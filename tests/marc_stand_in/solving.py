"""The analysis of a deck, with everything that is written while it runs."""

from __future__ import annotations

import errno
import os

import numpy as np
from bubblefit.errors import BubblefitError
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.membrane.solver import MembraneSolver
from numpy.typing import NDArray

from .analysis import model_of
from .command import Command
from .content import Content
from .convergence import control_of, converging
from .endings import NO_SMALLER_STEP, NORMAL, Ended, NotCompiled
from .faults import Fault
from .fields import DeckError
from .frames import vectors_of
from .hypela2 import compiled, law_of_subroutine
from .journals import Journals
from .law import law_of_tables
from .postfile import PostFile
from .recording import State, recording
from .schedule import Schedule, schedule_of


def solve(content: Content, command: Command, journals: Journals, fault: Fault) -> None:
    """Run it to its end, or raise what ended it."""
    law = _law(content, command, fault)
    schedule, control = schedule_of(content), control_of(content)
    with converging(control):
        model, rests = model_of(content, schedule, law)
    if fault.is_("inside out"):
        journals.out(" *** warning - element inside out at element 1, integration point 1")
    post = PostFile(command.folder / f"{command.job}.t19", content, content.parameters.title)
    running = Running(content, schedule, rests, journals, post, fault)
    running.begin()
    try:
        with converging(control), recording(running.found):
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
        if self.fault.is_("disk full"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        if self.fault.is_("3015", "code0"):
            raise Ended(NO_SMALLER_STEP, "unable to reduce time step below minimum")
        if self.fault.is_("early"):
            raise Ended(NORMAL)
        if self.fault.is_("repeated"):
            s = self.schedule
            self.journals.increment(
                int(s.case[i]) + 1, i + 1, float(s.steps[i]), time, float(u.min()), float(u.max())
            )
