"""Run a job as run_marc does: `python -m marc_stand_in.job -j NAME -v no -b no ...`.

The deck NAME.dat becomes .sts, .out, .log and .t19, written while the job runs. `run_marc` beside
this file is the program; this folder's parent is on the path.

`MARC_STAND_IN_FAULT`, or the file `fault` in the folder `MARC_STAND_IN_FOLDER`, names one of
`FAULTS`, and after an @ the runs with that fault, counted from 1: `3015@2,3`; all runs without.
Every run adds a line to the file `runs` of that folder (job, fault), by which runs are counted.
"""

from __future__ import annotations

import argparse
import errno
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from bubblefit.errors import BubblefitError
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.mesh import volume_and_gradient
from bubblefit.solvers.membrane.solver import MembraneSolver
from numpy.typing import NDArray

from .convergence import State, control_of, converging
from .deck import Array, Content, DeckError, read_deck
from .laws import NotCompiled, compiled, law_of_subroutine, law_of_tables
from .models import Schedule, model_of, schedule_of

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
#: Exit numbers: a good end; no equilibrium; a subroutine that does not compile (run_marc's own).
NORMAL, NO_SMALLER_STEP, NOT_COMPILED = 3004, 3015, 3
#: What the log says of how a job ended (public lists of exit numbers).
MEANING = {
    NORMAL: "Marc: normal end",
    NO_SMALLER_STEP: "Marc: unable to reduce time step below minimum",
    13: "Marc: errors in the input data",
    1005: "Marc: element is inside out",
}
RULE = "-" * 110
HEAD = f"""
          MSC Marc stand-in of bubblefit (no MSC software)

  job {{name}}, date of no matter

{RULE}
 load   inc  cycl sepa cut  |  cycl sepa cut  rem |  time step   total time    displacement
 case    #   inc  #    back |  total               |  of the inc  of the job    min         max
{RULE}
"""


class Ended(Exception):
    """The job is over before its last increment, with this exit number."""

    def __init__(self, number: int, problem: str = "") -> None:
        self.number, self.problem = number, problem


NO_EQUILIBRIUM = NO_SMALLER_STEP, "unable to reduce time step below minimum"


def command_of(arguments: Sequence[str]) -> argparse.Namespace:
    """Return job, folder, user and background of run_marc's options, current and older ones."""

    def count(word: str) -> int:
        if not (word.isdigit() and int(word) > 0):
            raise argparse.ArgumentTypeError("expected a number of processes or threads")
        return int(word)

    parser = argparse.ArgumentParser("run_marc", allow_abbrev=False, add_help=False)
    parser.add_argument("-j", "-jid", dest="job", required=True)
    # Without -b no run_marc returns at once and Marc goes on in the background.
    parser.add_argument("-b", dest="background", choices=("yes", "no", "y", "n"), default="yes")
    parser.add_argument("-v", choices=("yes", "no", "y", "n"))
    parser.add_argument("-dir", dest="folder", type=Path, default=Path("."))
    parser.add_argument("-u", dest="user", type=Path)
    for option in ("-nte", "-nts", "-nps", "-nprocd", "-nthread"):
        parser.add_argument(option, type=count)
    for option in ("-save", "-prog", "-q"):
        parser.add_argument(option)
    found = parser.parse_args(arguments)
    found.job = found.job.removesuffix(".dat")
    if not (found.folder / f"{found.job}.dat").exists():
        parser.exit(1, f"run_marc: {found.job}.dat: no such file\n")
    if found.background in ("yes", "y"):
        parser.error("the stand-in has no background; give -b no")
    if found.user:
        user = found.folder / found.user
        found.user = user if user.suffix else user.with_suffix(".f")
    return found


