"""python -m marc_stand_in.server SOCKET: run jobs in forks of a process that has loaded all code.

A new process takes two seconds to import and to load compiled kernels, a fork a few hundredths. The
server ends with its standard input. Its jobs come from `client.py`, which is the program that runs.
"""

import json
import os
import select
import signal
import socket
import sys
import threading

from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane.solver import MembraneSolver

from . import job

#: Bytes of a message: arguments, folder and environment of a run.
MOST = 2**20


def load_kernels():
    """Run a small bubble, as compiled code is loaded when it is called."""
    law = HypoelasticLaw.linear(800.0, 400.0, 60.0)
    MembraneSolver().run(BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.81, (0.01,)), law)


def end_with(connection):
    """Kill this job when its client is gone, as a signal to its group would."""
    connection.recv(1)
    os.kill(os.getpid(), signal.SIGKILL)


def run_job(connection, message, streams):
    """Run a job in this fork, and tell the client its exit code; it does not return."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    threading.Thread(target=end_with, args=(connection,), daemon=True).start()
    for number, stream in zip((1, 2), streams, strict=True):
        os.dup2(stream, number)
    os.chdir(message["folder"])
    os.environ.clear()
    os.environ.update(message["environment"])
    code = 1
    try:
        code, printed = job.run(job.command_of(message["arguments"]))
        print(printed, file=sys.stderr, flush=True)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    finally:
        connection.sendall(bytes([code]))
        os._exit(code)


def main(place):
    """Serve until the standard input ends."""
    listening = socket.socket(socket.AF_UNIX)
    listening.bind(place)
    listening.listen(16)
    load_kernels()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while sys.stdin not in (ready := select.select([listening, sys.stdin], [], [])[0]):
        assert ready == [listening]
        connection, _ = listening.accept()
        text, streams, *_ = socket.recv_fds(connection, MOST, 2)
        if text and os.fork() == 0:
            run_job(connection, json.loads(text), streams)
        connection.close()
        for stream in streams:
            os.close(stream)


if __name__ == "__main__":
    main(sys.argv[1])
