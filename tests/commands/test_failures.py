"""Every fault of every solver in every command, as docs/reference/failures.md has it."""

import re
import shutil
import time
from dataclasses import replace
from pathlib import Path

import pytest
from bubblefit.inference import search
from bubblefit.reports.content import Exhibit
from bubblefit.reports.kinds.cylinder import CylinderPresenter
from bubblefit.solvers import process

from ..builders.failing_solvers import MARC, failing_ccx
from ..builders.marc_runs import stand_in
from ..builders.projects import CONSTANT_BUBBLE, replaced_once
from ..support.commands import in_process, result_in
from ..support.paths import EXAMPLES, ROOT

TEXT = (ROOT / "docs" / "reference" / "failures.md").read_text()


FAULTS = ("inside out", "killed", "time-out", "disk full", "no licence", "collapse")


COMMANDS = ("bubble", "uniaxial", "bend")


#: A row of the table of reasons: fault, solver, the reason of bubbles and strips, and of cylinders.
ROW = re.compile(r"^\| ([a-z -]+) \| (CalculiX|Marc) \| (.*) \|$", re.MULTILINE)


REASONS = {
    (fault, solver.lower(), command): cell.strip("` ")
    for fault, solver, cells in ROW.findall(TEXT)
    for columns in [cells.split(" | ")]
    for command, cell in zip(COMMANDS, [columns[0], *columns], strict=True)
}


HEAD = "[fabric]\nthickness = 0.81\n"


BEND = """
[[cylinder]]
name = "tube"
diameter = 150
pressure = 20
length = 700
span = 500
element_size = 75.0
deflections = [1.0, 2.0]
places = [2.0]
slope_over = 1.0
[[card]]
name = "known"
strain_range = [0.13, 0.13, 0.13]
beta = [-7.96788e-3, 7.10747e-1, -1.56912e-1, 2.00439e-2, -1.06241e1, 1.37830e1, -9.31830e-1,
  1.39437e-1, -4.79622e2, 2.12650e2, -2.02028e1, 8.06350e-1]
"""


def strips():
    text = (EXAMPLES / "uniaxial-valmex7318/project.toml").read_text()
    text = replaced_once(text, ("increments = 100", "increments = 4"), ('"cubic"', '"constant"'))
    return text[: text.index("[fit]")]


def test_document_lists_every_fault():
    assert set(REASONS) == {
        (fault, solver, command)
        for fault in FAULTS for solver in ("calculix", "marc") for command in COMMANDS
    }  # fmt: skip
    never = {key for key, reason in REASONS.items() if reason.startswith("cannot occur")}
    assert never == {("no licence", "calculix", command) for command in COMMANDS}


class Stage:
    def __init__(self, folder, fault, solver, command, real):
        self.folder, self.command, self.solver = folder, command, solver
        text = {"bubble": CONSTANT_BUBBLE, "uniaxial": strips(), "bend": HEAD + BEND}[command]
        if command == "uniaxial":
            shutil.copy(EXAMPLES / "uniaxial-valmex7318/curves.csv", folder)
        # What is known is computed first; a cylinder collapses when it is bent.
        self.first = 1 if command == "bubble" else 0
        late = fault == "collapse" and command == "bend"
        settings = {"scratch": str(folder / "scratch")}
        self.place = folder / solver
        if solver == "calculix":
            self.place.mkdir()
            settings |= {"ccx": str(failing_ccx(self.place, real)), "element": "S4"}
            (self.place / "fault").write_text(f"{fault} late" if late else fault)
        else:
            marc = stand_in(self.place)
            settings |= {"executable": str(marc.program), "increments": "0"}
            runs = "2" if late else ",".join(map(str, range(1 + self.first, 9)))
            marc.told(f"{MARC[fault]}@{runs}")
        (self.place / "good").write_text("1\n" if self.first or late else "")
        lines = [f"{k} = {v if v[0].isdigit() else repr(v)}" for k, v in settings.items()]
        (folder / "scratch").mkdir()
        (folder / "project.toml").write_text(
            f'{text}\n[fit]\nstarts = 1\nsolver = "{solver}"\n[solver.{solver}]\n'
            + "\n".join(lines) + "\n"
        )  # fmt: skip

    @property
    def runs(self):
        path = self.place / "runs"
        return len(path.read_text().splitlines()) if path.exists() else 0

    def monotonic(self):
        return time.monotonic() + (1e6 if (self.place / "pids").exists() else 0.0)

    def run(self, *more, code):
        (self.place / "pids").unlink(missing_ok=True)
        return in_process(self.command, "project.toml", "--out", "out", "--jobs", 1, "--quiet",
                          *more, cwd=self.folder, code=code)  # fmt: skip


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.delenv("BUBBLEFIT_MARC", raising=False)
    settings = replace(search.SETTINGS, max_shortenings=0)
    monkeypatch.setattr(search, "SETTINGS", settings)
    monkeypatch.setattr(CylinderPresenter, "show_outcome", lambda *_: Exhibit())


def of(text):
    return re.compile(re.sub(r"\bN\b", r"[0-9.]+", re.escape(text).replace(r"\.\.\.", ".*?")))


@pytest.mark.parametrize(
    ("fault", "solver", "command"),
    [key for key, reason in REASONS.items() if not reason.startswith("cannot occur")],
)
def test_fault_is_reported_as_documented(ccx, tmp_path, monkeypatch, fault, solver, command):
    reason = REASONS[fault, solver, command]
    stage = Stage(tmp_path, fault, solver, command, ccx.path)
    monkeypatch.setattr(process, "time", stage)
    out = tmp_path / "out"
    if reason.startswith("stopped at"):
        done = stage.run(code=0)
        page = (out / "report.html").read_text().replace("\u00a0", " ")
        ended = result_in(out)["runs"][0]["ended"]
        for told in (done.stdout, page, ended, (out / "runs.csv").read_text()):
            assert of(reason).search(told), told
        before = stage.runs
        stage.run("--resume", code=0)
        assert stage.runs == before and result_in(out)["runs"][0]["ended"] == ended
        return
    done = stage.run("--json", code=4)
    page = (out / "report.html").read_text()
    assert (
        "this failed, and there is no result: " in page and 'class="verdict not-to-be-used"' in page
    )
    for told in (done.stderr, page):
        assert of(reason).search(told) and "scratch kept in" in told, told
    first = "no run ended well" if command == "bend" else "no start ended with a fit"
    assert done.stderr.startswith(f"bubblefit: {solver}: {first}: ") and done.stdout == ""
    assert not (out / "result.json").exists()
    kept = Path(re.search(r"scratch kept in (\S+?)(;|$)", done.stderr.splitlines()[0])[1])
    assert kept.is_dir() and kept.parent == tmp_path / "scratch"
    if command != "bend":
        assert of(reason).search((out / "history.csv").read_text())
    before = stage.runs
    if fault == "no licence" or (fault, solver) == ("killed", "calculix"):
        (stage.place / "good").write_text(f"{before + 1}\n" if stage.first else "")
        if solver == "marc":
            (stage.place / "fault").write_text(f"licence@{before + 1 + stage.first}")
        stage.run("--resume", code=4)
        assert stage.runs > before + stage.first
