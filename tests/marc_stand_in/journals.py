"""The status file (.sts), the output (.out) and the log (.log) of a job."""

from __future__ import annotations

from pathlib import Path

RULE = "-" * 110
HEAD = f"""
          MSC Marc stand-in of bubblefit (no MSC software)

  job {{name}}, date of no matter

{RULE}
 load   inc  cycl sepa cut  |  cycl sepa cut  rem |  time step   total time    displacement
 case    #   inc  #    back |  total               |  of the inc  of the job    min         max
{RULE}
"""
#: What the log says of how a job ended (public lists of exit numbers).
MEANING = {
    3004: "Marc: normal end",
    3015: "Marc: unable to reduce time step below minimum",
    13: "Marc: errors in the input data",
    1005: "Marc: element is inside out",
    3: "",
}


class Journals:
    """What a job writes down while it runs; every line is on disk at once."""

    def __init__(self, folder: Path, name: str) -> None:
        self.files = {end: (folder / f"{name}.{end}").open("w") for end in ("sts", "out", "log")}
        self._write("sts", HEAD.format(name=name))
        self._write("out", f" MSC Marc stand-in, job {name}\n")
        self._write("log", f" job {name}\n")
        self.cycles = 0

    def out(self, text: str) -> None:
        self._write("out", f"{text}\n")

    def log(self, text: str) -> None:
        self._write("log", f"{text}\n")

    def error(self, text: str) -> None:
        """As Marc has it in its output."""
        self.out(f" *** error - {text}")
        self.log(f" *** error - {text}")

    def increment(
        self, case: int, number: int, step: float, time: float, least: float, most: float
    ) -> None:
        """A line of the .sts, and that of the .out."""
        self.cycles += 3
        self._write(
            "sts",
            f"{case:5d} {number:6d} {3:4d} {0:4d} {0:4d}  {self.cycles:6d} {0:4d} {0:4d} {0:4d}"
            f"   {step:.5E}  {time:.5E}  {least:.5E}  {most:.5E}\n",
        )
        self.out(f" end of increment {number:8d}, total time {time:.6E}")

    def end(self, number: int | None) -> None:
        """The exit number; None: the job is gone without one."""
        if number is not None:
            self._write("sts", f"\n Job ends with exit number :    {number}\n")
            self.out(f"\n marc exit number {number}\n {MEANING.get(number, '')}")
            self.log(f" Exit number {number}\n {MEANING.get(number, '')}")
        for stream in self.files.values():
            stream.close()

    def _write(self, end: str, text: str) -> None:
        self.files[end].write(text)
        self.files[end].flush()
