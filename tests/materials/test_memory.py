"""materials/memory.py: loops of unloading and reloading, through strips, bubbles and bars."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.law import law_slopes
from bubblefit.materials.memory import NAMES, QUANTITIES, Memory, own_stress
from bubblefit.materials.pieces import integral_of
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..support.refusals import refused
from .cases import MEMORY_LAW, MEMORYLESS_LAW

MEMORY = Memory((0.4, 0.5, 0.3), (1.6, 1.7, 1.5), (1.2, 1.1, 1.05), (3.0, 5.0, 1.0))
MEMORY_BETA = np.zeros(12)
MEMORY_BETA[[2, 3, 6, 7, 10, 11]] = 20.0, 15.0, 500.0, 200.0, -300.0, 800.0
#: Parameters with their steps.
PARAMETERS = {f"beta_{i}": 1e-4 * abs(MEMORY_BETA[i]) for i in range(12) if MEMORY_BETA[i]}


PARAMETERS |= {"nu12": 1e-5, **{name: 1e-4 if "saturation" in name else 1e-5 for name in NAMES}}


def law_changed_by(name, step):
    if name.startswith("beta_"):
        beta = MEMORY_BETA.copy()
        beta[int(name.removeprefix("beta_"))] += step
        return MEMORY_LAW.with_beta(beta)
    if name == "nu12":
        return replace(MEMORY_LAW, nu12=MEMORY_LAW.nu12 + step)
    constants = list(MEMORY.constants)
    constants[NAMES.index(name)] += step
    return replace(MEMORY_LAW, memory=Memory.of(constants))


def differences(value):
    """Return central differences of a function of the law by every parameter."""
    return np.stack([
        (value(law_changed_by(name, step)) - value(law_changed_by(name, -step))) / (2 * step)
        for name, step in PARAMETERS.items()
    ], axis=-1)  # fmt: skip


def stress_and_state_along(law, path, state=None, stress=None):
    state, stress = np.zeros((1, 3)) if state is None else state, np.zeros((1, 3))
    found = []
    for strain in path:
        stress, _, state = law.follow(state, strain, stress)
        found.append(stress[0])
    return np.array(found), state


@pytest.mark.parametrize("component", [0, 1, 2], ids=["warp", "fill", "shear"])
@pytest.mark.parametrize("largest", [0.02, 0.08])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_closed_loop_in_closed_form(component, largest, sign):
    if sign < 0 and component != 2:
        sign = 1.0  # a yarn that is pressed remembers nothing, see below
    law = replace(MEMORY_LAW, nu12=0.0)  # else a yarn that is held is pulled, too
    kept = MEMORY.kept(component, largest)
    top = integral_of(MEMORY_LAW.pieces, component, 0.0, largest)
    up, back = MEMORY.unloading[component], MEMORY.reloading[component]
    whole = 0.5 * top * (largest - kept)
    for count in (1, 16):  # increments a branch, each of two for Simpson's rule
        ways = [np.linspace(a, b, 2 * count + 1) for a, b in
                ((0.0, largest), (largest, kept), (kept, largest), (largest, kept))]  # fmt: skip
        path = np.zeros((8 * count + 1, 3))
        path[:, component] = sign * np.concatenate([ways[0], *(way[1:] for way in ways[1:])])
        stress = sign * stress_and_state_along(law, path)[0][:, component]
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


def test_first_loading_equals_the_law_without_memory():
    rise = np.abs(np.random.default_rng(0).normal(size=(40, 3))) * [2e-3, 2e-3, 1e-2]
    rise[:2] = [-0.01, 0.002, 0.003], [0.011, 0.002, 0.002]
    path, old = np.cumsum(rise, axis=0), np.zeros((1, 3))
    stress, state, other = old, old, old
    for strain in path:
        stress, tangent = MEMORYLESS_LAW.increment(old, strain, stress)
        other, also, state = MEMORY_LAW.follow(state, strain, other)
        old = strain[None]
        assert (other == stress).all()
        assert (also == tangent).all()


def test_tangent_against_differences_along_any_history():
    random, step = np.random.default_rng(1), 1e-7
    for trial in range(100):
        path = random.uniform(-0.02, 0.09, size=(6, 3)) * [1, 1, 3] - [0, 0, 0.1 * (trial % 2)]
        state, stress = np.zeros((1, 9)), np.zeros((1, 3))
        for strain in path:
            new, tangent, after = MEMORY_LAW.follow(state, strain, stress)
            ahead, behind = (
                np.vstack(
                    [MEMORY_LAW.follow(state, strain + s * e, stress)[0] for e in step * np.eye(3)]
                )
                for s in (1, -1)
            )
            slopes = (ahead - behind).T / (2 * step)
            np.testing.assert_allclose(tangent[0], slopes, rtol=2e-5, atol=1e-3)
            state, stress = after, new


def test_reloading_ends_where_unloading_began():
    warp = [0.06, 0.05, 0.055, 0.03, 0.04, -0.01, 0.01, 0.035, 0.06, 0.07]
    path = np.zeros((len(warp), 3))
    path[:, 0] = warp
    law = replace(MEMORY_LAW, nu12=0.0)
    stress, state = stress_and_state_along(law, path)
    first, _ = stress_and_state_along(law, path[[0, -1]])
    assert stress[-2] == pytest.approx(stress[0], rel=1e-12)
    assert stress[-1] == pytest.approx(first[-1], rel=1e-12)
    assert state[0, 3] == 0.07
    # Shear goes on to the largest strain of the other side.
    shear = np.zeros((3, 3))
    shear[:, 2] = 0.2, -0.2, -0.3
    stress, state = stress_and_state_along(MEMORY_LAW, shear)
    assert stress[1, 2] == pytest.approx(-stress[0, 2], rel=1e-12)
    assert state[0, 5] == -0.3
    # A yarn that was only pressed remembers nothing.
    assert stress_and_state_along(MEMORY_LAW, [[-0.02, 0, 0], [0.01, 0, 0]])[0] == pytest.approx(
        stress_and_state_along(MEMORYLESS_LAW, [[-0.02, 0, 0], [0.01, 0, 0]])[0], rel=1e-14
    )


@pytest.mark.parametrize(
    ("changed", "field"),
    [({"permanent_set": (1.0, 0, 0)}, "memory.permanent_set"),
     ({"permanent_set": (0.1, 0.1)}, "memory.permanent_set"),
     ({"reloading": (1.0, 1.8, 1.0)}, "memory.unloading"),
     ({"unloading": (2.0, 1.8, 1.5)}, "memory.unloading"),
     ({"saturation": (-1.0, 0, 0)}, "memory.saturation")],
)  # fmt: skip
def test_bad_constants_of_a_memory_name_their_field(changed, field):
    assert refused(replace, MEMORY, **changed).field == field


def unloaded_strips():
    levels = (1.0, 2.5, 4.0, 2.9, 2.3, 3.0, 4.0, 5.0, 3.9, 3.0, 3.6, 4.5)
    for direction in ("warp", "fill"):
        model = straight_strip(direction, 50.0, 56.0, 0.8, across=1, along=2)
        yield replace(model, elongations=levels, unloaded=True)
    bias = bias_strip(50.0, 56.0, 0.8, across=2, along=5)
    yield replace(bias, elongations=(4.0, 8.0, 6.0, 5.0, 7.0, 9.0), unloaded=True)


@pytest.mark.parametrize("model", list(unloaded_strips()), ids=["warp", "fill", "bias"])
def test_derivatives_of_a_strip_through_its_history_against_differences(model):
    solver = MembraneSolver(1e-11)
    history, _ = solver.run_with_sensitivity(model, MEMORY_LAW, list(PARAMETERS))
    slopes = differences(lambda law: solver.run(model, law).load)
    off = np.abs(history.load_slope - slopes).max(axis=0)
    assert (off < 1e-6 * np.abs(slopes).max(axis=0) + 1e-8 * np.abs(slopes).max()).all()
    if len(model.elongations) == 12:  # the same load at the largest elongation again
        assert history.load[6] == pytest.approx(history.load[2], rel=1e-9)
        assert history.load[5] < 0.9 * solver.run(model, MEMORYLESS_LAW).load[5]


def test_bubble_inflated_twice_is_conditioned_and_has_exact_derivatives():
    levels = (0.005, 0.02, 0.05, 0.1, 0.06, 0.02, 0.06, 0.1, 0.15)
    model = BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.81, levels, levels, unloaded=True)
    solver = MembraneSolver(1e-11)
    history, found = solver.run_with_sensitivity(model, MEMORY_LAW, list(PARAMETERS))
    slopes = differences(lambda law: solver.run(model, law).displacement)
    off, size = (np.abs(a).max(axis=(0, 1, 2)) for a in (found - slopes, slopes))
    assert (off < 1e-5 * size + 1e-9).all()
    apex = history.displacement[:, :, 2].max(axis=1)
    # The sheet is conditioned: higher at a pressure passed before, the same at the top.
    assert apex[5] - apex[1] > 4.0
    assert apex[4] > apex[6] > apex[2] + 2.0
    assert apex[7] == pytest.approx(apex[3], abs=1e-3)
    at_points = replace(history, model=model, law=MEMORY_LAW).stress("points")
    assert solver.stress == pytest.approx(at_points[-1])
    rest = solver.run(model, MEMORYLESS_LAW).displacement[:, :, 2].max(axis=1)
    assert rest[[5, 6, 7]] == pytest.approx(rest[[1, 4, 3]], rel=1e-4)


def test_bubble_without_unloading_equals_the_law_without_memory():
    model = BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.81, (0.02, 0.1))
    solver = MembraneSolver()
    names = list(PARAMETERS)[:7]
    (one, first), (two, second) = (
        solver.run_with_sensitivity(model, law, names) for law in (MEMORYLESS_LAW, MEMORY_LAW)
    )
    sizes = np.abs(replace(one, model=model, law=MEMORYLESS_LAW).strain("points"))
    assert (np.diff(sizes, axis=0) >= 0).all()
    assert (one.displacement == two.displacement).all()
    assert (first == second).all()


def test_derivatives_of_a_bar_through_its_history_against_differences():
    strain = np.array([0.02, 0.05, 0.03, 0.025, 0.04, 0.07, 0.01, 0.08])
    for pulled in (0, 1):

        def bar(law, pulled=pulled):
            slopes = law_slopes(law, list(PARAMETERS), 1.0)
            return own_stress(law.compiled, pulled, strain, slopes)

        slopes = differences(lambda law: bar(law)[0])
        np.testing.assert_allclose(bar(MEMORY_LAW)[1], slopes, rtol=1e-6, atol=1e-6)
    assert len(NAMES) == 3 * len(QUANTITIES)
