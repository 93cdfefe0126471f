"""A reading of a hostile file, and what is a fault of the reader: anything but the project's own
one line, more memory than the file can ask for, more time than anybody waits."""

import resource
import signal
import traceback
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path

from bubblefit.errors import BubblefitError

#: Bytes that a reading may take beyond what the process has, and seconds.
MEMORY, SECONDS = 2**29, 20
#: Letters of a message.
LONGEST = 4000


class Endless(BaseException):
    """Time is up; no reader catches it."""


@contextmanager
def limits(memory: int = MEMORY, seconds: int = SECONDS):
    """No more memory, and no more time, for what is done in the block."""

    def stop(*_: object) -> None:
        raise Endless(f"more than {seconds} s")

    before = resource.getrlimit(resource.RLIMIT_AS)
    own = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    earlier = signal.signal(signal.SIGALRM, stop)
    resource.setrlimit(resource.RLIMIT_AS, (own + memory, before[1]))
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, earlier)
        resource.setrlimit(resource.RLIMIT_AS, before)


def fault(read: Callable[[Path], object], path: Path) -> str:
    """What is wrong with how a file is read; empty where it is read or refused as it should be."""
    try:
        with limits():
            read(path)
    except BubblefitError as error:
        said = str(error)
        # Readers turn what Python says of memory into a line, too.
        if "\n" in said or len(said) > LONGEST or "Unable to allocate" in said:
            return f"a message that is no line: {said[:300]!r}"
    except (Exception, Endless) as error:
        last = traceback.extract_tb(error.__traceback__)
        places = [f"{Path(f.filename).name}:{f.lineno} {f.name}" for f in last[-4:]]
        return f"{type(error).__name__}: {str(error)[:200]} at {' < '.join(reversed(places))}"
    return ""
