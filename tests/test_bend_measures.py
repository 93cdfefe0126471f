"""Numbers of a bending run on curves that are known, kept runs, the whole beam, statements."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import OutputError
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder import cylinder_mesh
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.strain import middle_strain, surface_strain
from bubblefit.meshes.volume import enclosed_volume
from bubblefit.models.bending import inflated_cylinder
from bubblefit.projects.bend import BendProject, read_bend
from bubblefit.runs.bend_folder import BendFolder
from bubblefit.runs.bend_run import BendRun, fingerprint, run_bend
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.registry import solver_named
from bubblefit.studies.bend_beam import bodies_of, whole_beam
from bubblefit.studies.bend_measures import (
    BendMeasures,
    bend_measures,
    inflation_strain,
    initial_stiffness,
    knee_point,
    limit_point,
    straightness,
    wrinkle_onset,
)
from bubblefit.studies.bend_setup import pairs_of
from bubblefit.studies.bend_statements import PRESSURES, statements
from bubblefit.studies.fingerprint import solver_words

from .bend_cases import FAILS, STOPS, Formula
from .test_bend_project import EXAMPLE

WAY = np.linspace(0.0, 240.0, 61)
NONE = np.empty(0)


def law(e1: float = 500.0) -> HypoelasticLaw:
    return HypoelasticLaw.linear(e1, 150.0, 20.0)


def model(symmetry: str = "quarter"):
    way = WAY[1:].tolist()
    return inflated_cylinder(150.0, 0.14, 0.81, 40.0, deflections=way, symmetry=symmetry)


# Numbers of a curve


def test_a_bilinear_curve() -> None:
    """4 N/mm to 100 mm, 1 N/mm from there."""
    load = np.minimum(4 * WAY, 300 + WAY)
    stiffness = initial_stiffness(WAY, load)
    assert stiffness == pytest.approx(4.0)
    # A slope over 20 mm is half of 4 where two thirds of them lie beyond the kink.
    place, force = knee_point(WAY, load, stiffness)
    assert place == pytest.approx(100 + 20 / 6, abs=0.1)
    assert force == pytest.approx(np.interp(place, WAY, load))
    assert limit_point(WAY, load) is None
    r2, off = straightness(WAY, load, force)
    assert r2 == pytest.approx(1.0) and off == pytest.approx(0.0, abs=1e-12)


def test_a_curve_with_a_limit_point() -> None:
    load = 400 * np.sin(WAY / 240 * 0.9 * np.pi)
    top = limit_point(WAY, load)
    assert top == pytest.approx((240 / 1.8, 400.0), rel=0.02)
    # The slope is that of the start times a cosine: half of it at 60 degrees.
    place, _ = knee_point(WAY, load, initial_stiffness(WAY, load))
    assert place == pytest.approx(240 / 0.9 / 3, rel=0.02)
    # A dip by less than one half percent is contact's noise.
    assert limit_point(WAY[:3], np.array([0.0, 100.0, 99.6])) is None


def test_curves_that_say_too_little() -> None:
    assert initial_stiffness(WAY[:1], NONE) is None
    assert knee_point(WAY[:5], 4 * WAY[:5], 4.0) is None
    assert knee_point(WAY, 4 * WAY, 4.0) is None
    assert straightness(WAY[:3], 4 * WAY[:3], 100.0) is None


def test_a_bent_line_is_not_straight() -> None:
    r2, off = straightness(WAY, WAY**2, 2 * 240.0**2)
    # Of x^2 on [0, 1] the best straight line misses 1/180 of 4/45 of variance, 1/6 at the ends.
    assert r2 == pytest.approx(1 - (1 / 180) / (4 / 45), abs=2e-3)
    assert off == pytest.approx(1 / 6, rel=0.05)


def test_wrinkles_begin_where_more_is_wrinkled_than_when_inflated() -> None:
    run = BendRun(1.0, deflection=WAY, load=2 * WAY, wrinkled=0.1 + 1e-3 * np.maximum(WAY - 50, 0))
    assert wrinkle_onset(run) == pytest.approx((64.0, 128.0))
    assert wrinkle_onset(replace(run, wrinkled=NONE)) is None
    assert wrinkle_onset(replace(run, wrinkled=0 * WAY + 0.1)) is None


def test_all_numbers_of_the_formula() -> None:
    m = model()
    run = run_bend(Formula(), m, MaterialCard(law(), 0.81))
    found = bend_measures(m.mesh, run, ())
    hoop = np.log1p(0.14 * 75 / 0.81 / 150)
    assert found.body_strain == pytest.approx((np.log1p(np.expm1(0.1 * hoop)), hoop))
    arm = 2000 - 145
    limit = 4 * np.pi * 0.14 * 75**3 / arm
    stiffness = 48 * 514 * np.pi * 75**3 * 0.81 / arm**3
    assert found.stiffness == pytest.approx(stiffness, rel=0.02)
    for at, load in zip((40.0, 100.0, 240.0), found.loads, strict=True):
        assert load == pytest.approx(limit * np.tanh(stiffness * at / limit))
    assert found.pressure_rise == pytest.approx(1e3 * 0.241 * 240e-5, rel=0.01)
    assert found.buckling_is == "knee" and found.reached == 240.0 and found.error is None
    assert found.wrinkles[0] == 56.0


# Strain of a curved surface


def test_strain_of_a_tube_that_grows() -> None:
    mesh = cylinder_mesh(900.0, 150.0, 25.0, 40.0)
    strain = surface_strain(mesh, mesh.points * [0.1, 0.1, 0.03])
    tube = np.setdiff1d(np.arange(len(mesh.quads)), mesh.element_sets["caps"])
    np.testing.assert_allclose(strain[tube], np.tile([*np.log([1.03, 1.1]), 0], (len(tube), 1)),
                               atol=1e-12)  # fmt: skip
    np.testing.assert_allclose(strain[mesh.element_sets["caps"], :2], np.log(1.1))


def test_strain_of_a_flat_mesh_turned_in_space() -> None:
    disk = disk_mesh(100.0, 96)
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    warp = np.array([np.cos(0.3), np.sin(0.3), 0.0])
    u = 4 * np.random.default_rng(4).standard_normal(disk.points.shape)
    turned = Mesh(
        disk.points @ turn.T, disk.quads, {}, {}, np.tile(turn @ warp, (len(disk.quads), 1))
    )
    flat = middle_strain(disk, u, warp)
    np.testing.assert_allclose(surface_strain(turned, u @ turn.T), flat, atol=1e-12)
    # Carried around as a whole it is not strained.
    moved = turned.points @ turn - turned.points + 7.0
    np.testing.assert_allclose(surface_strain(turned, moved), 0.0, atol=1e-12)
    with pytest.raises(ValueError, match="warp"):
        surface_strain(disk, u)


def test_the_body_is_apart_from_seam_and_caps() -> None:
    mesh = cylinder_mesh(900.0, 150.0, 25.0, 40.0)
    u = mesh.points * [0.1, 0.1, 0.0]
    beside = mesh.node_sets["ends"]
    u[beside] = mesh.points[beside] * [0.5, 0.5, 0.0]
    body, anywhere = inflation_strain(mesh, u)
    assert body[1] == pytest.approx(np.log(1.1))
    assert anywhere[1] > np.log(1.25)


# Kept runs


def test_a_run_is_kept_exactly(tmp_path: Path) -> None:
    m = model()
    run = run_bend(Formula(), m, MaterialCard(law(), 0.81))
    folder = BendFolder(tmp_path / "out")
    folder.begin(False, False)
    folder.keep("a" * 64, run)
    found = folder.kept("a" * 64)
    for name in vars(run):
        np.testing.assert_array_equal(getattr(found, name), getattr(run, name))
    assert folder.kept("b" * 64) is None
    with pytest.raises(OutputError, match="--resume"):
        folder.begin(False, False)
    folder.begin(True, False)
    assert folder.kept("a" * 64) is not None
    folder.begin(False, True)
    assert folder.kept("a" * 64) is None


@pytest.mark.parametrize("damage", ["cut", "text", "pickle", "other", "empty"])
def test_a_damaged_file_is_no_run(tmp_path: Path, damage: str) -> None:
    folder = BendFolder(tmp_path)
    folder.begin(False, False)
    folder.keep("a" * 64, run_bend(Formula(), model(), MaterialCard(law(), 0.81)))
    (path,) = (tmp_path / "runs").glob("*.npz")
    content = path.read_bytes()
    if damage == "cut":
        path.write_bytes(content[: len(content) // 2])
    elif damage == "text":
        path.write_text("not an archive")
    elif damage == "pickle":
        np.savez(path, words=np.array([{"seconds": 1}], dtype=object))
    elif damage == "other":
        np.savez(path, words=np.array("{}"))
    else:
        path.write_bytes(b"")
    assert folder.kept("a" * 64) is None


def test_runs_that_fail_or_stop_early(tmp_path: Path) -> None:
    failed = run_bend(Formula(), model(), MaterialCard(law(FAILS), 0.81))
    assert failed.failed == "made to fail" and not len(failed.load)
    folder = BendFolder(tmp_path)
    folder.begin(False, False)
    folder.keep("a" * 64, failed)  # it gets another chance
    assert folder.kept("a" * 64) is None
    stopped = run_bend(Formula(), model(), MaterialCard(law(STOPS), 0.81))
    assert not stopped.failed and stopped.deflection[-1] == 120.0


def test_the_fingerprint_is_of_everything_that_matters() -> None:
    m, card = model(), MaterialCard(law(), 0.81)

    def mark(m=m, card=card, solver="membrane") -> str:
        return fingerprint(m, card, solver)

    others = {
        mark(model(), MaterialCard(law(501.0), 0.81)),
        mark(card=MaterialCard(replace(law(), nu12=0.3), 0.81)),
        mark(m=replace(m, thickness=2 * m.thickness)),
        mark(m=replace(m, deflections=m.deflections[:-1], increments=())),
        mark(m=replace(m, inflation=(0.1, 0.14))),
        mark(m=replace(m, collar=replace(m.collar, fillet=3.0))),
        mark(m=replace(m, gas=replace(m.gas, ambient=0.09))),
        mark(m=model("full")),
        mark(solver="calculix"),
    }
    assert mark() not in others and len(others) == 9
    # A name changes no result.
    assert mark(card=MaterialCard(law(), 0.81, "name")) == mark(model())


def test_the_solver_s_options_are_part_of_it() -> None:
    project = read_bend(EXAMPLE)
    pair, solver = pairs_of(project)[0], solver_named("membrane")

    def mark(name: str, **options: object) -> str:
        return pair.mark(replace(project, solver=name, solver_options={name: options}), solver)

    assert mark("membrane") == mark("membrane")
    assert mark("membrane", wrinkle_stiffness=0.001) != mark("membrane")
    calculix = CalculixSolver(ccx="ccx")
    words = [solver_words(calculix, o) for o in ({}, {"threads": 2}, {"templates": "mine"})]
    assert words[0] == words[1] != words[2]


# The whole beam


def test_a_quarter_makes_the_whole_beam() -> None:
    card = MaterialCard(law(), 0.81)
    whole = run_bend(Formula(), model("full"), card)
    quarter = run_bend(Formula(), model(), card)
    beam, same = whole_beam(model(), quarter), whole_beam(model("full"), whole)
    for one, other in ((beam.bent, same.bent), (beam.inflated, same.inflated)):
        a, b = (np.round(m.mesh.points + u, 6) + 0.0 for m, u in ((beam, one), (same, other)))
        np.testing.assert_allclose(np.unique(a, axis=0), np.unique(b, axis=0), atol=1e-5)
    assert len(beam.mesh.quads) == len(same.mesh.quads)
    at = beam.mesh.points + beam.bent
    assert enclosed_volume(at, beam.mesh.quads) == pytest.approx(
        enclosed_volume(same.mesh.points + same.bent, same.mesh.quads)
    )
    for b in (beam, same):
        strain = surface_strain(b.mesh, b.inflated)
        assert strain[: len(model().mesh.quads)] == pytest.approx(
            surface_strain(model().mesh, quarter.inflated), abs=1e-12
        )


def test_bodies_touch_the_inflated_beam() -> None:
    m = model()
    run = run_bend(Formula(), m, MaterialCard(law(), 0.81))
    beam = whole_beam(m, run)
    bodies = bodies_of(m, beam, 30.0)
    at = beam.mesh.points + beam.inflated
    assert bodies.support_radius == 50.0 and bodies.collar_radius == 120.0
    for z, y in bodies.supports:
        gap = np.hypot(at[:, 2] - z, at[:, 1] - y).min() - 50.0
        assert gap == pytest.approx(0.0, abs=1e-6)
    inside = np.abs(at[:, 2]) <= 72.5
    reach = np.hypot(at[inside, 0], at[inside, 1] - bodies.collar_height - 30.0).max()
    assert reach == pytest.approx(120.0)


# Statements


def made_up(project: BendProject, buckling: float = 1.9) -> dict[tuple[str, str], BendMeasures]:
    """Measures of runs in which everything is as the thesis says."""
    found = {}
    for case in project.cases:
        rank = PRESSURES[case.diameter].index(pytest.approx(case.pressure))
        for k, card in enumerate(project.cards):
            stiffness = (8 + rank) * (1 + 0.1 * k) * (case.diameter / 150) ** 3
            limit = (180.0, (300.0, 400.0, buckling * 300.0)[rank])
            found[case.name, card] = BendMeasures(
                stiffness, (40 * stiffness, None, None), None, limit, None, (0.999, 0.01),
                (0.01, (0.06, 0.08, 0.10)[rank]), (0.0, 0.2), 1.2, 240.0, None,
            )  # fmt: skip
    return found


def test_statements_that_hold() -> None:
    project = read_bend(EXAMPLE)
    found = statements(project, made_up(project))
    assert [s.verdict for s in found[:8]] == ["holds"] * 8
    # Nothing was measured.
    assert [s.verdict for s in found[8:]] == ["not checked"] * 2


def test_statements_that_do_not_hold() -> None:
    project = read_bend(EXAMPLE)
    runs = made_up(project, buckling=1.4)
    for key, m in runs.items():
        case, card = key
        strain = (0.0, m.body_strain[1] + 0.011)
        runs[key] = replace(m, straightness=(0.98, 0.01), pressure_rise=2.0, body_strain=strain)
        if card == "uniaxial":
            runs[key] = replace(runs[key], loads=(1e4, None, None))
        if case == "200 mm, 80 kPa":
            runs[key] = replace(runs[key], stiffness=1.0)
    found = statements(project, runs)
    verdicts = [s.verdict for s in found[:8]]
    assert verdicts == [
        "does not hold", "holds in 25 of 30", "holds in 4 of 5", "does not hold",
        "holds in 25 of 30", "does not hold", "does not hold", "does not hold",
    ]  # fmt: skip
    assert any("200 mm, 80 kPa" in s.found for s in found)


def test_statements_without_runs() -> None:
    project = read_bend(EXAMPLE)
    found = statements(project, {})
    assert {s.verdict for s in found} == {"not checked"}
    assert all(s.found.startswith("needs") for s in found)
