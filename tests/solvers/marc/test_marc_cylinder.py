"""The cylinder on Marc: cavity, contact, load cases; forces, volume and pressure of the results."""

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.mesh import enclosed_volume
from bubblefit.solvers.marc.cylinder import (
    ABOVE,
    BELOW,
    bending_deck,
    contact_bodies,
    inflation_deck,
    may_touch,
)
from bubblefit.solvers.marc.settings import MarcSettings
from bubblefit.solvers.marc.solver import MarcSolver

from ...marc_files import sts_text, t19_text
from .test_marc_deck import conditions, read

__all__ = ["read"]

LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)
ROUNDING = 5.1e-6


@pytest.fixture(scope="module")
def model():
    return inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0, 60.0, 100.0])


@pytest.fixture(scope="module")
def grown(model):
    return model.mesh.points * [0.05, 0.05, 0.0]


def test_inflation_needs_no_contact_and_no_cavity(read, model):
    content = read(inflation_deck(model, LAW, MarcSettings()))
    assert not content.gas and not content.bodies
    names = {"fix_symmetry_x", "fix_symmetry_z", "hold", "pressure"}
    assert set(content.cases[-1].conditions) == names
    found = conditions(content)
    assert found["hold"] == ([2], [0.0], [0], "support_bottom")
    # Shells do not turn about the axes in their plane of symmetry.
    assert found["fix_symmetry_z"][0] == [3, 4, 5]
    np.testing.assert_allclose(content.tables[1].y, [0, *model.inflation])
    assert content.cases[0].increments == 100
    # Seam and caps have their own thickness.
    assert sorted(t for t, _ in content.thickness) == pytest.approx([0.81, 2.43])


def test_bending_is_a_cavity_that_is_filled_and_closed(read, model, grown):
    content = read(bending_deck(model, LAW, MarcSettings(increments=0), grown))
    guides = {"fix_symmetry_x", "fix_symmetry_z"}
    assert set(content.initial) == guides | {"hold"}
    cases = [set(case.conditions) for case in content.cases]
    assert cases == [guides | {"hold", "fill"}, guides | {"hold", "closed"}, guides | {"closed"}]
    assert [case.increments for case in content.cases] == [len(model.inflation), 1, 3]
    assert content.gas == pytest.approx([0.101, 300.0, 1.2041e-12])
    fill, closed = (content.conditions[name] for name in ("fill", "closed"))
    assert (fill.tables, fill.load, closed.tables, closed.load) == ([1], 1, [0], 2)
    assert not [c for c in content.conditions.values() if c.kind == "pressure"]
    # Paths of the bodies.
    filled, last = len(model.inflation), len(model.inflation) + 1 + 3
    load, support, collar = (content.tables[number] for number in (1, 2, 3))
    for table in (support, collar, load):
        np.testing.assert_array_equal(table.x, range(last + 1))
    assert (support.y[: filled + 1] == -BELOW).all() and (support.y[filled + 1 :] == 0).all()
    assert (collar.y[: filled + 2] == 0).all() and (load.y[filled:] == model.pressure).all()
    np.testing.assert_allclose(collar.y[filled + 2 :], [-(ABOVE + d) for d in (20, 60, 100)])
    # Patches face the fabric: the support looks up, the inside of the collar down.
    assert (content.bodies[0].name, content.bodies[0].on) == ("cylinder", "fabric")
    for body, name, number, sign in zip(
        content.bodies[1:], ("support", "collar"), (2, 3), (1, -1), strict=True
    ):
        assert (body.name, body.table, body.direction.tolist()) == (name, number, [0, 1, 0])
        p = body.patches
        normal = np.cross(p[:, 1] - p[:, 0], p[:, 3] - p[:, 0])
        level = np.abs(normal[:, 1]) > 0.9 * np.linalg.norm(normal, axis=1)
        assert level.any() and (sign * normal[level, 1] > 0).all()


def test_bodies_are_where_they_touch(model, grown):
    whole = inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0], symmetry="full")
    with pytest.raises(InputError, match="quarter"):
        bending_deck(whole, LAW, MarcSettings(), np.zeros_like(whole.mesh.points))
    touch = may_touch(model)
    assert len(touch["collar"]) and len(touch["supports"])
    assert not np.intersect1d(touch["collar"], touch["supports"]).size
    assert (model.mesh.points[touch["collar"], 2] < 133).all()
    support, collar = contact_bodies(model, grown)
    # Corners of a polygon of the circle's area are a little outside of the circle.
    crown = 1.05 * np.hypot(*model.mesh.points[:, :2].T).max()
    assert 105.0 < crown < 106.6
    points = np.reshape(support["patches"], (-1, 3))
    assert points[:, 1].max() == pytest.approx(-crown + 0.02, abs=1e-9)
    points = np.reshape(collar["patches"], (-1, 3))
    # Its mouth is rounded; corners of flat faces lie outside the ring, here by 0.034 mm.
    top = points[points[:, 2] < 60, 1].max()
    assert crown + ABOVE < top < crown + ABOVE + 0.05


