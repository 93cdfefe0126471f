"""How the stand-in is told to fail, and in which of its runs.

`MARC_STAND_IN_FAULT`, or the file `fault` in the folder `MARC_STAND_IN_FOLDER`, names one of
`FAULTS`, and after an @ the runs that it befalls, counted from 1: `3015@2,3`; all of them without.
Every run adds a line to the file `runs` of that folder (job, fault), which is what counts them.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

FAULTS = {
    "none": "ends well, if it can",
    "3015": "half-way the time step cannot get smaller",
    "code0": "as 3015, and the return code is 0",
    "code1": "ends well, and the return code is 1",
    "licence": "no licence: nothing begins",
    "disk full": "half-way a file cannot be written: it says so, and gives no exit number",
    "stale": "no licence, and what an earlier job left (the files in the folder `stale`) is there",
    "killed": "half-way the process is gone",
    "truncated": "ends well, and half of the .t19 is there",
    "hanging": "half-way nothing happens any more, in a child process as well",
    "inside out": "ends with 3004, and an element was inside out on the way",
    "early": "ends with 3004 half-way",
    "repeated": "ends well, and an increment was repeated on the way",
    "silent": "ends with return code 0 and leaves no file",
    "not compiled": "the compiler does not take the subroutine",
}


class Fault:
    """What goes wrong in this run."""

    def __init__(self, environment: Mapping[str, str], job: str) -> None:
        self.folder = environment.get("MARC_STAND_IN_FOLDER", "")
        said = environment.get("MARC_STAND_IN_FAULT", "")
        path = Path(self.folder) / "fault"
        if not said and self.folder and path.exists():
            said = path.read_text()
        kind, _, runs = said.strip().partition("@")
        number = self._number()
        befalls = not runs or str(number) in runs.split(",")
        self.kind = (kind or "none") if befalls else "none"
        if self.kind not in FAULTS:
            sys.exit(f"marc stand-in: no fault {self.kind!r}; there are {', '.join(FAULTS)}")
        if self.folder:
            with (Path(self.folder) / "runs").open("a") as runs_so_far:
                runs_so_far.write(f"{job} {self.kind}\n")

    def is_(self, *kinds: str) -> bool:
        return self.kind in kinds

    def hang_or_die(self) -> None:
        """Half-way."""
        if self.kind == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.kind == "hanging":
            # As run_marc, which waits for a program that it has started.
            child = subprocess.Popen(["sleep", "3600"])
            if self.folder:
                (Path(self.folder) / "pids").write_text(f"{child.pid}\n")
            child.wait()

    def _number(self) -> int:
        path = Path(self.folder) / "runs"
        if not self.folder or not path.exists():
            return 1
        return len(path.read_text().splitlines()) + 1