def fault_of(environment: Mapping[str, str], job: str) -> str:
    """Return the fault of this run, which is counted."""
    folder = environment.get("MARC_STAND_IN_FOLDER", "")
    said, path, runs = environment.get("MARC_STAND_IN_FAULT", ""), Path(folder) / "fault", 1
    if not said and folder and path.exists():
        said = path.read_text()
    kind, _, numbers = said.strip().partition("@")
    counted = Path(folder) / "runs"
    if folder and counted.exists():
        runs = len(counted.read_text().splitlines()) + 1
    if not kind or (numbers and str(runs) not in numbers.split(",")):
        kind = "none"
    if kind not in FAULTS:
        sys.exit(f"marc stand-in: no fault {kind!r}; there are {', '.join(FAULTS)}")
    if folder:
        with counted.open("a") as stream:
            stream.write(f"{job} {kind}\n")
    return kind


def run(command: argparse.Namespace) -> tuple[int, str]:
    """Run a job; return what run_marc returns and prints."""
    fault = fault_of(os.environ, command.job)
    if fault == "silent":
        return 0, ""
    if fault == "stale":
        for left in (Path(os.environ["MARC_STAND_IN_FOLDER"]) / "stale").iterdir():
            shutil.copy2(left, command.folder / left.name)
        return 1, "could not obtain license for MARC"
    journals = Journals(command.folder, command.job)
    if fault == "licence":
        # From what users quote of Marc's output; there is no exit number in the .sts.
        journals.error("could not obtain license: license server is down or has none free")
        return 1, "could not obtain license for MARC"
    try:
        if command.user is not None and fault == "not compiled":
            raise NotCompiled("hypela2.f:1: Error: told to fail")
        content = read_deck(command.folder / f"{command.job}.dat")
        solve(content, command, journals, fault)
        number = NORMAL
    except DeckError as error:
        where = f" in line {error.line} of the input" if error.line else ""
        journals.error(f"{error.problem}{where}")
        number = error.number
    except NotCompiled as error:
        journals.write("log", f"{error}\n")
        (command.folder / f"{command.job}.sts").unlink()
        return NOT_COMPILED, f"{error}\n compile or link error\n Exit number {NOT_COMPILED}"
    except OSError as error:
        journals.error(f"write error: {error.strerror}")
        return 1, f"write error: {error.strerror}"
    except Ended as end:
        number = end.number
        if end.problem:
            journals.error(end.problem)
    journals.end(number)
    code = {"code0": 0, "code1": 1}.get(fault, 0 if number == NORMAL else number % 256 or 1)
    return code, f" Exit number {number}"


def solve(content: Content, command: argparse.Namespace, journals: Journals, fault: str) -> None:
    """Run the analysis to its end, or raise what ended it."""
    law = _law(content, command.user, command.folder)
    schedule, control = schedule_of(content), control_of(content)
    with converging(control):
        model, rests = model_of(content, schedule, law)
    if fault == "inside out":
        journals.write("out", " *** warning - element inside out at element 1\n")
    path = command.folder / f"{command.job}.t19"
    running = Running(content, schedule, rests, journals, PostFile(path, content), fault)
    try:
        with converging(control, running.found):
            history = MembraneSolver().run(model, law)
        journals.write("out", f" {'; '.join(history.remarks)}\n")
        if running.increment < len(schedule.times):
            raise Ended(*NO_EQUILIBRIUM)
    except BubblefitError as error:
        journals.write("out", f" {error}\n")
        raise Ended(*NO_EQUILIBRIUM) from None
    finally:
        running.post.end()
        if fault == "truncated":
            path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _law(content: Content, user: Path | None, folder: Path) -> HypoelasticLaw:
    if content.material.kind == "nlelast":
        if user is not None:
            compiled(user, folder)
        return law_of_tables(content)
    if user is None:
        raise DeckError("hypoelastic with a user subroutine, and none was given (-u)")
    if not user.exists():
        raise NotCompiled(f"{user.name}: no such file")
    return law_of_subroutine(compiled(user, folder), content.parameters.states)


