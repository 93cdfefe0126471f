"""Drawing of Vega specifications without a browser, by vl-convert in processes of its own.

While a page is put together, its pictures are drawn beside it (`background`). vl-convert also
contains the scripts of Vega that a page carries (`library`).
"""

import base64
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from ..errors import OutputError
from ..processes import cores
from ..storage.writing import cache_folder, replacing

T = TypeVar("T")


def drawn_at_once() -> int:
    """Return the number of drawings that are made at once; a process for them takes 0.3 s."""
    return min(cores(), 2)


class Converter:
    """Draw specifications with vl-convert in child processes, which are started when needed.

    In this process vl-convert would start a thread, which a fork of the process would not have.
    Threads may call it at the same time: each call has a child process to itself.

    Parameters
    ----------
    png_scale : float
        Pixels of a PNG for each pixel of the specification.
    """

    #: Program of a child process: for each line of JSON it reads, it writes a drawing in base64. It
    #: ends when this process does.
    PROGRAM = """
import base64, json, signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)
import vl_convert
vl_convert.vega_to_svg({"marks": []})
for line in sys.stdin:
    name, spec, options = json.loads(line)
    drawing = getattr(vl_convert, name)(spec, **options)
    drawing = drawing.encode() if isinstance(drawing, str) else drawing
    print(base64.b64encode(drawing).decode(), flush=True)
"""

    def __init__(self, png_scale: float = 2.0) -> None:
        self.png_scale = png_scale
        self._idle: list[subprocess.Popen[str]] = []
        self._starter = 0

    def __call__(self, kind: str, spec: dict[str, Any]) -> bytes:
        """Return the content of an image file.

        Parameters
        ----------
        kind : {"png", "svg", "pdf"}
            Format of the file.
        spec : dict
            Vega specification of the drawing.

        Raises
        ------
        OutputError
            The child process ended without a drawing, twice.
        """
        options = {"scale": self.png_scale} if kind == "png" else {}
        line = json.dumps([f"vega_to_{kind}", spec, options])
        for _ in range(2):  # once more where it was killed, as a machine short of memory may do
            program = self._idle_program()
            assert program.stdin is not None and program.stdout is not None
            with suppress(OSError):
                print(line, file=program.stdin, flush=True)
                if answer := program.stdout.readline():
                    self._idle.append(program)
                    return base64.b64decode(answer)
        raise OutputError("vl-convert ended before it had drawn a chart")

    def prepare(self) -> None:
        """Start the child processes of a page that is soon to be drawn, if there are none yet."""
        programs = [self._idle_program() for _ in range(drawn_at_once())]
        self._idle += programs

    def _idle_program(self) -> subprocess.Popen[str]:
        """Take a child process of this process that draws nothing, or start one."""
        if self._starter != os.getpid():
            self._idle = []
            self._starter = os.getpid()
        with suppress(IndexError):
            return self._idle.pop()
        return subprocess.Popen(
            [sys.executable, "-c", self.PROGRAM],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )


class Background:
    """Threads that wait for drawings while the page that they belong to is put together."""

    def __init__(self) -> None:
        self._threads: ThreadPoolExecutor | None = None
        self._drawings: list[Future[Any]] = []
        #: Files of the page so far that are drawn.
        self.files = set[Path]()

    @contextmanager
    def during_page(self) -> Iterator[None]:
        """Draw beside what the block does, and end when everything is drawn.

        Raises
        ------
        OutputError
            A drawing cannot be made, or its file cannot be written.
        """
        if self._threads is not None:  # the page of a fit within that of a study
            yield
            return
        self.files = set()
        threads = ThreadPoolExecutor(drawn_at_once())
        self._threads = threads
        try:
            yield
            self.wait()
        finally:
            threads.shutdown(cancel_futures=True)
            self._threads = None
            self._drawings = []

    def begin(self, draw: Callable[..., T], *arguments: Any) -> Callable[[], T]:
        """Begin to draw, and return the function that waits for the drawing.

        Outside of `during_page` it is drawn before this returns.
        """
        if self._threads is None:
            drawing = draw(*arguments)
            return lambda: drawing
        future = self._threads.submit(draw, *arguments)
        self._drawings.append(future)
        return future.result

    def wait(self) -> None:
        """Wait until all drawings of the page so far are there."""
        for drawing in self._drawings:
            drawing.result()


#: The converter and the threads that all modules share.
convert = Converter()
background = Background()


@cache
def library() -> str:
    """Return all of Vega as one script, which is kept in bubblefit's cache folder.

    Raises
    ------
    OutputError
        vl-convert cannot give the script.
    """
    path = cache_folder() / f"vega-{version('vl-convert-python')}.js"
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        pass
    # vl-convert runs in a process of its own, which also works from a forked process; this is
    # needed only once for each version of vl-convert.
    call = "import sys, vl_convert; sys.stdout.write(vl_convert.javascript_bundle(sys.argv[1]))"
    command = [sys.executable, "-c", call, "window.vegaEmbed = vegaEmbed;"]
    process = subprocess.run(command, capture_output=True)
    if process.returncode:
        raise OutputError(f"the scripts of vl-convert: {process.stderr.decode()[-300:]}")
    text = process.stdout.decode()
    # No text in the script may end the script element of the page.
    text = text.replace("</script", "<\\/script").replace("<!--", "<\\!--")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="")
    except (OSError, OutputError):
        pass  # a cache that cannot be written costs two seconds a page
    return text
