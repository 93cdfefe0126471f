"""python -I -S client.py SOCKET ...: a run of Marc by the server, or by a process of its own.

A run that is killed or hangs is a process of its own, and so is one without a server.
"""

import json
import os
import signal
import socket
import sys
from pathlib import Path


def run_by_server(place, arguments):
    """Return the exit code of a run by the server at a socket; OSError: there is none."""
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(place)
        message = {
            "arguments": arguments, "folder": os.getcwd(), "environment": dict(os.environ)
        }  # fmt: skip
        socket.send_fds(connection, [json.dumps(message).encode()], [1, 2])
        ended = connection.recv(1)
    if not ended:
        os.kill(os.getpid(), signal.SIGKILL)
    return ended[0]


def main(place, *arguments):
    """Run the job and end as it did."""
    fault = Path(os.environ["MARC_STAND_IN_FOLDER"], "fault")
    told = fault.read_text() if fault.exists() else os.environ.get("MARC_STAND_IN_FAULT", "")
    if not told.startswith(("killed", "hanging")):
        try:
            sys.exit(run_by_server(place, list(arguments)))
        except OSError:
            pass
    program = str(Path(__file__).with_name("run_marc"))
    os.execv(program, [program, *arguments])  # noqa: S606


if __name__ == "__main__":
    main(*sys.argv[1:])
