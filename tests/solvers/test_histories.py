"""solvers/base.py: strain and stress of a history in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble import sheet as shapes
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane.bubble import analyse, prepare
from bubblefit.solvers.membrane.loading import RunRequest
from bubblefit.solvers.membrane.wall import Wall

from ..builders.flat_bubbles import LAW, MESH, QUARTER, history_of, stretched


def test_strain_and_stress_of_an_even_stretch_in_closed_form():
    ends = [(1.01, 1.0), (1.02, 1.01), (1.05, 0.99)]
    told = history_of([stretched(*end) for end in ends])
    d = 1 - 0.25**2 * 200 / 500
    for found, found_stress, (warp, fill) in zip(
        told.strain(), told.stress(), ends[1:], strict=True
    ):
        e1, e2 = np.log([warp, fill])
        strain = np.tile([e1, e2, 0.0], (len(MESH.quads), 1))
        np.testing.assert_allclose(found, strain, atol=1e-12)
        stress = [(500 * e1 + 0.25 * 200 * e2) / d, (200 * e2 + 0.25 * 200 * e1) / d, 0.0]
        np.testing.assert_allclose(found_stress, np.tile(stress, (len(MESH.quads), 1)), atol=1e-9)
    # Without the increments the frames are taken.
    bare = history_of([stretched(by, 1.0) for by in (1.01, 1.02, 1.05)])
    bare = replace(bare, path=None)
    assert bare.strain()[0, 0, 0] == pytest.approx(np.log(1.02))
    assert bare.stress()[1, 0, 0] == pytest.approx(500 * np.log(1.05) / d)
    # A slack sheet is first unfolded.
    slack = replace(QUARTER, slack=(0.01, 0.0))
    unfolded = replace(history_of([stretched(1.0201, 1.0)] * 3), model=slack)
    np.testing.assert_allclose(unfolded.strain()[-1, :, 0], np.log(1.0201 / 1.01), atol=1e-12)


def test_stresses_of_a_history_are_those_of_the_membrane():
    off = []
    for quads in (48, 192):
        model = replace(QUARTER, mesh=disk_mesh(100.0, quads))
        membrane = prepare(model, LAW, 1e-9, Wall())
        found, _ = analyse(membrane, model, RunRequest())
        last = replace(found, model=model, law=LAW).stress()[-1]
        own = membrane.stress_old.mean(axis=1)
        off.append(np.abs(last - own).max() / np.abs(own).max())
        assert (shapes.states(last) == shapes.TAUT).all() and np.abs(own[:, :2]).min() > 1.0
    assert off[0] < 0.02 and off[1] < 0.6 * off[0]
