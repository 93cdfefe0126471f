"""Programs of solvers: run, ended in time, killed with what they started, without POSIX too."""

import subprocess
import sys

from bubblefit.solvers.process import run_process


def test_children_of_program_are_killed_without_process_groups(tmp_path, monkeypatch):
    monkeypatch.setattr("bubblefit.solvers.process.GROUPS", False)
    shell_text = f'{sys.executable} -c \'import time; time.sleep(3); open("late", "w")\' & sleep 60'
    ended = run_process(["/bin/sh", "-c", shell_text], tmp_path, tmp_path / "log", timeout=0.5)
    assert ended.timed_out
    subprocess.run([sys.executable, "-c", "import time; time.sleep(4)"], check=True)
    assert not (tmp_path / "late").exists()
