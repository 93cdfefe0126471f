"""Run a job as run_marc does: `python -m marc_stand_in.job -j NAME -v no -b no ...`.

`MARC_STAND_IN_FAULT`, or the file `fault` in the folder `MARC_STAND_IN_FOLDER`, names one of
`FAULTS`, and after an @ the runs with that fault, counted from 1: `3015@2,3`; all runs without.
Every run adds a line to the file `runs` of that folder (job, fault), by which runs are counted.
"""

import argparse
import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
from bubblefit.errors import BubblefitError
from bubblefit.solvers.membrane.solver import MembraneSolver

from .deck import DeckError, read_deck
from .files import STS_HEAD, sts_line, t19_frame, t19_head
from .laws import NotCompiled, compiled, law_of_subroutine, law_of_tables
from .models import State, control_of, converging, model_of, schedule_of

#: Half-way no smaller step, no process, no disk, or nothing more, in a child either; 3004 half-way;
#: half of the .t19; an element inside out; nothing begins without a licence.
FAULTS = (
    "none", "3015", "killed", "disk full", "hanging", "early", "truncated", "inside out", "licence"
)  # fmt: skip
#: Exit numbers: a good end; no equilibrium; a subroutine that does not compile (run_marc's own).
NORMAL, NO_SMALLER_STEP, NOT_COMPILED = 3004, 3015, 3


class Ended(Exception):
    """The job is over before its last increment, with this exit number."""


def command_of(arguments):
    parser = argparse.ArgumentParser("run_marc", allow_abbrev=False, add_help=False)
    parser.add_argument("-j", "-jid", dest="job", required=True)
    # Without -b no run_marc returns at once and Marc goes on in the background.
    parser.add_argument("-b", choices=("no", "n"), required=True)
    parser.add_argument("-v", choices=("yes", "no", "y", "n"))
    parser.add_argument("-u", dest="user", type=Path)
    for option in ("-nte", "-nts", "-nps", "-nprocd", "-nthread"):
        parser.add_argument(option, type=int)
    found = parser.parse_args(arguments)
    found.job = found.job.removesuffix(".dat")
    if not (Path(f"{found.job}.dat")).exists():
        parser.exit(1, f"run_marc: {found.job}.dat: no such file\n")
    return found


def fault_of(job):
    folder = Path(os.environ.get("MARC_STAND_IN_FOLDER", os.devnull))
    said = os.environ.get("MARC_STAND_IN_FAULT", "")
    if not said and (folder / "fault").exists():
        said = (folder / "fault").read_text()
    kind, _, numbers = said.strip().partition("@")
    before = (folder / "runs").read_text() if (folder / "runs").exists() else ""
    if not kind or (numbers and str(before.count("\n") + 1) not in numbers.split(",")):
        kind = "none"
    if kind not in FAULTS:
        sys.exit(f"marc stand-in: no fault {kind!r}; there are {', '.join(FAULTS)}")
    if folder.is_dir():
        (folder / "runs").write_text(f"{before}{job} {kind}\n")
    return kind


def run(command):
    fault = fault_of(command.job)
    files = Files(command.job)
    if fault == "licence":
        # From what users quote of Marc's output; there is no exit number in the .sts.
        files.error("could not obtain license: license server is down or has none free")
        return 1, "could not obtain license for MARC"
    try:
        solve(read_deck(Path(f"{command.job}.dat")), command, files, fault)
        number = NORMAL
    except DeckError as error:
        where = f" in line {error.line} of the input" if error.line else ""
        files.error(f"{error.problem}{where}")
        number = error.number
    except NotCompiled as error:
        files.write("log", f"{error}\n")
        Path(f"{command.job}.sts").unlink()
        return NOT_COMPILED, f"{error}\n compile or link error\n Exit number {NOT_COMPILED}"
    except OSError as error:
        files.error(f"write error: {error.strerror}")
        return 1, f"write error: {error.strerror}"
    except Ended as end:
        (number,) = end.args
        if number == NO_SMALLER_STEP:
            files.error("unable to reduce time step below minimum")
    files.write("sts", f"\n Job ends with exit number :    {number}\n")
    files.write("out", f"\n marc exit number {number}\n")
    files.write("log", f" Exit number {number}\n")
    return 0 if number == NORMAL else number % 256 or 1, f" Exit number {number}"