class Running:
    """What is written with every increment."""

    def __init__(
        self, content: Content, schedule: Schedule, rests: NDArray[np.bool_], journals: Journals,
        post: PostFile, fault: str,
    ) -> None:  # fmt: skip
        self.content, self.schedule, self.journals = content, schedule, journals
        self.post, self.fault, self.increment, self.rests = post, fault, 0, rests
        count = int(np.count_nonzero(schedule.case == schedule.case[-1]))
        self.halfway = len(schedule.times) - count + max(1, count // 2)
        zero = np.zeros((content.parameters.nodes, 3))
        post.frame(0, 0.0, self._vectors(State(zero, zero, None)))

    def found(self, state: State) -> None:
        """Write the solver's next increment, and those after it in which nothing moves."""
        self._write(state)
        while self.increment < len(self.rests) and self.rests[self.increment]:
            self._write(state)

    def _write(self, state: State) -> None:
        i, s = self.increment, self.schedule
        self.increment += 1
        u, time = state.displacement, float(s.times[i])
        line = int(s.case[i]) + 1, i + 1, float(s.steps[i]), time, float(u.min()), float(u.max())
        self.journals.increment(*line)
        if (i + 1) % self.content.every == 0:
            self.post.frame(i + 1, time, self._vectors(state))
        if i + 1 != self.halfway:
            return
        if self.fault == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        elif self.fault == "hanging":
            # As run_marc, which waits for a program that it has started.
            child = subprocess.Popen(["sleep", "3600"])
            if folder := os.environ.get("MARC_STAND_IN_FOLDER"):
                (Path(folder) / "pids").write_text(f"{child.pid}\n")
            child.wait()
        elif self.fault == "disk full":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        elif self.fault in ("3015", "code0"):
            raise Ended(*NO_EQUILIBRIUM)
        elif self.fault == "early":
            raise Ended(NORMAL)
        elif self.fault == "repeated":
            self.journals.increment(*line)

    def _vectors(self, state: State) -> dict[str, Array]:
        """Return displacement (mm), external, reaction and contact forces (N) of every node."""
        content, i = self.content, self.increment
        names = self.schedule.last
        if i:
            names = content.cases[int(self.schedule.case[i - 1])].conditions
        held = np.zeros(state.displacement.shape, dtype=bool)
        external = np.zeros_like(state.displacement)
        for c in (content.conditions[name] for name in names):
            for dof in c.dofs:
                if dof <= 3:
                    held[content.node_sets[c.on] - 1, dof - 1] = True
            # A closed cavity's pressure is in no list of loads.
            if i and c.kind != "fixed" and c.tables != [0]:
                level = content.tables[c.tables[0]].at(float(self.schedule.times[i - 1]))
                quads = (content.connectivity - 1).astype(np.intp)
                moved = content.coordinates + state.displacement
                external = level * volume_and_gradient(moved, quads)[1]
        found = {
            "Displacement": state.displacement,
            "External Force": external,
            "Reaction Force": np.where(held, state.unbalance, 0.0),
        }
        if content.bodies:
            none = np.zeros_like(state.displacement)
            found["Contact Normal Force"] = none if state.contact is None else state.contact
        return found


class Journals:
    """The .sts, .out and .log of a job; every line is on disk at once."""

    def __init__(self, folder: Path, name: str) -> None:
        self.files = {end: (folder / f"{name}.{end}").open("w") for end in ("sts", "out", "log")}
        self.write("sts", HEAD.format(name=name))
        self.write("out", f" MSC Marc stand-in, job {name}\n")
        self.write("log", f" job {name}\n")
        self.cycles = 0

    def write(self, end: str, text: str) -> None:
        self.files[end].write(text)
        self.files[end].flush()

    def error(self, text: str) -> None:
        for end in ("out", "log"):
            self.write(end, f" *** error - {text}\n")

    def increment(
        self, case: int, number: int, step: float, time: float, least: float, most: float
    ) -> None:
        self.cycles += 3
        self.write(
            "sts",
            f"{case:5d} {number:6d} {3:4d} {0:4d} {0:4d}  {self.cycles:6d} {0:4d} {0:4d} {0:4d}"
            f"   {step:.5E}  {time:.5E}  {least:.5E}  {most:.5E}\n",
        )
        self.write("out", f" end of increment {number:8d}, total time {time:.6E}\n")

    def end(self, number: int) -> None:
        self.write("sts", f"\n Job ends with exit number :    {number}\n")
        self.write("out", f"\n marc exit number {number}\n {MEANING.get(number, '')}\n")
        self.write("log", f" Exit number {number}\n {MEANING.get(number, '')}\n")


def e13(value: float) -> str:
    """Return Fortran's E13.6: 0.d six digits; a power of three digits takes the place of its E."""
    if not np.isfinite(value):
        return "NaN".rjust(13)
    if value == 0.0:
        return " 0.000000E+00"
    mantissa, power = f"{value:.5e}".split("e")
    exponent = int(power) + 1
    digits = f"{'-' if value < 0 else ' '}0.{mantissa.lstrip('-').replace('.', '')}"
    return digits + (f"E{exponent:+03d}" if abs(exponent) < 100 else f"{exponent:+04d}")


class PostFile:
    """The formatted post file (.t19); when the job is killed the beginning of the file is there."""

    def __init__(self, path: Path, content: Content) -> None:
        self.stream, p = path.open("w", encoding="ascii"), content.parameters
        self._block(50100, "Analysis Title", [p.title])
        header = [0, p.nodes, p.elements, 6, 4, 9, 1, 0, 3, 4, 2, 0, 0, 14, *[0] * 16]
        self._block(50200, "Analysis Verification Data", _integers(header))
        self._block(50600, "Element Variable Postcodes", [])
        elements = enumerate(content.connectivity.tolist(), 1)
        rows = [row for n, nodes in elements for row in _integers([n, p.type, 4, *nodes])]
        self._block(50700, "Element Connectivities", rows)
        points = enumerate(content.coordinates.tolist(), 1)
        rows = [f"{n:13d}" + "".join(map(e13, point)) for n, point in points]
        self._block(50800, "Nodal Coordinates", rows)
        self._block(51301, "Set Definitions", _integers([0]))

    def frame(self, increment: int, time: float, vectors: Mapping[str, Array]) -> None:
        """Write one increment and its nodal vectors (nodes, 3)."""
        self.stream.write("****\n")
        self._block(51600, "Loadcase Title", [""])
        rows = _integers([0, increment, 0, 1, 2, 0, 0, 1, 0, 0, 0, 0])
        self._block(51701, "Integer Increment Verification Data", rows)
        rows = [*_integers([24]), *_reals([time, *[0.0] * 23])]
        self._block(51801, "Real Increment Verification Data", rows)
        self._block(52300, "Element Integration Point Values", [])
        rows = _integers([len(vectors), 6])
        for name, values in vectors.items():
            rows += [name.ljust(48), *_integers([1, 0, 0, 3, 0, 0, -1, 0, 0, 0, 0, 0])]
            rows += _reals(values.ravel().tolist())
        self._block(52401, "Nodal Results", rows)
        self.stream.write("----\n")
        self.stream.flush()

    def end(self) -> None:
        self.stream.write("++++\n")
        self.stream.close()

    def _block(self, number: int, name: str, rows: Iterable[str]) -> None:
        self.stream.writelines(f"{row}\n" for row in (f"=beg={number} ({name})", *rows, "=end="))


def _integers(values: list[int]) -> list[str]:
    return _rows([f"{value:13d}" for value in values])


def _reals(values: list[float]) -> list[str]:
    return _rows([e13(value) for value in values])


def _rows(fields: list[str]) -> list[str]:
    """Return lines of six fields."""
    return ["".join(fields[i : i + 6]) for i in range(0, len(fields), 6)]


if __name__ == "__main__":
    code, said = run(command_of(sys.argv[1:]))
    print(said, file=sys.stderr)
    sys.exit(code)
