"""experiments/strips/__init__.py: models and settings of a strip test."""

from dataclasses import replace

import pytest
from bubblefit.solvers.membrane.solver import MembraneSolver

from .strips.cases import LAW


def test_refined_strips_have_finer_models(published_strips):
    test = published_strips().test
    own, finer, more = test.models(), test.models(factor=2.0), test.models(0.5, "increments", 2.0)
    assert list(own) == ["warp", "fill", "bias"]
    assert [len(m.mesh.quads) for m in own.values()] == [40, 40, 300]
    assert [len(m.mesh.quads) for m in finer.values()] == [160, 160, 1200]
    assert [len(m.elongations) for m in more.values()] == [10, 10, 10]
    assert [m.thickness for m in (*own.values(), *more.values())] == [0.81] * 3 + [0.5] * 3
    assert len(test.models(None, "increments", 0.01)["warp"].elongations) == 1


def test_settings_of_strips_are_those_a_result_depends_on(published_strips, tmp_path):
    def settings(*changes):
        return repr(dict(published_strips(*changes).test.settings()))

    own = settings()
    assert str(tmp_path) not in own and "curves" not in own
    for change in (
        ("width = 25.0", "width = 24.0"),
        ("[data]", "[weights]\nfill = 2\n[data]"),
        ("[data]", "[warp]\ngauge_length = 21.0\n[fill]\n[bias]\n[data]"),
        ("[data]", "[bias]\nfinal_length = 30.0\n[warp]\n[fill]\n[data]"),
        ('objective = "N"', 'objective = "relative"'),
        ("bias_angle = 45.0", "bias_angle = 44.0"),
        ("bias_angle = 45.0", "bias_angle = 45.0\nnoise = 0.7"),
    ):
        assert settings(change) != own, change


def test_strips_side_by_side_share_the_load(published_strips):
    """Twelve strips along a yarn are as one of their width; at an angle the wide one is stiffer."""
    test = published_strips(("[data]", "[warp]\n[bias]\n[data]")).test
    wide = replace(test, bias_angle=70.0, grip_distance=24.0, increments=2)
    narrow = replace(wide, width=25.0 / 12, side_by_side=12)
    loads = {}
    for name, test in (("wide", wide), ("narrow", narrow)):
        models = test.models(factor=0.4)
        loads[name] = [MembraneSolver().run(model, LAW).load[-1] for model in models.values()]
    assert loads["narrow"][0] == pytest.approx(loads["wide"][0], rel=1e-6)
    assert loads["narrow"][1] < 0.97 * loads["wide"][1]
    assert narrow.total_width == wide.total_width
    assert narrow.settings()["side_by_side"] == 12
