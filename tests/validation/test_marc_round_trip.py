"""Validation: through deck, stand-in and .t19 come the results of the membrane, to six digits."""

import json
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..builders.fortran import BETA, LAWS
from ..builders.marc_runs import marc
from ..support.commands import in_process as bubblefit
from ..support.commands import result_in
from ..support.paths import EXAMPLES
from ..support.refusals import raised

__all__ = ["marc"]
#: Half a unit in the last of six digits.
ROUNDING = 5.1e-6
LAW = HypoelasticLaw(BETA, strain_range=np.full(3, 0.13))
PRESSURES = (0.006, 0.022, 0.059, 0.097)


def round_trip_bubble(pressures=PRESSURES, increments=()):
    return BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.81, pressures, increments)


def assert_equal_to_six_digits(found, expected, reactions=True):
    u = expected.displacement
    # Small components are those of large ones minus others, at the solver's own tolerance.
    np.testing.assert_allclose(found.displacement, u, rtol=ROUNDING, atol=1e-9)
    np.testing.assert_allclose(found.load, expected.load, rtol=2 * ROUNDING)
    for name in expected.reactions if reactions else ():
        largest = np.abs(expected.reactions[name]).max()
        difference = np.abs(found.reactions[name] - expected.reactions[name]).max()
        assert difference <= 2 * ROUNDING * max(largest, np.abs(expected.load).max()), name


@pytest.mark.parametrize(
    ("law", "settings"),
    [
        (LAW, {}),
        (LAW, {"law": "hypela2", "element": 18, "options": "older", "threads": 2}),
        (LAWS["tri-linear"], {}),
        (LAWS["incompressible"], {"law": "hypela2", "element": 75}),
        (LAWS["spline"], {}),
        (LAWS["spline"], {"law": "hypela2"}),
    ],
    ids=["nlelast", "hypela2", "tri-linear", "incompressible", "spline", "spline hypela2"],
)
def test_bubble_through_deck_and_t19_is_the_membrane(marc, law, settings):
    assert_equal_to_six_digits(
        marc.solver(**settings).run(round_trip_bubble(), law),
        MembraneSolver().run(round_trip_bubble(), law),
    )
    assert marc.runs == ["job none"]


def test_increments_cut_by_marc_do_not_change_a_bubble(marc):
    found = marc.solver(increments=12).run(round_trip_bubble(), LAW)
    ends = np.array([0.0, *PRESSURES])
    finer = np.concatenate([a + (b - a) * np.arange(1, 4) / 3 for a, b in pairwise(ends)])
    expected = MembraneSolver().run(round_trip_bubble(PRESSURES, finer), LAW)
    assert_equal_to_six_digits(found, expected)
    # Mean moduli make little of the increments; still thirty times what `same` lets pass.
    coarse = MembraneSolver().run(round_trip_bubble(), LAW)
    assert np.abs(coarse.displacement - expected.displacement).max() > 1e-4


@pytest.mark.parametrize(
    ("model", "settings"),
    [
        (straight_strip("warp", 50, 58, 0.81, increments=10), {"law": "hypela2"}),
        (straight_strip("fill", 50, 62, 0.81, increments=10), {}),
        # Grips beyond the gauge: pulled as far as the membrane says.
        (bias_strip(25, 30, 0.81, increments=8, across=4, along=12), {}),
        (bias_strip(25, 30, 0.81, increments=8, across=4, along=12), {"law": "hypela2"}),
    ],
    ids=["warp", "fill", "bias", "bias hypela2"],
)
def test_strip_through_deck_and_t19_is_the_membrane(marc, model, settings):
    found = marc.solver(**settings).run(model, LAW)
    # The bias strip is interpolated to the model's elongations, see docs/reference/marc-deck.md.
    expected = MembraneSolver().run(model, LAW)
    u = expected.displacement
    np.testing.assert_allclose(found.displacement, u, rtol=2 * ROUNDING, atol=1e-6)
    np.testing.assert_allclose(found.load, expected.load, rtol=2 * ROUNDING)


