"""Kill fits and bendings at random moments and resume each to its end.

Kills the command, a worker, or CalculiX. Compares the result with that of a whole run, and looks
for processes, scratch folders and half-written files left. Exit code 1 if any.
"""

import csv
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import psutil
from common import start_on

#: In the environment of all that a trial starts.
MARK = "BUBBLEFIT_KILLS"
#: Of result.json and tables: how long it took, how many runs were made now, when and where.
UNEQUAL = ("wall_s", "seconds", "external_runs", "cached_runs", "provenance")
#: s; how long what should end may take, and a command as a whole.
ENDING, LONGEST = 25.0, 300.0
TIMES_A_RUN = 4
PICTURE = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010806000000"
    "1f15c4890000000d49444154789c6360606060000000050001a5f645400000000049454e44ae426082"
)
BUBBLE = """
fabric = { thickness = 0.81 }
law = { form = "constant", bounds = { lower = [0.03, 0.3, 0.3], upper = [0.2, 1.0, 1.0] } }
fit = { starts = {starts}, jobs = 2, tolerance = 1e-6 }
solver = { calculix = { element = "S4" } }
[[bubble]]
radius = 100.0
pressures = [22, 59]
elements = 32
symmetry = "quarter"
data = { known_solution = { beta = [0, 0, 0, 0.08, 0, 0, 0, 0.4, 0, 0, 0, 0.8] } }
"""
CYLINDERS = """
fabric = { thickness = 0.81 }
fit = { jobs = 2 }
cylinder = [
    { name = "low", diameter = 150.0, pressure = 90.0 },
    { name = "high", diameter = 150.0, pressure = 140.0 },
]
card = [
    { name = "soft", beta = [0, 0, 0, 0.08, 0, 0, 0, 0.4, 0, 0, 0, 0.8] },
    { name = "stiff", beta = [0, 0, 0, 0.1, 0, 0, 0, 0.6, 0, 0, 0, 1.0] },
]
[defaults.cylinder]
length = 1200.0
span = 800.0
seam_width = 0.0
element_size = 60.0
deflection = 8.0
frames = 2
"""
COMMANDS = {
    "fit": (BUBBLE.replace("{starts}", "4"), ("fit",)),
    "fit by CalculiX": (BUBBLE.replace("{starts}", "2"), ("fit", "--solver", "calculix")),
    "bend": (CYLINDERS, ("bend", "--samples", "0")),
}


@dataclass
class Told:
    """What a command's trials came to. killed : by what was killed."""

    killed: Counter[str] = field(default_factory=Counter)
    trials: int = 0
    equal: int = 0
    other: list[str] = field(default_factory=list)
    left: list[str] = field(default_factory=list)


