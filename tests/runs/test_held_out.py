"""Errors of a law at a test to which it was not fitted."""

from dataclasses import replace
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.project.project import read_project
from bubblefit.runs import held_out as held_out_module
from bubblefit.runs.simulation import FAILED
from bubblefit.runs.validation import held_out, omittable_parts
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..builders.closed_forms import LAW
from ..builders.gauges import LAW as STIFF_LAW
from ..builders.gauges import PRESSURES, THICKNESS, gauge_heights
from ..builders.projects import constant_strips, fit_setup, known_bubble


def history(warp, shear, unstable=()):
    least, most = np.array([0.0, 0.0, shear]), np.array([warp, 0.14, 0.0])
    return History(np.ones(1), np.zeros((1, 1, 3)), least, most, iterations=1, unstable=unstable)


def notes(*histories):
    names = ("one: warp", "one: fill")[: len(histories)]
    problem = SimpleNamespace(comparisons=[SimpleNamespace(name=name) for name in names])
    found = held_out_module._notes(problem, SimpleNamespace(histories=histories), LAW)
    return [note.about("one").line for note in found]


def test_notes_name_part_with_strains_beyond_law_or_unstable_equilibria():
    for histories, words in (
        ((history(0.1181, 0.0), history(0.05, -0.25, ("2 mm",))),
         ["warp: warp strain 11.8", "fill: shear strain 25 %", "fill: unstable"]),
        ((history(0.1181, 0.0, ("2 mm",)),), ["one: warp strain 11.8", "one: unstable"]),
        ((history(0.1, -0.1),), []),
    ):  # fmt: skip
        assert all(word in line for word, line in zip(words, notes(*histories), strict=True))


def test_nuisance_is_fitted_to_omitted_test(tmp_path):
    offset = ("displacement_offset = false", "displacement_offset = true")
    project = read_project(known_bubble(tmp_path, offset))
    setup = fit_setup(project)
    (prepared,) = setup.tests
    up = np.array([0.0, 0.0, 1.5])
    moved = tuple(replace(f, displacement=f.displacement + up) for f in prepared.fields)
    shifted = replace(prepared, fields=moved)
    law, solver = prepared.known, setup.make_solver
    assert held_out(prepared, law, solver).error < 1e-6
    assert held_out(shifted, law, solver).error < 1e-3
    without = replace(project.tests["bubble"], displacement_offset=False)
    found = held_out(replace(shifted, test=without), law, solver)
    assert found.error > 0.015
    assert found.rms == {"bubble": pytest.approx(1.5 / np.sqrt(3.0), rel=1e-6)}


def test_error_is_of_data_alone_without_priors():
    """A gauge that reads 1 mm too high, and is known to 0.1 mm."""
    heights = gauge_heights([[0.0, 0.0]]).T + 1.0
    keys = {"radius": 100.0, "elements": 48, "symmetry": "quarter", "noise": 0.05}
    bubble = bf.Bubble.heights(PRESSURES, heights, nuisance={"height_offset": 0.1}, **keys)
    law = bf.Law("constant", bounds={"E1": [20, 3000], "E2": [20, 3000], "G12": [1, 300]})
    setup = fit_setup(bf.Project.of(bubble, law, fabric=bf.Fabric("", THICKNESS)))
    found = held_out(setup.tests[0], STIFF_LAW, setup.make_solver)
    assert found.error == pytest.approx(found.rms["bubble"] / heights.max(), rel=1e-9)


def test_part_is_judged_with_the_shared_value_of_another_part(tmp_path):
    """A compliance fitted to the warp, far from its start, counts for the fill as if stated."""
    fitted = {"one: warp": {"compliance of one": 4e-4}}
    unknown = "compliance = 2e-4\ncompliance_prior = 1e-4\n"
    errors = []
    for keys, nuisance in (("compliance = 4e-4\n", {}), (unknown, fitted), (unknown, {})):
        test = ('name = "one"\n', f'name = "one"\n{keys}')
        whole = [(", final_length = 22.9", "")] * 2
        setup = fit_setup(constant_strips(tmp_path, test, *whole), "one")
        _, fill = omittable_parts(setup, "directions")
        found = held_out(setup.tests[0], LAW, setup.make_solver, fill.alone, nuisance)
        errors.append(found.error)
    stated, shared, at_start = errors
    assert abs(at_start - stated) > 0.02 * stated
    assert shared == pytest.approx(stated, rel=2e-3)


def test_failed_law_is_reported(project, monkeypatch):
    def tired(*_, **__):
        raise SolverFailure("too tired", "membrane")

    setup = fit_setup(project)
    monkeypatch.setattr(MembraneSolver, "run", tired)
    found = held_out(setup.tests[1], LAW, setup.make_solver)
    (note,) = found.notes
    assert found.error is None and found.rms == {}
    assert (note.kind, note.of) == (FAILED, "two") and "too tired" in note
