"""Notes of a fit, a bubble's findings and a comparison of forms, provoked.

The fit, which is costly, is run once: it goes wrong in many ways at once.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import InputError, Note, SolverFailure
from bubblefit.experiments.bubble import findings as bubble_findings
from bubblefit.experiments.bubble.findings import sheet_warnings
from bubblefit.inference.assessment import Certainty, certainty
from bubblefit.inference.comparison import Nuisance, NuisanceOf
from bubblefit.inference.likelihood import BOUND, Side
from bubblefit.inference.linear import Order
from bubblefit.inference.noise import Discrepancy, Misfit, NoiseTest, notes_of_discrepancies
from bubblefit.inference.noise import notes_of_noise as notes_of_noise_tests
from bubblefit.inference.problem import ANALYSES_USED_UP, Group, Unit
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.runs import best as mesh_error
from bubblefit.runs.bootstrap import Bootstrap
from bubblefit.runs.compare import FoldError, FormFit, LawComparison
from bubblefit.runs.estimate import estimate_of
from bubblefit.runs.profile import Profile
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers import registry
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..inference import cases
from ..places import KNOWN
from ..projects import constant_strips, small


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


def notes_of_an_unfinished_fit(*_: Any) -> list[Note]:
    best = fit().best
    ranked = [replace(record, status=ANALYSES_USED_UP) for record in best.ranked]
    return replace(fit(), best=replace(best, ranked=ranked)).notes


def comparison(fit: bf.Fit) -> LawComparison:
    """A fit as that of a form whose third fold failed."""
    folds = (FoldError(0, 0.1, {}), FoldError(1, 0.1, {}), FoldError(2, None, {}))
    return LawComparison((FormFit("spline:3", fit, folds, ("one: warp",)),), 1)


def notes_of_comparison(*_: Any) -> list[Note]:
    return comparison(fit()).notes


def notes_of_bubble(folder: Path, _: Any) -> list[Note]:
    """Matched by crude surfaces to data of its own model; and were they measured."""
    match = ('by = "points"', 'by = "surfaces"\ndegree = 4')
    project = bf.read_project(small(folder, match))
    (prepared,) = prepare_fit(project, list(project.tests.values())).tests
    flat = sheet_warnings(replace(prepared, known=None))
    return [*bubble_findings.match_warnings(prepared), *flat]


def notes_of_mesh(*_: Any) -> Iterable[Note]:
    """A mesh that moves the warp modulus by 4 % beside noise of 1 %."""
    strain = {name: np.array([0.0, 0.05]) for name in COMPONENTS}
    sigma = {name: np.full(2, 0.01) for name in COMPONENTS}
    mesh = {name: np.array([0.0, 0.04 * (name == "E1")]) for name in COMPONENTS}
    return mesh_error.notes_of_mesh(Certainty({}, strain, sigma, (), mesh))


def notes_of_no_mesh(_: Path, monkeypatch: pytest.MonkeyPatch) -> Iterable[Note]:
    """A finer mesh that cannot be run."""
    failure = SolverFailure("it breaks", "membrane")
    monkeypatch.setattr(mesh_error, "limit_of_meshes", lambda *_: raise_(failure))
    none: Any = None
    return mesh_error._limit(none, none, none)[1]


def raise_(error: Exception) -> None:
    raise error


def notes_of_form(*_: Any) -> Iterable[Note]:
    """Of what a fit leaves, much is smooth."""
    found = Discrepancy(ratio=22.6, largest=1.25, rms=0.036, unit="mm")
    return notes_of_discrepancies({"bubble": found})


def notes_of_profile(*_: Any) -> Iterable[Note]:
    """A modulus that a bound stops, and whose data are fitted better elsewhere."""
    sides = Side((10.0, 9.0), (0.0, 5.0), "", 1), Side((10.0, 12.0), (0.0, -1.0), BOUND, 1)
    return Profile("G12", 0.02, 10.0, 1.0, (9.0, 11.0), *sides, (1.0, 12.0)).notes


def notes_of_bootstrap(*_: Any) -> Iterable[Note]:
    """Of two specimens."""
    units = [Unit(name, np.zeros(1, dtype=bool)) for name in "ab"]
    found: Any = SimpleNamespace(notes=())
    return Bootstrap(found, "specimens", [Group("one: warp", units)], (), 0).notes


def notes_of_order(*_: Any) -> Iterable[Note]:
    """Much is left, and the second derivatives say something else."""
    return Order(True, "", {"G12": 0.36}, 3, 3).notes


def notes_of_noise(*_: Any) -> Iterable[Note]:
    """Half of the noise that is given."""
    misfit = Misfit(0.01, 0.02, "given", "mm")
    return notes_of_noise_tests({"bubble": NoiseTest(misfit, 900, 900.0, 890.0)})


def notes_of_limit(*_: Any) -> Iterable[Note]:
    """The same mesh, its error taken out."""
    return [mesh_error.note_of_limit({name: np.array([0.0, 0.04]) for name in COMPONENTS})]


def notes_of_certainty(*_: Any) -> Iterable[Note]:
    """A pressure that is as far off as it may be."""
    offset = Nuisance("pressure_offset", -3.0, 50.0, "kPa", "pressure_offset", 1e-3)
    problem = cases.problem(replace(cases.CUBIC, nuisance=NuisanceOf({"bubble": (offset,)})))
    unknowns = problem.unknowns.at(cases.LAW.beta)
    unknowns[-1] = offset.lower
    point = problem.evaluate(unknowns, True)
    assert point is not None
    return certainty(problem, point, cases.LAW, np.full(3, 0.08)).undetermined


def notes_of_an_estimate(folder: Path, patch: pytest.MonkeyPatch) -> Iterable[Note]:
    """Return notes of a bubble at wrong pressures, beside a test that gives no estimate."""
    project = bf.read_project(KNOWN)
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    (prepared,) = setup.tests
    pressures = tuple(p + 0.01 for p in prepared.test.pressures)
    test = replace(prepared.test, pressures=pressures, increments=pressures, noise=0.01)
    fields = tuple(replace(f, pressure=p) for f, p in zip(prepared.fields, pressures, strict=True))

    def refuse(make_solver: Any) -> Any:
        raise InputError(None, "points", "lie on a part of the disk only")

    other: Any = SimpleNamespace(test=SimpleNamespace(name="other"), virtual_work=refuse)
    tests = (replace(prepared, test=test, fields=fields), other)
    return estimate_of(replace(setup, tests=tests)).notes
