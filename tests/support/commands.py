"""Commands as a user runs them, in this process or in one that is interrupted; programs."""

import contextlib
import json
import multiprocessing
import re
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import click
from bubblefit.cli.main import main
from bubblefit.cli.terminal import TABLE, WIDTH
from click.testing import CliRunner

from .golden import unbroken

FORK = multiprocessing.get_context("fork")
TIMEOUT_S = 300.0
#: How long a command that is told to stop may take to end.
ENDING_S = 30.0
#: np.float64(0.5), array([0.5, 1. ]), [0.5 1. ]: as numpy writes numbers, not for people.
NUMPY = re.compile(r"\bnp\.\w+\(|\barray\(|\[ ?-?\d+\.\d* +-?\d+\.\d*[\]\s]")


#: Commands and options whose output is a document, JSON, or help as click lays it out.
AS_WRITTEN = {"docs", "schema", "doctor", "--json", "--help", "--version"}


def in_process(*arguments, cwd, code=0):
    """Run the command in this process; assert its exit code; return click's result.

    Its lines are whole again, once none was too wide. That a new interpreter says the same:
    tests/cli/test_main.py.
    """
    with contextlib.chdir(cwd):
        done = CliRunner().invoke(main, [str(a) for a in arguments])
    assert done.exit_code == code, (done.output, done.exception)
    if arguments[0] not in AS_WRITTEN and not AS_WRITTEN & {*arguments}:
        wide = [line for line in done.stdout.splitlines() if len(line) > WIDTH]
        # Rows of tables, and a long path behind a word or two.
        assert all(TABLE.search(line) or len(line.split()) < 4 for line in wide), wide
        done.stdout_bytes = unbroken(done.stdout).encode()
    found = NUMPY.search(done.output)
    assert found is None, done.output[max(found.start() - 80, 0) :][:200] if found else ""
    return done


def interrupted(*arguments, cwd, when, number=signal.SIGINT):
    """Run the command in a new interpreter; send it a signal `when` it is time; how it ended."""
    command = [sys.executable, "-m", "bubblefit.cli", *map(str, arguments)]
    running = subprocess.Popen(
        command, cwd=cwd, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline = time.monotonic() + TIMEOUT_S
    while not when():
        assert time.monotonic() < deadline and running.poll() is None
        time.sleep(0.01)
    running.send_signal(number)
    _, said = running.communicate(timeout=ENDING_S)
    return subprocess.CompletedProcess(command, running.returncode, None, said)


def every_command(group):
    """Yield every command below a group, groups included, with the words that are typed."""
    ctx = click.Context(group)
    for name in group.list_commands(ctx):
        command = group.get_command(ctx, name)
        yield (name,), command
        if isinstance(command, click.Group):
            yield from (((name, *path), below) for path, below in every_command(command))


def result_in(folder):
    return json.loads((folder / "result.json").read_text())


def one_line(done, *words):
    assert len(done.stderr.splitlines()) == 1, done.stderr
    for word in words:
        assert word in done.stderr, done.stderr


def alive(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_for(there, seconds=30):
    end = time.monotonic() + seconds
    while not there():
        assert time.monotonic() < end
        time.sleep(0.01)


def in_processes(count, work):
    processes = [FORK.Process(target=work, args=(n,)) for n in range(count)]
    for one in processes:
        one.start()
    for one in processes:
        one.join(60)
        assert one.exitcode == 0


def write_program(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


def output_of(*command, **how):
    """Return what a command prints that has to end well."""
    done = subprocess.run(command, capture_output=True, text=True, **how)
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout
