"""solvers/command.py: commands in scratch folders, and how they end."""

import sys
from dataclasses import dataclass

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.solvers.base import History
from bubblefit.solvers.command import CommandSolver
from bubblefit.solvers.decks import UserDeck
from bubblefit.solvers.registry import SOLVERS, diagnose, solver_named

from ..support.refusals import raised


@dataclass(frozen=True)
class FileReader:
    """Reads the numbers of out.txt."""

    def read(self, folder):
        values = np.array((folder / "out.txt").read_text().split(), dtype=float)
        return History(values, np.zeros((1, 1, 3)), np.zeros(3), np.zeros(3))


def deck(code, **files):
    return UserDeck({"job.txt": "1 2", **files}, FileReader(), (sys.executable, "-c", code))


def test_command_runs_in_a_folder_of_its_own(tmp_path):
    code = "open('out.txt', 'w').write(open('job.txt').read() + ' 3')"
    solver = solver_named("command", scratch=tmp_path)
    assert solver.run(deck(code), None).load.tolist() == [1.0, 2.0, 3.0]
    assert solver.check().available and not list(tmp_path.iterdir())
    assert "command" in SOLVERS and all(d.name != "command" for d in diagnose())


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("print('bad'); raise SystemExit(7)", "ended with exit code 7"),
        ("import os; os.kill(os.getpid(), 9)", "killed by SIGKILL"),
        ("import time; time.sleep(30)", "did not end within 0.4 s"),
    ],
)
def test_bad_end_is_a_failure(tmp_path, code, words):
    solver = CommandSolver(0.4 if "sleep" in code else 60.0, tmp_path)
    failure = raised(SolverFailure, words, solver.run, deck(code), None)
    assert failure.scratch is not None and failure.scratch.is_dir()


def test_program_that_is_not_there_is_bad_input(tmp_path):
    missing = UserDeck({}, FileReader(), ("no-such-program",))
    raised(InputError, "cannot be started", CommandSolver(scratch=tmp_path).run, missing, None)
