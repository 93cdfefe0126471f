"""How a job can end before its last increment."""

from __future__ import annotations

#: Exit numbers: a good end, and one for want of equilibrium.
NORMAL, NO_SMALLER_STEP = 3004, 3015
#: That of the run_marc script where a subroutine does not compile or link.
NOT_COMPILED = 3


class Ended(Exception):
    """The job is over before its last increment, with this exit number."""

    def __init__(self, number: int, problem: str = "") -> None:
        self.number, self.problem = number, problem


class NotCompiled(Exception):
    """The compiler's message."""