def frames_of(model, grown, name="Contact Normal Force", last=3):
    """Inflated, then squeezed by the collar: forces and times as Marc would report them."""
    filled, points = len(model.inflation), model.mesh.points
    zero = np.zeros_like(points)
    frames = [(0.0, {"Displacement": zero, name: zero})]
    for i in range(filled):
        frames.append((i + 1.0, {"Displacement": grown * (i + 1) / filled, name: zero}))
    frames.append((filled + 1.0, {"Displacement": grown, name: zero}))
    touch, loads = may_touch(model), []
    for i in range(last):
        forces = zero.copy()
        forces[touch["collar"][:3], 1] = -(i + 1.0)
        forces[touch["supports"][:2], 1] = 1.5 * (i + 1.0)
        forces[touch["collar"][0], 0] = 7.0
        u = grown - 0.01 * (i + 1) * points * [1, 1, 0]
        frames.append((filled + 2.0 + i, {"Displacement": u, name: forces}))
        loads.append(4 * 3 * (i + 1.0))
    return frames, loads


@pytest.fixture
def marc(tmp_path, monkeypatch, model, grown):
    """Makes a Marc that answers inflation and bending with the frames given."""
    monkeypatch.delenv("BUBBLEFIT_MARC", raising=False)

    def make(frames, number=3004, ended=True):
        for name, given in (("inflation", frames[: len(model.inflation) + 1]), ("bending", frames)):
            folder = tmp_path / name
            folder.mkdir()
            times = [time for time, _ in given[1:]]
            whole = ended or name == "inflation"
            text = t19_text(model.mesh.points, model.mesh.quads, given, ended=whole)
            (folder / "job.t19").write_text(text)
            exit_number = number if name == "bending" else 3004
            (folder / "job.sts").write_text(sts_text(times, exit_number))
        path = tmp_path / "run_marc"
        path.write_text(
            f"#!/bin/sh\nif grep -q '^contact' job.dat; then cp {tmp_path}/bending/* .\n"
            f"else cp {tmp_path}/inflation/* .; fi\n"
        )
        path.chmod(0o755)
        return MarcSolver(marc=path, scratch=str(tmp_path / "scratch"))

    return make


@pytest.mark.parametrize("name", ["Contact Normal Force", "Reaction Force"])
def test_forces_volume_and_pressure(marc, model, grown, name):
    frames, loads = frames_of(model, grown, name)
    history = marc(frames).run(model, LAW)
    np.testing.assert_allclose(history.load, [0, *loads], rtol=ROUNDING)
    np.testing.assert_allclose(history.reactions["supports"][:, 1], [0, *loads], rtol=ROUNDING)
    assert (history.reactions["collar"][:, [0, 2]] == 0).all()
    kept = [fields["Displacement"] for time, fields in frames if time in (10.0, 12.0, 13.0, 14.0)]
    np.testing.assert_allclose(history.displacement, kept, rtol=2 * ROUNDING, atol=1e-9)
    volume = [4 * enclosed_volume(model.mesh.points + u, model.mesh.quads) for u in kept]
    np.testing.assert_allclose(history.cavity_volume, volume, rtol=1e-5)
    absolute = history.cavity_pressure + 0.101
    np.testing.assert_allclose(absolute * history.cavity_volume, 0.201 * volume[0], rtol=1e-5)
    assert history.cavity_pressure[0] == pytest.approx(0.1)
    assert any("not confirmed" in words for words in history.remarks)
    assert not any("balance" in words for words in history.remarks)


def test_forces_that_do_not_balance_are_remarked(marc, model, grown):
    frames, _ = frames_of(model, grown)
    frames[-1][1]["Contact Normal Force"][may_touch(model)["supports"]] = 0.0
    history = marc(frames).run(model, LAW)
    assert any("do not balance" in words for words in history.remarks)


def test_a_collapse_is_reported_up_to_there(marc, model, grown):
    frames, loads = frames_of(model, grown, last=2)
    history = marc(frames, 3015, ended=False).run(model, LAW)
    np.testing.assert_allclose(history.load, [0, *loads], rtol=ROUNDING)
    assert any("last increment is at 60 mm" in words for words in history.remarks)
    assert any("time step could not get smaller" in words for words in history.remarks)


@pytest.mark.parametrize("what", ["collapse", "missing", "forces"])
def test_results_that_are_not_whole_are_failures(marc, model, grown, what):
    name = "Something Else" if what == "forces" else "Contact Normal Force"
    frames, _ = frames_of(model, grown, name, last=0 if what == "collapse" else 3)
    if what == "missing":
        del frames[-2]
    number = 3015 if what == "collapse" else 3004
    said = {"collapse": "time step could not get smaller", "missing": "holds 3 of 4 frames",
            "forces": "Reaction Force"}  # fmt: skip
    with pytest.raises(SolverFailure, match=said[what]) as found:
        marc(frames, number).run(model, LAW)
    assert found.value.exit_number == number
