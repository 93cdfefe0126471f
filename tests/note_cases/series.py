"""Notes of simulations and studies of bars, of gauges and of exports, provoked."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import Note, NoteKind
from bubblefit.experiments import kinds
from bubblefit.experiments import registry as experiments
from bubblefit.experiments.kinds import state_said
from bubblefit.experiments.strips.gauge import GaugeTable, virtual_strain_gauge
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.exports import subroutines
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.readers.curves import LoadCurve
from bubblefit.readers.frames import Frame, frame_files
from bubblefit.runs.poisson import vary_nu12
from bubblefit.runs.refinement import refine
from bubblefit.runs.simulation import simulate_cards
from bubblefit.solvers import registry
from bubblefit.solvers.base import History

from .. import load_cycles
from ..bars import BarKind, BarSolver, BarTest, project_of

LAW = HypoelasticLaw.linear(600.0, 120.0, 15.0)
CARD = MaterialCard(LAW, 0.5, "soft")


class Saying(BarSolver):
    """A solver of another distribution, whose remarks are plain words unless told otherwise."""

    says: Sequence[str] = ("as a plug-in says it",)

    def run(self, *arguments: Any, **named: Any) -> History:
        return replace(super().run(*arguments, **named), remarks=tuple(self.says))


def bars(patch: pytest.MonkeyPatch, says: Sequence[str] = (), **fails: Any) -> bf.Project:
    """A project of one bar; what its solver `says` and `fails` at."""
    solver, known = Saying(**fails), {**experiments.kinds(), "bars": BarKind()}
    solver.says = says or solver.says
    patch.setattr("bubblefit.project.project.kinds", lambda: known)
    for module in ("runs.simulation", "project.project"):
        patch.setattr(f"bubblefit.{module}.kind_named", known.__getitem__)
    reports = experiments.report_of
    patch.setattr(
        "bubblefit.runs.simulation.report_of",
        lambda name: BarKind() if name == "bars" else reports(name),
    )
    patch.setitem(registry.SOLVERS, "bars", lambda: solver)
    return project_of(BarTest("a bar"))


def notes_of_simulation(folder: Path, patch: pytest.MonkeyPatch) -> list[Note]:
    """A thick card that is valid nowhere, and one whose bar breaks."""
    project = bars(patch, law_fails=lambda law: law.nu12 == 0.3)
    short = replace(LAW, strain_range=np.array([0.05, 1.0, 1.0]))
    cards = {
        "thick": MaterialCard(short, 1.0),
        "stiff": MaterialCard(HypoelasticLaw.linear(600.0, 120.0, 15.0, nu12=0.3), 0.5),
    }
    done = simulate_cards(project, [BarTest("a bar")], cards, folder / "out")
    return [Note(NoteKind(n["kind"]), n["note"], n["of"]) for n in done.numbers["notes"]]


def notes_of_nu12(_: Path, patch: pytest.MonkeyPatch) -> list[Note]:
    project = bars(patch, law_fails=lambda law: law.nu12 == 0.3)
    return vary_nu12(project, CARD, [0.2, 0.3]).notes


def notes_of_refinement(_: Path, patch: pytest.MonkeyPatch) -> list[Note]:
    return refine(bars(patch, fails=8), CARD).notes


def gauge(folder: Path) -> GaugeTable:
    """Its upper end is lost in frame 2 of 12, and frame 10 has no load."""
    x, y = (part.ravel() for part in np.meshgrid(np.arange(3.0), np.arange(11.0)))
    points = np.stack([x, y, 0 * x], axis=1)
    frames = [Frame(points, 0.01 * i * points * [0, 1, 0]) for i in range(12)]
    frames[2] = Frame(points[:20], frames[2].displacement[:20])
    names = sorted(f"f{i}.csv" for i in range(12))
    for name in names:
        (folder / name).touch()
    _, order = frame_files([str(folder / name) for name in names])
    record = virtual_strain_gauge(frames, (1.0, 1.0), (1.0, 9.0))
    seen = np.array([i for i in range(12) if i not in (2, 10)])
    curve = LoadCurve("warp", "1", record.elongation[seen], 9.0 * seen, None, frame=seen)
    return GaugeTable(names, (1.0, 1.0), (1.0, 9.0), record, curve, order)


def notes_of_gauge(folder: Path, _: Any) -> list[Note]:
    return gauge(folder).notes


def notes_of_cycles(folder: Path, _: Any) -> list[Note]:
    time, load, strain = load_cycles.made()
    travel = folder / "travel.csv"
    load_cycles.write(travel, ["Time (s),Load (N),Crosshead (mm)"], (time, load, 200 * strain))
    faulty = list(load_cycles.faulty(folder).values())
    return [*bf.cycles(faulty).notes, *bf.cycles(travel, length=200.0).notes]


def notes_of_states(*_: Any) -> list[Note]:
    said = {"bubble": "first loading", "one": state_said("3 cycles to 5 kN/m"), "two": "",
            "three": state_said("None")}  # fmt: skip
    rates = {"one": 100.0, "two": 10.0, "three": None}
    tests: Any = [SimpleNamespace(name=n, state=s, rate=rates.get(n)) for n, s in said.items()]
    return kinds.notes_of_states(tests)


def notes_of_exports(*_: Any) -> list[Note]:
    return subroutines.NLELAST.export(CARD).says.notes
