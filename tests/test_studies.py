"""Orders and limits of manufactured sequences; what the studies make of models and failures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.cli.study_kinds import KINDS, levels
from bubblefit.errors import InputError
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip import strip_mesh
from bubblefit.models.uniaxial import bias_strip, refined_quads, straight_strip
from bubblefit.projects.bubble import read_project
from bubblefit.reports import ConvergencePanel, plot_convergence, plot_nu12
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.studies.bubble_setup import bubble_model
from bubblefit.studies.convergence import HIGHEST, convergence, observed_order, richardson
from bubblefit.studies.poisson import NU12, PUBLISHED, by_response, ratios
from bubblefit.studies.refinement import Level, edge_length, rms_between, run_level
from bubblefit.studies.setup import law_of
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
BUBBLE = EXAMPLES / "bubble-known-solution" / "project.toml"
STRIPS = EXAMPLES / "uniaxial-valmex7318" / "project.toml"
LINEAR = HypoelasticLaw.linear(600.0, 120.0, 15.0)


def manufactured(sizes, order: float, limit: float, constant: float) -> np.ndarray:
    return limit + constant * np.asarray(sizes, dtype=float) ** order


# Order and limit


@given(
    order=st.floats(0.3, 6.0),
    limit=st.floats(-50.0, 50.0),
    constant=st.sampled_from([-3.0, -0.2, 0.2, 3.0]),
    first=st.floats(1.3, 3.0),
    second=st.floats(1.3, 3.0),
)
def test_order_and_limit_of_pure_powers(
    order: float, limit: float, constant: float, first: float, second: float
) -> None:
    """Whatever the ratios of the sizes, which need not be the same twice."""
    sizes = [1.0, 1 / first, 1 / (first * second)]
    values = manufactured(sizes, order, limit, constant)
    found = observed_order(sizes, np.diff(values))
    assert found == pytest.approx(order, rel=1e-4)
    assert richardson(sizes[1:], values[1:], order) == pytest.approx(limit, abs=1e-8)


def test_the_unit_of_size_does_not_matter() -> None:
    sizes = np.array([12.75, 7.07, 3.5])
    values = manufactured(sizes, 2.0, 39.8, 1e-3)
    orders = [observed_order(scale * sizes, np.diff(values)) for scale in (1e-6, 1.0, 1e6)]
    assert orders == pytest.approx([2.0] * 3)


@pytest.mark.parametrize(
    "changes",
    [(1.0, -0.25), (-1.0, 0.25), (1.0, 1.0), (1.0, 1.2), (1.0, 0.0), (0.0, 1.0), (1.0, np.nan),
     (1.0, 2.0 ** -(HIGHEST + 1))],
)  # fmt: skip
def test_changes_without_an_order(changes: tuple[float, float]) -> None:
    assert observed_order([4.0, 2.0, 1.0], changes) is None


@pytest.mark.parametrize("sizes", [[1.0, 1.0, 0.5], [1.0, 2.0, 3.0], [1.0, 0.5, 0.0], [1.0, 0.5]])
def test_sizes_must_fall(sizes: list[float]) -> None:
    with pytest.raises(ValueError, match="decreasing"):
        observed_order(sizes, [1.0, 0.25])


def test_a_sequence_that_has_settled_needs_no_remark() -> None:
    sizes = [8.0, 4.0, 2.0, 1.0]
    found = convergence(sizes, manufactured(sizes, 2.0, 40.0, 0.01).tolist())
    assert (found.order, found.previous, found.limit) == pytest.approx((2.0, 2.0, 40.0))
    assert found.remark == ""
    assert found.error(40.4) == pytest.approx(0.01)


def test_a_second_term_makes_the_order_move_and_is_said() -> None:
    h = np.array([8.0, 4.0, 2.0, 1.0])
    values = 40.0 + 0.01 * h**2 + 0.02 * h**4
    found = convergence(h.tolist(), values.tolist())
    assert found.order is not None and found.previous is not None
    assert found.previous > found.order > 2.5
    fine = 0.01 * h
    settled = convergence(fine.tolist(), (40.0 + 0.01 * fine**2 + 0.02 * fine**4).tolist())
    assert settled.order == pytest.approx(2.0, abs=0.01)
    assert settled.remark == ""
    moving = convergence(h.tolist(), (40.0 + 0.3 * h + 0.02 * h**4).tolist())
    assert "still moves" in moving.remark


@pytest.mark.parametrize(
    "values, words",
    [
        ([1.0, 0.5], "three levels"),
        ([1.0], "three levels"),
        ([1.0, 0.5, 0.375], "one order only"),
        ([9.0, 1.0, 0.5, 0.75], "up and down"),
        ([9.0, 1.0, 0.5, 0.0], "do not get smaller"),
        ([9.0, 1.0, 0.5, 0.5 + 1e-9], "accuracy of the solver"),
        ([1.0, 1.5, 1.25, 1.125], "one order only"),
        ([3.0, 2.0, 1.0, 1.0 - 1e-6], "no power"),
        ([0.0, 1.0, 1.9], "no limit: refine further"),
    ],
)
def test_limits_of_the_extrapolation_are_said(values: list[float], words: str) -> None:
    sizes = [2.0**-k for k in range(len(values))]
    found = convergence(sizes, values, noise=1e-8)
    assert words in found.remark
    assert (found.limit is None) == (found.order is None)
    assert (found.error(1.0) is None) == (found.limit is None)


def test_curves_are_compared_where_the_coarse_one_has_points() -> None:
    coarse = np.array([1.0, 2.0]), np.array([2.0, 4.0])
    fine = np.array([0.5, 1.0, 1.5, 2.0]), np.array([9.0, 2.5, 9.0, 4.5])
    assert rms_between(coarse, fine) == pytest.approx(0.5)
    # The origin is part of a curve.
    assert rms_between((np.array([0.5]), np.array([1.0])), coarse) == pytest.approx(0.0, abs=1e-15)


# Refinements


def test_edge_length() -> None:
    assert edge_length(strip_mesh(20.0, 40.0, 4, 8)) == pytest.approx(5.0)
    disk = disk_mesh(100.0, 800, "quarter")
    assert edge_length(disk) ** 2 * len(disk.quads) == pytest.approx(0.25e4 * np.pi, rel=2e-3)


def test_the_thesis_strips_and_their_refinements() -> None:
    for strip, make in (("straight", lambda **q: straight_strip("warp", 20.0, 22.0, 0.8, **q)),
                        ("bias", lambda **q: bias_strip(20.0, 24.0, 0.8, **q))):  # fmt: skip
        plain, same = make(), make(**refined_quads(strip, 1.0))
        assert len(plain.mesh.quads) == len(same.mesh.quads)
        assert len(make(**refined_quads(strip, 2.0)).mesh.quads) == 4 * len(plain.mesh.quads)
        for factor in (1 / 16, 1 / 4, 1 / 2, 3.0):
            assert len(make(**refined_quads(strip, factor)).mesh.quads)


def test_levels_of_a_bubble() -> None:
    kind, project = KINDS["bubble"], read_project(BUBBLE)
    finer = levels(kind, project, "elements", 2.0, 0.5)["bubble"]
    assert len(finer.model.mesh.quads) == 800  # a quarter of 3200
    assert finer.model.thickness == 0.5
    steps = levels(kind, project, "increments", 3.0, 0.81)["bubble"]
    assert steps.increments == 27
    assert steps.size == pytest.approx(1 / 27)
    assert np.isin(np.round(project.increments, 12), np.round(steps.model.increments, 12)).all()
    assert steps.model.increments[:3] == pytest.approx([0.002, 0.004, 0.006])
    assert steps.model.pressures == project.pressures


def test_levels_of_strips() -> None:
    kind = KINDS["uniaxial"]
    project = kind.read(STRIPS, None)
    own, finer = (levels(kind, project, "elements", f, 0.81) for f in (1.0, 2.0))
    assert [len(own[d].model.mesh.quads) for d in own] == [40, 40, 300]
    assert finer["bias"].size == pytest.approx(own["bias"].size / 2)
    steps = levels(kind, project, "increments", 0.5, 0.81)
    assert {level.increments for level in steps.values()} == {50}


def test_steps_between_the_pressures_are_not_joined() -> None:
    with pytest.raises(InputError, match="--coarser 0"):
        levels(KINDS["bubble"], read_project(BUBBLE), "increments", 0.5, 0.81)


def test_a_level_that_fails_has_a_reason_and_no_values() -> None:
    model = straight_strip("warp", 20.0, 22.0, 0.8, increments=2)
    falling = HypoelasticLaw(np.array([0, 0, 0, 15.0] * 2 + [0, 0, -1e5, 100.0]))
    run = run_level(
        MembraneSolver(), Level(1.0, model, 2, 1.0), falling, lambda m, h: {"x": h.load[-1]}
    )
    assert run.values is None
    assert run.failure
    good = run_level(
        MembraneSolver(), Level(1.0, model, 2, 1.0), LINEAR, lambda m, h: {"x": h.load[-1]}
    )
    assert good.values is not None and good.failure == "" and good.iterations > 0


def test_increments_of_a_bubble_converge_with_second_order() -> None:
    """The midpoint rule's own order, seen through the study's tools."""
    kind, project = KINDS["bubble"], read_project(BUBBLE)
    law = law_of(project).with_beta(project.data.beta)
    runs = [
        run_level(MembraneSolver(), levels(kind, project, "increments", f, 0.81)["bubble"], law,
                  kind.quantities)
        for f in (1.0, 2.0, 4.0)
    ]  # fmt: skip
    name = "apex at 300 kPa, mm"
    found = convergence([r.level.size for r in runs], [r.values[name] for r in runs])
    assert found.order == pytest.approx(2.0, abs=0.05)
    # DESIGN.md section 3: few increments are within 0.2 % of converged.
    assert 0 < found.error(runs[0].values[name]) < 2e-3


# Poisson's ratio


def test_ratios_leave_out_what_failed() -> None:
    found = ratios([0.1, 0.2, 0.3], [2.0, np.nan, 4.0], 2.5)
    assert found.to_base == pytest.approx([0.8, np.nan, 1.6], nan_ok=True)
    assert found.to_mean == pytest.approx([2 / 3, np.nan, 4 / 3], nan_ok=True)
    assert found.spread == pytest.approx((-0.2, 0.6))
    assert np.isnan(ratios([0.1], [np.nan], 1.0).spread).all()
    named = by_response([0.1, 0.2], [{"a": 1.0}, None], {"a": 2.0})
    assert named["a"].to_base == pytest.approx([0.5, np.nan], nan_ok=True)


def test_figure_4_2() -> None:
    """Largest displacement of the known solution at 300 kPa, relative to the mean of five nu12.

    Published: 1.029 to 0.967. With pressure that follows the surface ours are 1.036 to 0.960, at
    most 0.0073 off; with dead pressure, as the published profiles show Marc's to be, they are
    within 0.0004 (docs/studies.md). The published numbers carry three decimals.
    """
    project = read_project(BUBBLE)
    law, model = law_of(project).with_beta(project.data.beta), bubble_model(project)
    solver, kind = MembraneSolver(), KINDS["bubble"]

    def respond(nu12: float) -> dict[str, float]:
        changed = HypoelasticLaw(law.beta, nu12, law.strain_range, law.thickness_change)
        return kind.responses(model, solver.run(model, changed))

    found = by_response(NU12, [respond(v) for v in NU12], respond(0.24))["300 kPa"]
    off = found.to_mean - np.array(PUBLISHED)
    assert np.abs(off).max() < 0.0075
    # Same curve, steeper: falling, nearly straight, and by the same factor at both ends.
    assert (np.diff(found.to_mean) < 0).all()
    slope = np.polyfit(np.array(PUBLISHED) - 1, found.to_mean - 1, 1)[0]
    assert slope == pytest.approx(1.24, abs=0.03)
    assert found.to_mean - 1 == pytest.approx(slope * (np.array(PUBLISHED) - 1), abs=1e-3)


def test_nu12_of_a_straight_strip_in_closed_form() -> None:
    """Constant thickness: the width follows nu12, so the load falls with exp(-nu12 eps)."""
    model = straight_strip("warp", 20.0, 22.0, 0.8, increments=20)

    def load(nu12: float) -> float:
        law = HypoelasticLaw.linear(600.0, 120.0, 15.0, nu12=nu12)
        return float(MembraneSolver().run(model, law).load[-1])

    found = ratios([0.0, 0.4], [load(0.0), load(0.4)], load(0.24))
    eps = np.log(1.1)
    assert found.to_base == pytest.approx(np.exp(-(found.nu12 - 0.24) * eps), rel=1e-6)


# Figures


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    figures: list[Figure] = []
    write = Figure.savefig

    def keep(self: Figure, *args, **kwargs) -> None:
        write(self, *args, **kwargs)
        figures.append(self)

    monkeypatch.setattr(Figure, "savefig", keep)
    return figures


def test_convergence_figure(tmp_path: Path, drawn: list[Figure]) -> None:
    changes = {"apex at 22 kPa, mm": [1.0, 0.25], "in-plane, mm": [0.5, 1e-9]}
    one = ConvergencePanel("bubble", [4.0, 2.0, 1.0], changes, [10, 40, 160], [0.1, 0.3, 1.0])
    still = ConvergencePanel("warp", [2.0, 1.0], {"in-plane, mm": [0.0]}, [10, 40], [0.1, 0.3])
    plot_convergence(tmp_path / "c.png", [one, still], "elements")
    bubble, warp, cost = drawn[0].axes
    assert bubble.get_xscale() == bubble.get_yscale() == "log"
    by_length = [line.get_data() for line in bubble.lines]
    assert by_length[0][0].tolist() == [4.0, 2.0] and by_length[0][1].tolist() == [1.0, 0.25]
    assert by_length[1][1].tolist() == [0.5]  # what the tolerance hides is not drawn
    for line, order in zip(by_length[2:], (1, 2), strict=True):
        assert np.log2(line[1][0] / line[1][1]) == pytest.approx(order)
    assert [t.get_text() for t in warp.texts] == ["no change above 1e-05 %"]
    assert len(cost.lines) == 2
    with pytest.raises(ValueError, match="no models"):
        plot_convergence(tmp_path / "none.png", [], "elements")


def test_nu12_figure(tmp_path: Path, drawn: list[Figure]) -> None:
    lines = {f"{p} kPa": ([0.05, 0.24, 0.45], [1.03, 1.0, np.nan]) for p in (22, 300)}
    plot_nu12(tmp_path / "n.png", {"bubble": lines}, 0.24, "largest displacement", 0.03)
    axes = drawn[0].axes[0]
    assert "nu12 = 0.24" in axes.get_ylabel()
    assert [len(line.get_xdata()) for line in axes.lines] == [2, 3, 3, 1]
    words = [text.get_text() for text in drawn[0].legends[0].get_texts()]
    assert words == ["22 kPa", "300 kPa", "within 3 % (thesis)"]
    with pytest.raises(ValueError, match="no models"):
        plot_nu12(tmp_path / "none.png", {}, 0.24, "load")


def test_a_level_survives_no_defect() -> None:
    class Broken:
        name, external = "broken", False

        def run(self, model, law):
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run_level(Broken(), Level(1.0, None, 1, 1.0), LINEAR, lambda m, h: {})
