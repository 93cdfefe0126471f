"""Laws with a memory: closed loops, tangents, derivatives through histories, on every scale."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.law import HypoelasticLaw, law_slopes
from bubblefit.materials.memory import NAMES, QUANTITIES, Memory, own_stress
from bubblefit.materials.pieces import integral_of
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import PatchModel, bias_strip, straight_strip
from bubblefit.solvers.base import check_carries
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..support.refusals import complaint, refused

MEMORY = Memory((0.4, 0.5, 0.3), (1.6, 1.7, 1.5), (1.2, 1.1, 1.05), (3.0, 5.0, 1.0))
BETA = np.zeros(12)
BETA[[2, 3, 6, 7, 10, 11]] = 20.0, 15.0, 500.0, 200.0, -300.0, 800.0
LAW = HypoelasticLaw(BETA, 0.24, [0.1, 0.1, 0.5], memory=MEMORY)
PLAIN = replace(LAW, memory=None)
#: Parameters with their steps.
PARAMETERS = {f"beta_{i}": 1e-4 * abs(BETA[i]) for i in range(12) if BETA[i]}
PARAMETERS |= {"nu12": 1e-5, **{name: 1e-4 if "saturation" in name else 1e-5 for name in NAMES}}


def moved(name, step):
    if name.startswith("beta_"):
        beta = BETA.copy()
        beta[int(name.removeprefix("beta_"))] += step
        return LAW.with_beta(beta)
    if name == "nu12":
        return replace(LAW, nu12=LAW.nu12 + step)
    constants = list(MEMORY.constants)
    constants[NAMES.index(name)] += step
    return replace(LAW, memory=Memory.of(constants))


def differences(value):
    """Return central differences of a function of the law by every parameter."""
    return np.stack([
        (value(moved(name, step)) - value(moved(name, -step))) / (2 * step)
        for name, step in PARAMETERS.items()
    ], axis=-1)  # fmt: skip


def followed(law, path, state=None, stress=None):
    state, stress = np.zeros((1, 3)) if state is None else state, np.zeros((1, 3))
    found = []
    for strain in path:
        stress, _, state = law.follow(state, strain, stress)
        found.append(stress[0])
    return np.array(found), state


@pytest.mark.parametrize("component", [0, 1, 2], ids=["warp", "fill", "shear"])
@pytest.mark.parametrize("largest", [0.02, 0.08])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_closed_loop_in_closed_form(component, largest, sign):
    if sign < 0 and component != 2:
        sign = 1.0  # a yarn that is pressed remembers nothing, see below
    law = replace(LAW, nu12=0.0)  # else a yarn that is held is pulled, too
    kept = MEMORY.kept(component, largest)
    top = integral_of(LAW.pieces, component, 0.0, largest)
    up, back = MEMORY.unloading[component], MEMORY.reloading[component]
    whole = 0.5 * top * (largest - kept)
    for count in (1, 16):  # increments a branch, each of two for Simpson's rule
        ways = [np.linspace(a, b, 2 * count + 1) for a, b in
                ((0.0, largest), (largest, kept), (kept, largest), (largest, kept))]  # fmt: skip
        path = np.zeros((8 * count + 1, 3))
        path[:, component] = sign * np.concatenate([ways[0], *(way[1:] for way in ways[1:])])
        stress = sign * followed(law, path)[0][:, component]
        ends = 2 * count * np.arange(1, 5)
        assert stress[ends] == pytest.approx([top, 0, top, 0], rel=1e-12, abs=1e-12 * top)
        areas = []
        for end in ends[1:]:
            f = stress[end - 2 * count : end + 1]
            step = (path[end, component] - path[end - 2 * count, component]) / (2 * count)
            areas.append(sign * step / 3 * (f[:-1:2] + 4 * f[1::2] + f[2::2]).sum())
        assert areas[0] == pytest.approx(-whole * (1 - (up - 1) / 3), rel=1e-10)
        assert areas[1] == pytest.approx(whole * (1 - (back - 1) / 3), rel=1e-10)
        loss = top * (largest - kept) * (up - back) / 6
        assert areas[1] + areas[2] == pytest.approx(loss, rel=1e-10)


def test_first_loading_is_bit_by_bit_the_law_without_a_memory():
    rise = np.abs(np.random.default_rng(0).normal(size=(40, 3))) * [2e-3, 2e-3, 1e-2]
    rise[:2] = [-0.01, 0.002, 0.003], [0.011, 0.002, 0.002]
    path, old = np.cumsum(rise, axis=0), np.zeros((1, 3))
    stress, state, other = old, old, old
    for strain in path:
        stress, tangent = PLAIN.increment(old, strain, stress)
        other, also, state = LAW.follow(state, strain, other)
        old = strain[None]
        assert (other == stress).all()
        assert (also == tangent).all()


def test_the_tangent_is_that_of_differences_along_any_history():
    random, step = np.random.default_rng(1), 1e-7
    for trial in range(100):
        path = random.uniform(-0.02, 0.09, size=(6, 3)) * [1, 1, 3] - [0, 0, 0.1 * (trial % 2)]
        state, stress = np.zeros((1, 9)), np.zeros((1, 3))
        for strain in path:
            new, tangent, after = LAW.follow(state, strain, stress)
            ahead, behind = (
                np.vstack([LAW.follow(state, strain + s * e, stress)[0] for e in step * np.eye(3)])
                for s in (1, -1)
            )
            slopes = (ahead - behind).T / (2 * step)
            np.testing.assert_allclose(tangent[0], slopes, rtol=2e-5, atol=1e-3)
            state, stress = after, new


def test_reloading_ends_where_unloading_began_wherever_it_turns():
    warp = [0.06, 0.05, 0.055, 0.03, 0.04, -0.01, 0.01, 0.035, 0.06, 0.07]
    path = np.zeros((len(warp), 3))
    path[:, 0] = warp
    law = replace(LAW, nu12=0.0)
    stress, state = followed(law, path)
    first, _ = followed(law, path[[0, -1]])
    assert stress[-2] == pytest.approx(stress[0], rel=1e-12)
    assert stress[-1] == pytest.approx(first[-1], rel=1e-12)
    assert state[0, 3] == 0.07
    # Shear goes on to the largest strain of the other side.
    shear = np.zeros((3, 3))
    shear[:, 2] = 0.2, -0.2, -0.3
    stress, state = followed(LAW, shear)
    assert stress[1, 2] == pytest.approx(-stress[0, 2], rel=1e-12)
    assert state[0, 5] == -0.3
    # A yarn that was only pressed remembers nothing.
    assert followed(LAW, [[-0.02, 0, 0], [0.01, 0, 0]])[0] == pytest.approx(
        followed(PLAIN, [[-0.02, 0, 0], [0.01, 0, 0]])[0], rel=1e-14
    )


@pytest.mark.parametrize(
    ("changed", "field"),
    [({"permanent_set": (1.0, 0, 0)}, "memory.permanent_set"),
     ({"permanent_set": (0.1, 0.1)}, "memory.permanent_set"),
     ({"reloading": (1.0, 1.8, 1.0)}, "memory.unloading"),
     ({"unloading": (2.0, 1.8, 1.5)}, "memory.unloading"),
     ({"saturation": (-1.0, 0, 0)}, "memory.saturation")],
)  # fmt: skip
def test_constants_that_make_no_memory_are_named(changed, field):
    assert refused(replace, MEMORY, **changed).field == field


def strips():
    levels = (1.0, 2.5, 4.0, 2.9, 2.3, 3.0, 4.0, 5.0, 3.9, 3.0, 3.6, 4.5)
    for direction in ("warp", "fill"):
        model = straight_strip(direction, 50.0, 56.0, 0.8, across=1, along=2)
        yield replace(model, elongations=levels, unloaded=True)
    bias = bias_strip(50.0, 56.0, 0.8, across=2, along=5)
    yield replace(bias, elongations=(4.0, 8.0, 6.0, 5.0, 7.0, 9.0), unloaded=True)


@pytest.mark.parametrize("model", list(strips()), ids=["warp", "fill", "bias"])
def test_derivatives_of_a_strip_through_its_history(model):
    solver = MembraneSolver(1e-11)
    history, _ = solver.run_with_sensitivity(model, LAW, list(PARAMETERS))
    slopes = differences(lambda law: solver.run(model, law).load)
    off = np.abs(history.load_slope - slopes).max(axis=0)
    assert (off < 1e-6 * np.abs(slopes).max(axis=0) + 1e-8 * np.abs(slopes).max()).all()
    if len(model.elongations) == 12:  # the same load at the largest elongation again
        assert history.load[6] == pytest.approx(history.load[2], rel=1e-9)
        assert history.load[5] < 0.9 * solver.run(model, PLAIN).load[5]


def test_a_bubble_that_is_inflated_twice():
    levels = (0.005, 0.02, 0.05, 0.1, 0.06, 0.02, 0.06, 0.1, 0.15)
    model = BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.81, levels, levels, unloaded=True)
    solver = MembraneSolver(1e-11)
    history, found = solver.run_with_sensitivity(model, LAW, list(PARAMETERS))
    slopes = differences(lambda law: solver.run(model, law).displacement)
    off, size = (np.abs(a).max(axis=(0, 1, 2)) for a in (found - slopes, slopes))
    assert (off < 1e-5 * size + 1e-9).all()
    apex = history.displacement[:, :, 2].max(axis=1)
    # The sheet is conditioned: higher at a pressure passed before, the same at the top.
    assert apex[5] - apex[1] > 4.0
    assert apex[4] > apex[6] > apex[2] + 2.0
    assert apex[7] == pytest.approx(apex[3], abs=1e-3)
    at_points = replace(history, model=model, law=LAW).stress("points")
    assert solver.stress == pytest.approx(at_points[-1])
    rest = solver.run(model, PLAIN).displacement[:, :, 2].max(axis=1)
    assert rest[[5, 6, 7]] == pytest.approx(rest[[1, 4, 3]], rel=1e-4)


def test_a_bubble_without_unloading_is_bit_by_bit_that_of_the_law_without_a_memory():
    model = BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.81, (0.02, 0.1))
    solver = MembraneSolver()
    names = list(PARAMETERS)[:7]
    (one, first), (two, second) = (
        solver.run_with_sensitivity(model, law, names) for law in (PLAIN, LAW)
    )
    sizes = np.abs(replace(one, model=model, law=PLAIN).strain("points"))
    assert (np.diff(sizes, axis=0) >= 0).all()
    assert (one.displacement == two.displacement).all()
    assert (first == second).all()


def test_what_takes_no_memory_refuses():
    assert "memory" in complaint(check_carries, CalculixSolver(), LAW)
    check_carries(MembraneSolver(), LAW)
    with pytest.raises(SolverFailure, match="memory"):
        MembraneSolver().run(PatchModel(np.array([[1.0, 1.0]]), 0.8), LAW)


def test_patch_under_rising_loads_needs_no_memory():
    loads = np.outer(np.linspace(1.0, 8.0, 5), [1.0, 0.5])
    response, forgetful = (biaxial_response(law, loads, 0.8) for law in (LAW, PLAIN))
    assert response.reached == 5
    np.testing.assert_array_equal(response.strain, forgetful.strain)


def test_derivatives_of_a_bar():
    strain = np.array([0.02, 0.05, 0.03, 0.025, 0.04, 0.07, 0.01, 0.08])
    for pulled in (0, 1):

        def bar(law, pulled=pulled):
            slopes = law_slopes(law, list(PARAMETERS), 1.0)
            return own_stress(law.compiled, pulled, strain, slopes)

        slopes = differences(lambda law: bar(law)[0])
        np.testing.assert_allclose(bar(LAW)[1], slopes, rtol=1e-6, atol=1e-6)
    assert len(NAMES) == 3 * len(QUANTITIES)
