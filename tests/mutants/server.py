"""Runs pytest again and again in children of one process that has loaded the libraries.

A script, run inside the copy of the repository; it must not load bubblefit, which changes from
one run to the next. Its arguments are the libraries to load. Every line that it reads is
{"tests": [...], "seconds": ...}, and every line that it writes {"outcome": ..., "test": ...}.
"""

import importlib
import json
import os
import signal
import sys
import tempfile
import time


def child(tests: list[str], log: int) -> None:
    """Never returns."""
    code = 3
    try:
        for stream in (1, 2):
            os.dup2(log, stream)
        sys.dont_write_bytecode = True
        import pytest

        plugins = ["-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:cov"]
        code = int(pytest.main(["-x", "-q", "--no-header", "--tb=no", "-ra", *plugins, *tests]))
    finally:
        sys.stdout.flush()
        os._exit(code)


def outcome(tests: list[str], seconds: float) -> dict[str, str]:
    """survived; caught, with the first test that fails; late: not done after `seconds`."""
    with tempfile.TemporaryFile() as log:
        process = os.fork()
        if process == 0:
            os.setpgid(0, 0)
            child(tests, log.fileno())
        # Here, too: whoever comes first, the group is there when it is to be killed.
        os.setpgid(process, process)
        ended, status = 0, 0
        end = time.monotonic() + seconds
        while not ended and time.monotonic() < end:
            ended, status = os.waitpid(process, os.WNOHANG)
            time.sleep(0.0 if ended else 0.02)
        if not ended:
            os.killpg(process, signal.SIGKILL)
            os.waitpid(process, 0)
            return {"outcome": "late", "test": ""}
        log.seek(0)
        lines = log.read().decode(errors="replace").splitlines()
    if os.WIFEXITED(status) and os.WEXITSTATUS(status) == 0:
        return {"outcome": "survived", "test": ""}
    marks = ("FAILED ", "ERROR ")
    first = next((line for line in lines if line.startswith(marks)), "does not load")
    return {"outcome": "caught", "test": first.split(" - ")[0].partition(" ")[2]}


def main() -> None:
    """Until there is nothing more to read."""
    sys.path[0] = ""  # not the folder of this script
    for name in sys.argv[1:]:
        importlib.import_module(name)
    answers = os.fdopen(os.dup(1), "w")
    for line in sys.stdin:
        task = json.loads(line)
        print(json.dumps(outcome(task["tests"], task["seconds"])), file=answers, flush=True)


if __name__ == "__main__":
    main()
