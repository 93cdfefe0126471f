"""Bubble, strip and cylinder, written as decks of one's own, give the built-in results."""

import re
from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.deck.model import DeckModel
from bubblefit.experiments.deck.results import DeckReader, Probe, QuantityReading
from bubblefit.experiments.deck.solvers import DeckSolver
from bubblefit.inference.search import fit_from
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import RigidSupports, inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.project.project import read_project
from bubblefit.solvers.calculix.cylinder import cylinder_decks, solid_mesh
from bubblefit.solvers.calculix.deck import Setup, shell_mesh
from bubblefit.solvers.calculix.library import law_files
from bubblefit.solvers.calculix.sheets import analyse_bubble, analyse_strip, whole_times
from bubblefit.solvers.calculix.solver import CalculixSolver

from ..builders.projects import fit_setup
from ..support import needs

LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)
MATERIAL_BLOCK = re.compile(r"\*MATERIAL, NAME=@BUBBLEFIT.*?\*DEPVAR\n\d+\n", re.DOTALL)


class BuiltInRun:
    """A run of CalculiX that remembers its input files."""

    def __init__(self):
        self.files = {}

    def __call__(self, files, read, rescue=None):
        self.files = dict(files)
        files = {**files, **law_files(LAW)}
        return CalculixSolver()._once(files, read, None, 60.0, rescue)


def as_user_deck(folder, files, blocks, probe, times):
    """Run the files with the law of a template instead of theirs; return the deck's values."""
    replacements = iter(blocks)
    text = MATERIAL_BLOCK.sub(lambda _: f"{{{{ {next(replacements)} }}}}", files["job.inp"])
    (folder / "deck.inp.j2").write_text(text)
    (folder / "mesh.inp").write_text(files["mesh.inp"])
    reading = QuantityReading(Probe("time"), probe, times)
    reader = DeckReader((reading,), "job.frd")
    model = DeckModel(folder, "deck.inp.j2", {}, {}, "", 1.0, reader)
    filled = model.deck(LAW).files["job.inp"]
    assert "{{" not in filled and re.sub(r"\n+", "\n", filled) == re.sub(
        r"\n+", "\n", files["job.inp"]
    )
    return DeckSolver(CalculixSolver()).run(model, LAW).load


@pytest.fixture(autouse=True)
def calculix():
    needs.calculix()


def setup():
    return Setup("S8R", None, lambda mesh: shell_mesh(mesh, "S8R"))


def test_bubble(tmp_path):
    mesh = disk_mesh(100.0, 12, "quarter")
    model = BubbleModel(mesh, 0.81, (0.01, 0.03))
    run = BuiltInRun()
    history = analyse_bubble(model, LAW, setup(), run)
    apex = int(np.linalg.norm(mesh.points, axis=1).argmin())
    times = np.array(model.reported) + 1.0
    blocks = ['law.calculix("", 0, whole_times=True)']
    heights = as_user_deck(
        tmp_path, run.files, blocks, Probe("displacement", tuple(mesh.points[apex]), 2), times
    )
    np.testing.assert_allclose(heights, history.displacement[:, apex, 2], rtol=1e-9)


def test_strip(tmp_path):
    model = straight_strip("warp", 20.0, 21.0, 0.81, increments=4, across=2, along=4)
    run = BuiltInRun()
    history = analyse_strip(model, LAW, setup(), run)
    probe = Probe("reaction", model.pulled, 1, scale=-model.load_factor)
    blocks = ['law.calculix("", 90, whole_times=True)']
    loads = as_user_deck(tmp_path, run.files, blocks, probe, np.arange(1.0, 5.0))
    np.testing.assert_allclose(loads, history.load, rtol=1e-9)


def test_cylinder(tmp_path):
    model = inflated_cylinder(150.0, 0.03, 0.81, 75.0, 450.0, 0.0, supports=RigidSupports(300.0))
    solids = solid_mesh(model)
    run = BuiltInRun()
    files = cylinder_decks(model, LAW, solids)
    count = len(model.inflation)
    displacement, _ = run(files, lambda frd, _: whole_times(frd, count, len(solids.points)))
    node = int(solids.outer[0])
    blocks = [
        f'law.calculix("{name}", {angle}, normal_axis={axis}, whole_until={count})'
        for name, angle, axis in (("TUBE", 0, 1), ("CAPS", 0, 3))
    ]
    probe = Probe("displacement", tuple(solids.points[node]), 0)
    values = as_user_deck(tmp_path, files, blocks, probe, np.arange(1.0, count + 1))
    np.testing.assert_allclose(values, displacement[:, node, 0], rtol=1e-9)


LED = """\
[fabric]
name = "bubble"
thickness = 0.81

[units]
modulus = "MPa"

[law]
form = "constant"
strain_range = [0.1, 0.1, 0.1]

[law.bounds]
E1 = [200.0, 3000.0]
E2 = [200.0, 3000.0]
G12 = [10.0, 200.0]

[[deck]]
name = "bubble"
template = "deck.inp.j2"
SURROGATE

[[deck.compare]]
measured = "frame.csv"
quantity = "displacement"
set = "ALL"
times = [1]
noise = 0.02

[[bubble]]
name = "membrane"
weight = 0
radius = 100.0
elements = 12
symmetry = "quarter"
pressures = [30.0]

[bubble.data.known_solution]
beta = [0, 0, 0, 800.0, 0, 0, 0, 400.0, 0, 0, 0, 60.0]

[fit]
starts = 1
"""


def test_membrane_leads_a_deck_of_a_bubble_to_its_law_in_few_runs(tmp_path, monkeypatch):
    monkeypatch.setenv("BUBBLEFIT_RUNS", str(tmp_path / "runs"))
    model = BubbleModel(disk_mesh(100.0, 12, "quarter"), 0.81, (0.03,))
    run = BuiltInRun()
    history = analyse_bubble(model, LAW, setup(), run)
    template = MATERIAL_BLOCK.sub(
        '{{ law.calculix("", 0, whole_times=True) }}', run.files["job.inp"]
    )
    (tmp_path / "deck.inp.j2").write_text(template)
    (tmp_path / "mesh.inp").write_text(run.files["mesh.inp"])
    table = np.hstack([model.mesh.points, history.displacement[0]])
    path = tmp_path / "frame.csv"
    np.savetxt(path, table, delimiter=",", header="x,y,z,dx,dy,dz", comments="")
    values = {}
    runs = {}
    for surrogate in ('surrogate = "membrane"', ""):
        (tmp_path / "project.toml").write_text(LED.replace("SURROGATE", surrogate))
        fit = fit_setup(read_project(tmp_path / "project.toml"))
        problem = fit.problem()
        assert (problem.surrogate is not None) == bool(surrogate)
        start = problem.unknowns.at(np.array([900.0, 500.0, 70.0]))
        options = replace(fit.options, tolerance=1e-3, max_analyses=60 if surrogate else 4)
        values[surrogate] = fit_from(problem, start, options).value
        runs[surrogate] = problem.program_runs[0]
    assert runs['surrogate = "membrane"'] <= runs[""]
    assert values['surrogate = "membrane"'] < 1e-3 < 0.2 * values[""]
