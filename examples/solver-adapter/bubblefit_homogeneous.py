"""A solver adapter for bubblefit, small but complete: input, subprocess, results, failures.

It runs warp and fill strips in a program of its own (homogeneous_program.py). An adapter for a
real program differs in what it writes and reads, not in its shape.
"""

import hashlib
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import UniaxialModel
from bubblefit.solvers.bars import homogeneous_history
from bubblefit.solvers.base import History, SolverCheck
from bubblefit.solvers.process import log_tail, run_process
from bubblefit.solvers.scratch import run_folder

NAME = "homogeneous"
PROGRAM = Path(__file__).with_name("homogeneous_program.py")


class HomogeneousSolver:
    """What `--solver homogeneous` makes.

    Options come from the project file's table [solver.homogeneous], as keyword arguments.
    """

    name = NAME
    #: Not in this process: it is checked before a study, and gets one process a start.
    external = True
    #: Options that say what is run: a project may give them only where its user lets it.
    started = ("program",)

    def __init__(self, program: str | None = None, timeout: float = 60.0) -> None:
        self.program = Path(program).expanduser() if program else PROGRAM
        if not timeout > 0:
            raise InputError(None, f"solver.{NAME}.timeout", f"expected > 0 s, got {timeout}")
        self.timeout = timeout
        #: Called with what is done of a run, where the program tells: this one does not.
        self.progress: Callable[[Any], None] | None = None

    @property
    def identity(self) -> str:
        """What results depend on; a study is taken up again only where this is the same."""
        program = self.program.read_bytes() if self.program.is_file() else b""
        return f"{NAME} {hashlib.sha256(program).hexdigest()}"

    def check(self) -> SolverCheck:
        """Is it there, which version? `bubblefit doctor` then pulls its bars by `run`."""
        if not self.program.is_file():
            advice = f"{self.program} is not there; set program in [solver.{NAME}]"
            return SolverCheck(NAME, False, "", False, advice)
        with run_folder(NAME, None, False, NAME, "log") as folder:
            outcome = run_process(self._command("--version"), folder, folder / "log", timeout=10.0)
            version = log_tail(folder / "log").strip()
        well = outcome.exit_code == 0
        return SolverCheck(NAME, well, version, well, "" if well else "it does not start")

    def run(
        self,
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
    ) -> History:
        """One analysis: mm, N, MPa in and out. SolverFailure unless all of it ended well."""
        job, yarn = self._job(model, law)
        # Nothing of an earlier run can be there; kept after a failure, removed after anything else.
        with run_folder(NAME, scratch, False, NAME, "job.log") as folder:
            (folder / "job.json").write_text(json.dumps(job))
            log, seconds = folder / "job.log", timeout or self.timeout
            outcome = run_process(self._command("job.json"), folder, log, seconds)
            if outcome.timed_out or outcome.exit_code != 0:
                reason = "takes too long" if outcome.timed_out else "does not end well"
                if outcome.exit_code == 3:
                    reason = "a modulus is not positive"
                raise SolverFailure(reason, NAME, outcome.exit_code)
            try:
                rows = np.loadtxt(folder / "job.csv", delimiter=",", ndmin=2)
            except (OSError, ValueError) as error:
                raise SolverFailure(f"job.csv: {error}", NAME, 0) from None
            # Half a result must not look like one.
            if rows.shape != (len(model.elongations), 3) or not np.isfinite(rows).all():
                raise SolverFailure("job.csv is not complete", NAME, 0)
        strain = np.zeros_like(rows)
        strain[:, [yarn, 1 - yarn]] = np.log(rows[:, :2])
        return homogeneous_history(model, strain, rows[:, 2])

    def _command(self, argument: str) -> list[str | Path]:
        return [sys.executable, self.program, argument]

    def _job(self, model: Any, law: HypoelasticLaw) -> tuple[dict[str, Any], int]:
        """What the program is told, and the yarn that is pulled (0 warp, 1 fill)."""
        if not isinstance(model, UniaxialModel) or set(model.supports) != {"top", "symmetry_x"}:
            raise SolverFailure("takes strips along warp or fill only", NAME)
        pulled = 0 if abs(model.warp[1]) > 0.999 else 1
        # E1 of eps1 and E2 of eps2, whatever the form of the law.
        yarns = law.pieces[:2].tolist()
        job = {
            "along": yarns[pulled],
            "across": yarns[1 - pulled],
            "warp": pulled == 0,
            "nu12": float(law.nu12),
            "constant_thickness": law.thickness_change == "constant",
            "thickness": model.thickness,
            # The program pulls the whole strip, the model holds half of it.
            "width": model.load_factor * float(np.ptp(model.mesh.points[:, 0])),
            "stretches": (1 + np.array(model.elongations) / model.gauge_length).tolist(),
        }
        return job, pulled
