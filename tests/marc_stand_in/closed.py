"""The inflated cylinder of a deck, and its bending between the deck's bodies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from bubblefit.meshes.cylinder_model import Bending, Gas, InflatedModel, RigidCylinder
from bubblefit.solvers.membrane.bending import BITE
from bubblefit.solvers.membrane.closed import brought_to_touch
from numpy.typing import NDArray

from .bodies import collar_of, first_touch, support_of
from .content import Body, Content
from .fields import DeckError
from .schedule import Schedule, pressures
from .supports import held, supported

Array = NDArray[np.float64]
#: mm that a support may be away from where it touches the inflated membrane.
NEAR = 0.2


def closed_model(
    content: Content, schedule: Schedule, inflate: Callable[[InflatedModel], Array]
) -> tuple[InflatedModel, NDArray[np.bool_]]:
    """The model, and in which increments (increments,) nothing moves.

    Parameters
    ----------
    inflate : displacement (n, 3) of a model at its last pressure: where the bodies are relative to
        the membrane is known then.
    """
    thickness, warp = _sections(content)
    rests = np.zeros(len(schedule.times), dtype=bool)
    mesh, supports = supported(content, held(content, schedule.first))
    levels = pressures(content, schedule)
    if content.gas is None:
        return InflatedModel(mesh, thickness, warp, levels, supports), rests
    _as_expected(content)
    slack = InflatedModel(mesh, thickness, warp, levels, supports)
    position = mesh.points + inflate(slack)
    posts, ring, moves = _bodies(content, schedule, position)
    rests = np.concatenate([np.zeros(len(levels), dtype=bool), moves <= 0])
    both = held(content, schedule.last)
    early = held(content, schedule.first)
    released = [node for node, dofs in early.items() if dofs != both.get(node, ())]
    ways = {tuple(set(early[node]) - set(both.get(node, ()))) for node in released}
    if len(ways) != 1:
        raise DeckError("stand-in: what is let go after inflation is held in one way")
    mesh, supports = supported(content, both, released=np.array(released))
    bending = Bending(
        posts, ring, moves[moves > 0].tolist(), released="released",
        gas=Gas(content.gas[0], content.gas[1], content.gas[2] * 1e12),
    )  # fmt: skip
    supports = {**supports, "released": ways.pop()}
    return InflatedModel(mesh, thickness, warp, levels, supports, 1, bending), rests


def _as_expected(content: Content) -> None:
    """Three load cases with what each has to hold."""
    kinds = []
    for case in content.cases:
        conditions = [content.conditions[name] for name in case.conditions]
        kinds.append([c.kind_number for c in conditions if c.kind == "cavity"])
    if kinds != [[1], [2], [2]]:
        raise DeckError("stand-in: inflation by pressure, approach and bending at constant mass")
    if [body.rigid for body in content.bodies] != [False, True, True]:
        raise DeckError("stand-in: bodies are the membrane, a support and a collar")


def _bodies(
    content: Content, schedule: Schedule, position: Array
) -> tuple[list[RigidCylinder], RigidCylinder, Array]:
    """Support, collar, and mm that the collar has gone down from touching, after inflation."""
    support, collar = content.bodies[1:]
    post, ring = support_of(support), collar_of(collar)
    later = schedule.times[schedule.case > 0]
    begins = float(schedule.times[schedule.case == 0][-1])
    if _path(content, support, begins)[1] > -1.0:
        raise DeckError("the support is at the membrane before this is inflated")
    bending = later[np.count_nonzero(schedule.case == 1) - 1 :]
    if np.ptp([_path(content, support, t)[1] for t in bending]) > 1e-9:
        raise DeckError("stand-in: the support is at rest on bending")
    up = np.array([0.0, 1.0, 0.0])
    touching = brought_to_touch(post, position, up, BITE)
    away = touching.centre[1] - post.centre[1] - _path(content, support, float(later[-1]))[1]
    if abs(away) > NEAR:
        raise DeckError(f"stand-in: the support is {away:.3g} mm below where it touches")
    # Marc has flat patches, chords of the ring: its collar touches when one of them does. From
    # there on the ring is round.
    free = first_touch(collar, position)
    if free < 0:
        raise DeckError(f"the collar begins {-free:.3g} mm inside the inflated membrane")
    moves = np.array([-_path(content, collar, float(t))[1] - free for t in later])
    return [post], ring, moves


def _path(content: Content, body: Body, time: float) -> Array:
    assert body.direction is not None
    way = content.tables[body.table].at(time) * body.direction
    if np.abs(way[[0, 2]]).max() > 1e-9:
        raise DeckError(f"stand-in: body {body.name} moves along y only")
    return way


def _sections(content: Content) -> tuple[Array, Array]:
    """(elements,) thickness and (elements, 3) warp."""
    count = content.parameters.elements
    thickness, warp = np.zeros(count), np.zeros((count, 3))
    for value, name in content.thickness:
        thickness[content.element_sets[name] - 1] = value
    for name, along, _ in content.frames:
        warp[content.element_sets[name] - 1] = along
    return thickness, warp