def test_bent_cylinder_through_deck_and_t19_is_the_membrane(marc):
    model = inflated_cylinder(150.0, 0.14, 0.81, 60.0, deflections=(1.0, 2.5, 5.0))
    # The stand-in's membrane carries compression.
    expected = MembraneSolver(wall="stiff").run(model, LAW)
    found = marc.solver().run(model, LAW)
    assert len(marc.runs) == 2  # inflation alone, and bending
    np.testing.assert_allclose(
        found.displacement[0], expected.displacement[0], rtol=ROUNDING, atol=1e-8
    )
    # Where the collar touches is known from the first job, to six digits of some 25 mm.
    place = ROUNDING * 25.0
    np.testing.assert_allclose(found.displacement, expected.displacement, rtol=ROUNDING, atol=place)
    steep = np.diff(expected.load, prepend=0.0)[1:] / np.diff([0.0, *model.deflections])
    assert (np.abs(found.load - expected.load)[1:] < place * steep + 1e-5 * expected.load[1:]).all()
    np.testing.assert_allclose(found.cavity_pressure, expected.cavity_pressure, rtol=2 * ROUNDING)
    np.testing.assert_allclose(found.cavity_volume, expected.cavity_volume, rtol=2 * ROUNDING)


def test_cylinder_that_stops_early_keeps_its_frames(marc):
    model = inflated_cylinder(150.0, 0.14, 0.81, 75.0, deflections=(1.0, 2.0, 3.0, 4.0))
    marc.told("3015@2")
    found = marc.solver().run(model, LAW)
    assert len(found.load) == 3  # inflated, 1 and 2 mm
    assert any("time step could not get smaller" in remark for remark in found.remarks)
    assert found.early.startswith("the run stopped early; the last increment is at 2 mm")
    assert "time step could not get smaller" in found.early
    # What another end wrote before it was spoiled is not reported.
    for run, fault in ((4, "killed"), (6, "truncated")):
        marc.told(f"{fault}@{run}")
        failed = raised(SolverFailure, "", marc.solver().run, model, LAW)
        assert len(marc.runs) == run and failed.scratch.is_dir()


SITE = 'executable = "./run_marc"\nincrements = 0\n'


def marc_rows(folder):
    history = pd.read_csv(folder / "history.csv", comment="#")
    return history[history.solver == "marc"]


@pytest.fixture
def site(marc):
    path = marc.folder / "site.toml"
    path.write_text(SITE + f'scratch = "{marc.folder}"\n')
    return path


@pytest.mark.slow
def test_known_solution_is_found_in_four_runs_of_marc(marc, tmp_path):
    text = (EXAMPLES / "bubble-known-solution/project.toml").read_text()
    for old, new in (("elements = 800 ", "elements = 48 "), ("starts = 50", "starts = 1")):
        assert old in text
        text = text.replace(old, new, 1)
    (tmp_path / "project.toml").write_text(text)
    bubblefit("bubble", "project.toml", "--solver", "marc", "--marc", marc.program, "--jobs", 1,
              "--quiet", "--out", "out", cwd=tmp_path)  # fmt: skip
    e = marc_rows(tmp_path / "out").objective.to_numpy()
    # 1.6e-4, 7.5e-6, 5.6e-6, 5.2e-6: measured.
    assert e[0] < 1e-3 and len(e) <= 5
    assert e[1] < 3e-5, "six digits spoil it"
    result = result_in(tmp_path / "out")
    assert result["solver"] == "marc" and result["external_runs"] == len(e)


def test_doctor_accepts_the_stand_in(marc, site, tmp_path):
    done = bubblefit("doctor", "--marc", site, "--json", cwd=tmp_path)
    (found,) = [s for s in json.loads(done.stdout)["solvers"] if s["name"] == "marc"]
    assert found["usable"] and found["difference"] < 1e-4 and len(marc.runs) == 4