class Trial:
    def __init__(self, folder, name):
        text, (command, *options) = COMMANDS[name]
        folder = folder / "project"  # results are called by it
        folder.mkdir(parents=True)
        self.folder, self.out = folder, folder / "out"
        (folder / "tmp").mkdir()
        (folder / "project.toml").write_text(text)
        self.arguments = [command, "project.toml", *options, "--out", "out", "--quiet"]
        self.said = folder / "stderr"

    def start(self):
        """Fork this process into the command, with --resume where results exist."""
        used = any((self.out / name).exists() for name in ("run.json", "result.json"))
        sys.stdout.flush()
        if child := os.fork():
            return child
        try:
            os.setsid()
            os.chdir(self.folder)
            os.environ |= {
                MARK: str(self.folder),
                "BUBBLEFIT_RUNS": str(self.folder / "runs"),
                "TMPDIR": str(self.folder / "tmp"),
            }
            tempfile.tempdir = None
            stream = os.open(self.said, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
            for known in (1, 2):
                os.dup2(stream, known)
            from bubblefit.cli.main import main
            from bubblefit.reports import vega

            vega.rendered = lambda *_: PICTURE  # drawing would be most of the time
            main([*self.arguments, *(["--resume"] if used else [])], prog_name="bubblefit")
        except SystemExit as end:
            os._exit(end.code if isinstance(end.code, int) else 0)
        finally:
            os._exit(70)

    def all_alive(self, own):
        """Return numbers and names of living processes of the trial: of its session or marked."""
        found = []
        for process in psutil.process_iter(["name"]):
            with suppress(psutil.Error, OSError):
                marked = process.environ().get(MARK) == str(self.folder)
                there = process.status() != psutil.STATUS_ZOMBIE and process.pid != os.getpid()
                if there and (marked or os.getsid(process.pid) == own):
                    found.append((process.pid, process.name()))
        return found

    def left(self):
        places = [*(self.folder / "tmp").iterdir(), *self.folder.rglob(".*.part")]
        places += [path for path in self.out.rglob(".*") if path.is_file()]
        return [str(path) for path in places]


def until(done, seconds):
    end = time.monotonic() + seconds
    while not done():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


def finish(process):
    """Return the exit code (-9: killed); -1000 where the process took too long and was killed."""
    if until(lambda: not alive_still(process), LONGEST):
        return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    return -1000


def killed(trial, process, draw):
    alive = trial.all_alive(process)
    solvers = [number for number, name in alive if name.startswith("ccx")]
    others = {process, *solvers, *(number for number, name in alive if name == "sh")}
    workers = [number for number, _ in alive if number not in others]
    groups = {"the command": [process], "a worker": workers, "CalculiX": solvers}
    what = draw.choice([name for name, several in groups.items() if several])
    if alive_still(process):
        with suppress(ProcessLookupError):
            os.kill(draw.choice(groups[what]), signal.SIGKILL)
            return what
    return ""


def alive_still(process):
    return psutil.pid_exists(process) and psutil.Process(process).status() != psutil.STATUS_ZOMBIE


def content(out):
    """Return all that a command found: result.json and tables, without what `UNEQUAL` names."""

    def plain(value):
        if isinstance(value, dict):
            return {k: plain(v) for k, v in value.items() if k not in UNEQUAL}
        return [plain(one) for one in value] if isinstance(value, list) else value

    found = {"result.json": plain(json.loads((out / "result.json").read_text()))}
    for path in sorted(out.rglob("*.csv")):
        with path.open(newline="") as stream:
            rows = [plain(dict(row)) for row in csv.DictReader(stream)]
        for row in rows:
            # An analysis that is taken from the cache says so.
            if "status" in row:
                row["status"] = row["status"].replace(", from the cache", "")
        found[str(path.relative_to(out))] = rows
    return found


def one_trial(folder, name, whole, seconds, most, draw, told):
    """Kill one command up to `most` times, wait for its end; return how many kills there were."""
    trial, count, failed = Trial(folder, name), 0, False
    while True:
        process = trial.start()
        ended = count >= most or until(
            lambda p=process: not alive_still(p), draw.uniform(0, seconds)
        )
        if not ended and (what := killed(trial, process, draw)):
            told.killed[what] += 1
            count += 1
            failed = failed or what == "CalculiX"
        code = finish(process)
        if not until(lambda p=process: not trial.all_alive(p), ENDING):
            told.left.append(f"{folder.name}: alive: {trial.all_alive(process)}")
        if code == 0 and (trial.out / "result.json").exists():
            break
        if code not in (-9, 4):
            told.other.append(f"{folder.name}: exit code {code}: {trial.said.read_text()[-400:]}")
            return count
    told.trials += 1
    found = content(trial.out)
    differ = [key for key in {**whole, **found} if whole.get(key) != found.get(key)]
    told.equal += not differ
    if differ and not failed:
        told.other.append(f"{folder.name}: {', '.join(differ)} of another run")
    elif differ:
        # A run that is killed is a point that cannot be analysed: the fit goes another way.
        e, own = found["result.json"]["objective"], whole["result.json"]["objective"]
        told.killed["CalculiX, and another way"] += 1
        if not e < max(10 * own, 1e-3):
            told.other.append(f"{folder.name}: objective {e:g} instead of {own:g}")
    kept = [path for path in trial.left() if not (failed and "bubblefit-ccx" in path)]
    told.left += [f"{folder.name}: {path}" for path in kept]
    return count


def trials(place, name, kills, seed):
    draw, told, count = random.Random(f"{name} {seed}"), Told(), 0
    first = Trial(place / f"{name} whole", name)
    for _ in range(2):  # the second time everything is compiled
        shutil.rmtree(first.out, ignore_errors=True)
        shutil.rmtree(first.folder / "runs", ignore_errors=True)
        begun = time.monotonic()
        code = finish(first.start())
        seconds = time.monotonic() - begun
        assert code == 0, first.said.read_text()
    whole = content(first.out)
    while count < kills:
        folder = place / f"{name} {told.trials + len(told.other)}"
        most = min(TIMES_A_RUN, kills - count)
        count += one_trial(folder, name, whole, seconds, most, draw, told)
        shutil.rmtree(folder, ignore_errors=True)
    return told


def main(kills=4, seed=1, *commands):
    """Kill each command KILLS times; exit with 1 where anything differs or is left."""
    bad = False
    with tempfile.TemporaryDirectory(prefix="kills-") as place:
        for name in commands or COMMANDS:
            told = trials(Path(place), name, kills, seed)
            bad = bad or bool(told.other or told.left)
            what = ", ".join(f"{what} {count}" for what, count in sorted(told.killed.items()))
            print(f"{name:16} {told.trials:3} trials, killed: {what}; the same to the last digit: "
                  f"{told.equal}; other ends {len(told.other)}, left behind {len(told.left)}",
                  *told.other, *told.left, sep="\n    ", flush=True)  # fmt: skip
    sys.exit(int(bad))


if __name__ == "__main__":
    import bubblefit.reports.study_pages
    import bubblefit.runs.fit
    import bubblefit.runs.predictions  # noqa: F401

    start_on(main)
