"""Drawing of Vega specifications without a browser, by vl-convert in a process of its own.

vl-convert also contains the scripts of Vega that a page carries (`library`).
"""

import base64
import json
import os
import subprocess
import sys
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from typing import Any

from ..errors import OutputError
from ..storage.writing import cache_folder, replacing


class Converter:
    """Draw specifications with vl-convert in a child process, which is started when needed.

    In this process vl-convert would start a thread, which a fork of the process would not have.

    Parameters
    ----------
    png_scale : float
        Pixels of a PNG for each pixel of the specification.
    """

    #: Program of the child process: for each line of JSON it reads, it writes a drawing in base64.
    PROGRAM = """
import base64, json, sys
import vl_convert
for line in sys.stdin:
    name, spec, options = json.loads(line)
    drawing = getattr(vl_convert, name)(spec, **options)
    drawing = drawing.encode() if isinstance(drawing, str) else drawing
    print(base64.b64encode(drawing).decode(), flush=True)
"""

    def __init__(self, png_scale: float = 2.0) -> None:
        self.png_scale = png_scale
        self._program: subprocess.Popen[str] | None = None
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
            program = self._running()
            assert program.stdin is not None and program.stdout is not None
            with suppress(OSError):
                print(line, file=program.stdin, flush=True)
                if answer := program.stdout.readline():
                    return base64.b64decode(answer)
            self._program = None
        raise OutputError("vl-convert ended before it had drawn a chart")

    def _running(self) -> subprocess.Popen[str]:
        """Return the child process of this process, and start it if there is none yet."""
        if self._program is None or self._starter != os.getpid():
            self._program = subprocess.Popen(
                [sys.executable, "-c", self.PROGRAM],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            self._starter = os.getpid()
        return self._program


#: The converter that all modules share.
convert = Converter()


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