class Files:
    def __init__(self, name):
        ends = ("sts", "out", "log", "t19")
        self.open = {e: Path(f"{name}.{e}").open("w", encoding="ascii") for e in ends}
        self.write("sts", STS_HEAD)
        self.write("out", f" MSC Marc stand-in of bubblefit (no MSC software), job {name}\n")

    def write(self, end, text):
        self.open[end].write(text)
        self.open[end].flush()

    def error(self, text):
        self.write("out", f" *** error - {text}\n")
        self.write("log", f" *** error - {text}\n")


def solve(content, command, files, fault):
    library = None if command.user is None else compiled(command.user, Path("."))
    if library is None and content.law == "hypoelastic":
        raise DeckError("hypoelastic with a user subroutine, and none was given (-u)")
    nlelast = content.law == "nlelast"
    law = law_of_tables(content) if nlelast else law_of_subroutine(library, content.states)
    control = control_of(content)
    running = Running(content, files, fault)
    with converging(control):
        model, running.rests = model_of(content, running.schedule, law)
    if fault == "inside out":
        files.write("out", " *** warning - element inside out at element 1\n")
    try:
        with converging(control, running.found):
            history = MembraneSolver().run(model, law)
        files.write("out", f" {'; '.join(history.remarks)}\n")
        if running.increment < len(running.schedule.times):
            raise Ended(NO_SMALLER_STEP)
    except BubblefitError as error:
        files.write("out", f" {error}\n")
        raise Ended(NO_SMALLER_STEP) from None
    finally:
        files.write("t19", "++++\n")
        if fault == "truncated":
            path = Path(files.open["t19"].name)
            path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


class Running:
    """What is written with every increment; rests : in which increments nothing moves."""

    def __init__(self, content, files, fault):
        self.content, self.files, self.fault, self.increment = content, files, fault, 0
        self.schedule, self.rests = schedule_of(content), np.zeros(0, dtype=bool)
        count = content.cases[-1].increments
        self.halfway = len(self.schedule.times) - count + max(1, count // 2)
        quads, zero = content.connectivity - 1, np.zeros((content.nodes, 3))
        files.write("t19", t19_head(content.coordinates, quads, content.type, content.title))
        files.write("t19", t19_frame(0, 0.0, self._vectors(State(zero, zero, 0.0))))

    def found(self, state):
        self._write(state)
        while self.increment < len(self.rests) and self.rests[self.increment]:
            self._write(state)

    def _write(self, state):
        i, s, u = self.increment, self.schedule, state.displacement
        self.increment = n = i + 1
        time = float(s.times[i])
        now = sts_line(int(s.case[i]) + 1, n, 3 * n, s.steps[i], time, u.min(), u.max())
        self.files.write("sts", now)
        self.files.write("out", f" end of increment {n:8d}, total time {time:.6E}\n")
        if n % self.content.every == 0:
            self.files.write("t19", t19_frame(n, time, self._vectors(state)))
        if n != self.halfway:
            return
        if self.fault == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        elif self.fault == "hanging":
            child = subprocess.Popen(["sleep", "3600"])
            if folder := os.environ.get("MARC_STAND_IN_FOLDER"):
                (Path(folder) / "pids").write_text(f"{child.pid}\n")
            child.wait()
        elif self.fault == "disk full":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        elif self.fault in ("3015", "early"):
            raise Ended(NORMAL if self.fault == "early" else NO_SMALLER_STEP)

    def _vectors(self, state):
        content = self.content
        case = content.cases[int(self.schedule.case[self.increment - 1])]
        reaction = np.zeros_like(state.displacement)
        for c in (content.conditions[name] for name in case.conditions):
            for dof in (dof - 1 for dof in c.dofs if dof <= 3):
                on = content.sets["node"][c.on] - 1
                reaction[on, dof] = state.unbalance[on, dof]
        found = {"Displacement": state.displacement, "Reaction Force": reaction}
        if content.bodies:
            found["Contact Normal Force"] = state.contact + np.zeros_like(reaction)
        return found


if __name__ == "__main__":
    code, said = run(command_of(sys.argv[1:]))
    print(said, file=sys.stderr)
    sys.exit(code)
