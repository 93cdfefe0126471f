"""processes.py: the share of the cores that a process may use."""

import contextvars

from bubblefit.processes import cores, share_cores, share_of_cores


def test_processes_share_the_cores():
    def shares():
        share_cores(2 * cores())
        return share_of_cores()

    assert share_of_cores() == cores() >= 1
    assert contextvars.copy_context().run(shares) == 1
