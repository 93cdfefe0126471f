"""Notes of every kind, provoked; a fit and a run of Marc go wrong in many ways at once."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments import states
from bubblefit.experiments.base import Alternative
from bubblefit.experiments.bubble.findings import notes_of_slack, warnings_of
from bubblefit.experiments.bubble.frame_doubts import LOADED_REFERENCE
from bubblefit.experiments.cycles.evaluation import scatter_notes
from bubblefit.experiments.forward import notes_of
from bubblefit.experiments.strips.gauge import GaugeTable, virtual_strain_gauge
from bubblefit.inference.assessment import certainty
from bubblefit.inference.noise import Misfit
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.problem import ANALYSES_USED_UP
from bubblefit.inference.shear_valley import note_of_one_stiffness
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.exports import subroutines
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.notes import Note, NoteKind
from bubblefit.readers.curves import LoadCurve
from bubblefit.readers.frames import Frame, frame_files
from bubblefit.readers.histories import Pace
from bubblefit.reports.kinds import bubble_readings
from bubblefit.runs.compare import FoldError, FormFit, LawComparison
from bubblefit.runs.estimate import estimate_of
from bubblefit.runs.fit import AlternativeFit, AlternativeFits
from bubblefit.runs.refinement import refine, vary_nu12
from bubblefit.runs.setup import prepare_fit
from bubblefit.runs.simulation import simulate_cards
from bubblefit.solvers import registry
from bubblefit.solvers.base import History
from bubblefit.solvers.calculix import cylinder as cylinder_analysis
from bubblefit.solvers.calculix.cylinder import BentCylinder, solid_mesh, volumes
from bubblefit.solvers.calculix.deck import shell_mesh, tilt_remarks
from bubblefit.solvers.marc.analyses import bubble_history, touching
from bubblefit.solvers.marc.solver import MarcSolver
from bubblefit.solvers.membrane import bending, inflation
from bubblefit.solvers.membrane.closed import ClosedMembrane
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..inference import cases
from ..inference.cases import MODEL
from ..marc_stand_in.files import bending_marc, t19_text
from ..solvers.marc.test_solver import frames_of
from ..solvers.membrane.cases import square_beam
from ..solvers.membrane.test_bending import LINEAR
from ..support.paths import KNOWN
from . import load_histories
from .bars import BarSolver, BarTest, known_bars, project_of
from .projects import constant_strips, fit_setup, known_bubble
from .strip_tests import notes_on_directions


@cache
def fit() -> bf.Fit:
    """Strips in two tests: bounds too narrow, noise too small, a preload, a start that fails."""
    with TemporaryDirectory() as name, pytest.MonkeyPatch.context() as patch:
        folder = Path(name)
        path = constant_strips(
            folder,
            ("E1 = [0.02, 2.0]", "E1 = [0.02, 0.3]"),
            ("E2 = [0.03, 1.0]", "E2 = [0.24, 1.0]"),
            ('name = "one"', 'name = "one"\nnoise = 0.01'),
            ("increments = 8", "increments = 4"),
            ("seed = 7", "seed = 7\nmax_analyses = 12"),
        )
        # Another column of elongations, and a load before any.
        head, *rows = (folder / "one.csv").read_text().splitlines()
        rows = [f"{head},crosshead [mm]", "warp,a,0.0,60.0,0.0", *(f"{row},0.0" for row in rows)]
        (folder / "one.csv").write_text("\n".join(rows) + "\n")
        (folder / "tired").touch()

        class Tired(MembraneSolver):
            def run_with_sensitivity(self, *arguments: Any, **named: Any) -> Any:
                if (folder / "tired").exists():
                    (folder / "tired").unlink()
                    raise SolverFailure("too tired", self.name)
                return super().run_with_sensitivity(*arguments, **named)

        patch.setitem(registry.SOLVERS, "membrane", Tired)
        return bf.fit(bf.read_project(path), jobs=1)


def notes_of_fit(*_: Any) -> list[Note]:
    return fit().notes


def notes_of_directions(*_: Any) -> list[Note]:
    names = ["s: warp", "s: bias", "s: 30 degrees"]
    return list(notes_on_directions({"bias": 0.89, "30 degrees": 1.0}, names, 0.4))


def notes_of_an_unfinished_fit(*_: Any) -> list[Note]:
    best = fit().best
    ranked = [replace(record, status=ANALYSES_USED_UP) for record in best.ranked]
    return replace(fit(), best=replace(best, ranked=ranked)).notes


def comparison(fit: bf.Fit) -> LawComparison:
    """A fit as that of a form whose third fold failed."""
    folds = (FoldError(0, 0.1, {}), FoldError(1, 0.1, {}), FoldError(2, None, {}))
    return LawComparison((FormFit("spline:3", fit, folds, ("one: warp",)),), 1)


def notes_of_bubble(folder: Path, _: Any) -> list[Note]:
    """Matched by crude surfaces to data of its own model; and were they measured."""
    match = ('by = "points"', 'by = "surfaces"\ndegree = 4')
    project = bf.read_project(known_bubble(folder, match))
    (prepared,) = prepare_fit(project, list(project.tests.values())).tests
    return warnings_of(replace(prepared, known=None))


def notes_of_one_stiffness(*_: Any) -> list[Note]:
    return [note_of_one_stiffness(None)]


def notes_of_gauges(_: Path, patch: pytest.MonkeyPatch) -> Iterable[Note]:
    """Return notes of heights whose sheet has no unknown shape."""
    patch.setattr(bubble_readings, "modelled_series", lambda fitted: [])
    test = SimpleNamespace(sheet=SimpleNamespace(has_unknowns=False))
    prepared: Any = SimpleNamespace(data_files=list, test=test)
    fitted: Any = SimpleNamespace(comparisons=(), nuisance={}, reported_nuisance={})
    return bubble_readings.findings(prepared, fitted).warnings


def notes_of_alternatives(*_: Any) -> Iterable[Note]:
    words = "a reference picture under {:.3g} kPa"
    alternative = Alternative(
        words, "the sheet at rest", 3.0, 9.0, lambda _: None, LOADED_REFERENCE
    )
    setup = SimpleNamespace(tests=[SimpleNamespace(test=BarTest("a bar"))])
    fits = AlternativeFits(setup, 0, alternative, None)
    fits.best = AlternativeFit(3.0, None, Misfit(0.02, 0.02, "given", "mm"))
    for rms in (0.01, 0.03):
        yield from fits.notes(Misfit(rms, 0.02, "given", "mm"))


def notes_of_a_stretched_sheet(*_: Any) -> list[Note]:
    return notes_of_slack({"slack_percent": [-0.3, 0.1]})


def notes_of_certainty(*_: Any) -> Iterable[Note]:
    """A pressure that is as far off as it may be."""
    offset = Nuisance("pressure_offset", -3.0, 50.0, "kPa", "pressure_offset", 1e-3)
    unknown_offset = NuisanceUnknowns({"bubble": (offset,)})
    problem = cases.bubble_problem(replace(cases.CUBIC, nuisance=unknown_offset))
    unknowns = problem.unknowns.at(cases.LAW.beta)
    unknowns[-1] = offset.lower
    point = problem.evaluate(unknowns, True)
    assert point is not None
    return certainty(problem, point, cases.LAW, np.full(3, 0.08)).notes


def notes_of_an_estimate(folder: Path, patch: pytest.MonkeyPatch) -> Iterable[Note]:
    """Return notes of a bubble at wrong pressures, beside a test that gives no estimate."""
    setup = fit_setup(KNOWN)
    (prepared,) = setup.tests
    pressures = tuple(p + 0.01 for p in prepared.test.pressures)
    test = replace(prepared.test, pressures=pressures, increments=pressures, noise=0.01)
    fields = tuple(replace(f, pressure=p) for f, p in zip(prepared.fields, pressures, strict=True))

    def refuse(make_solver: Any) -> Any:
        raise InputError(None, "points", "lie on a part of the disk only")

    other: Any = SimpleNamespace(
        test=SimpleNamespace(name="other", weight=1.0), virtual_work=refuse
    )
    tests = (replace(prepared, test=test, fields=fields), other)
    return estimate_of(replace(setup, tests=tests)).notes


Array = np.ndarray


def notes_of_bending(*_: Any) -> Iterable[Note]:
    """A beam bent to 6 of 8 mm, every move called a jump."""
    find, heights = ClosedMembrane.equilibrium, list[float]()

    def tired(self: ClosedMembrane, u: Array, pressure: float) -> Array | None:
        if self.bodies:
            heights.append(self.bodies[-1].centre[1])
            if heights[0] - heights[-1] > 4.5:
                return None
        return find(self, u, pressure)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ClosedMembrane, "equilibrium", tired)
        patch.setattr(bending.BendingAnalysis, "leap", 1e-6)
        solver = MembraneSolver(1e-6, wrinkle_stiffness=0.01)
        return solver.run(square_beam((2.0, 4.0, 6.0, 8.0), across=4), LINEAR).remarks


def notes_of_inflation(_: Path, patch: pytest.MonkeyPatch) -> Iterable[Note]:
    patch.setattr(inflation.Filling, "max_volume_growth", 0.0)
    return MembraneSolver(1e-6).run(replace(square_beam(across=4), bending=None), LINEAR).remarks


def notes_of_analysis(*_: Any) -> list[Note]:
    """Yarns slide where half the stress along them is more than the shear modulus."""
    soft = replace(HypoelasticLaw.linear(500.0, 200.0, 4.0), strain_range=np.array([0.05, 1, 1]))
    model = straight_strip("warp", 20.0, 21.6, 0.81, increments=10, across=8)
    return notes_of(MembraneSolver().run(model, soft), MaterialCard(soft, 0.81))


def notes_of_marc_bending(folder: Path, patch: pytest.MonkeyPatch) -> Iterable[Note]:
    """A Marc that repeats an increment and stops at 60 of 100 mm; the supports carry nothing."""
    patch.delenv("BUBBLEFIT_MARC", raising=False)
    model = inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0, 60.0, 100.0])
    frames, _ = frames_of(model, model.mesh.points * [0.05, 0.05, 0.0], last=2)
    frames[-1][1]["Contact Normal Force"][touching(model)["supports"]] = 0.0
    count = len(frames) - 1
    program = bending_marc(folder, model, frames, 3015, [*range(1, count), count - 1])
    return MarcSolver(marc=program, scratch=str(folder / "scratch")).run(model, LINEAR).remarks


def notes_of_marc_results(folder: Path, _: Any) -> Iterable[Note]:
    u = np.zeros_like(MODEL.mesh.points)
    frames = [(float(i), {"Displacement": u}) for i in range(len(MODEL.increments) + 1)]
    (folder / "job.t19").write_text(t19_text(MODEL.mesh.points, MODEL.mesh.quads, frames))
    return bubble_history(folder / "job.t19", MODEL, 1).remarks


def notes_of_calculix_bending(*_: Any) -> Iterable[Note]:
    """A run that stopped at 6 of 8 mm; its volume does not change, so nor does the pressure."""
    model = inflated_cylinder(150.0, 0.14, 0.81, 60.0, deflections=[4.0, 8.0])
    solids, still = solid_mesh(model), np.zeros((3, *model.mesh.points.shape))
    forces = {name: np.zeros((3, 3)) for name in ("supports", "collar")}
    volume = volumes(model, still)
    filling = volume[0] * (1 + 0.01 * np.arange(1, len(model.inflation) + 1))
    found = BentCylinder(np.array([0.0, 3, 6]), still, forces, volume, 9, True, "no step left")

    def run(_decks: Any, _read: Any, rescue: Any = None) -> Any:
        return (np.zeros_like(solids.points), filling) if rescue is None else found

    setup: Any = SimpleNamespace(templates=None)
    return cylinder_analysis.analyse(model, LINEAR, setup, run).remarks


def notes_of_tilted_shells(*_: Any) -> Iterable[Note]:
    shells = shell_mesh(MODEL.mesh, "S4")
    radius = np.hypot(*shells.points[:, :2].T)
    cone = shells.points + np.outer(30.0 * (1 - radius / radius.max()), [0, 0, 1])
    return tilt_remarks(replace(shells, points=cone))


LAW = HypoelasticLaw.linear(600.0, 120.0, 15.0)
CARD = MaterialCard(LAW, 0.5, "soft")


class Saying(BarSolver):
    """A solver of another distribution, whose remarks are plain words unless told otherwise."""

    says: Sequence[str] = ("as a plug-in says it",)

    def run(self, *arguments: Any, **named: Any) -> History:
        return replace(super().run(*arguments, **named), remarks=tuple(self.says))


def bars(patch: pytest.MonkeyPatch, says: Sequence[str] = (), **fails: Any) -> bf.Project:
    """A project of one bar; what its solver `says` and `fails` at."""
    solver = known_bars(patch, Saying(**fails))
    solver.says = says or solver.says
    return project_of(BarTest("a bar"))


def notes_of_simulation(folder: Path, patch: pytest.MonkeyPatch) -> list[Note]:
    """A thick card that is valid nowhere, and one whose bar breaks."""
    project = bars(patch, law_fails=lambda law: law.nu12 == 0.3)
    cards = {
        "thick": MaterialCard(replace(LAW, strain_range=np.array([0.05, 1.0, 1.0])), 1.0),
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
    time, load, strain = load_histories.load_history()
    travel = folder / "travel.csv"
    load_histories.write_history(
        travel, ["Time (s),Load (N),Crosshead (mm)"], (time, load, 200 * strain)
    )
    faulty = bf.cycles(list(load_histories.faulty_histories(folder).values()))
    scatter = scatter_notes({"warp": faulty.histories, "fill": faulty.histories[:1]})
    return [*faulty.notes, *scatter, *bf.cycles(travel, length=200.0).notes]


def notes_of_states(*_: Any) -> list[Note]:
    said = {
        "bubble": "first loading",
        "one": states.state_from_conditioning("3 cycles to 5 kN/m"),
        "two": "",
        "three": states.state_from_conditioning("None"),
    }
    paces = {"one": Pace(0.01, 0.0), "two": Pace(0.001, 60.0), "three": Pace()}
    tests: Any = [SimpleNamespace(name=n, state=s, pace=paces.get(n)) for n, s in said.items()]
    return states.notes_of_states(tests)


def notes_of_exports(*_: Any) -> list[Note]:
    return subroutines.NLELAST.export(CARD).remarks.notes
