"""Build models of the membrane solver from decks: flat sheets, strips, bent cylinders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import Bending, Gas, InflatedModel, RigidCylinder
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.strip_models import UniaxialModel
from bubblefit.solvers.membrane.bending import BITE
from bubblefit.solvers.membrane.closed import brought_to_touch
from bubblefit.solvers.membrane.solver import MembraneSolver
from numpy.typing import NDArray

from .deck import Array, Body, Content, DeckError

#: mm that a corner of a patch may be away from the circle through all of them.
ROUND = 1e-6
#: mm that a support may be away from where it touches the inflated membrane.
NEAR = 0.2


@dataclass
class Schedule:
    """The increments: times (n,) at their ends; case (n,) from 0; steps (n,)."""

    times: NDArray[np.float64]
    case: NDArray[np.int64]
    steps: NDArray[np.float64]
    first: list[str]
    last: list[str]


def schedule_of(content: Content) -> Schedule:
    """Return the increments; DeckError where a table ends before them."""
    counts = [case.increments for case in content.cases]
    case = np.repeat(np.arange(len(counts)), counts)
    steps = np.array([content.cases[i].step for i in case])
    times = np.cumsum(steps)
    # A third, added up, is no whole number.
    times = np.where(np.abs(times - np.round(times)) < 1e-6, np.round(times), times)
    for table in content.tables.values():
        if table.variable == 1 and (table.x[0] != 0.0 or abs(table.x[-1] - times[-1]) > 1e-6):
            problem = f"table {table.number} goes from {table.x[0]:g} to {table.x[-1]:g}"
            raise DeckError(f"{problem}, the load cases from 0 to {times[-1]:g}")
    return Schedule(times, case, steps, content.cases[0].conditions, content.cases[-1].conditions)


def pressures(content: Content, schedule: Schedule, cases: int = 1) -> list[float]:
    """Return the MPa that inflates, at the increments of the first `cases` load cases."""
    loads = [content.conditions[name] for name in schedule.first]
    loads = [c for c in loads if c.kind != "fixed"]
    if len(loads) != 1 or loads[0].tables == [0]:
        raise DeckError("stand-in: one pressure with a table is what inflates")
    load = loads[0]
    if load.kind == "pressure" and (load.kind_number, load.values) != (2, [-1.0]):
        raise DeckError("stand-in: load type 2 of magnitude -1 inflates")
    if load.kind == "cavity" and load.kind_number != 1:
        raise DeckError("stand-in: a cavity is inflated by a pressure")
    table = content.tables[load.tables[0]]
    return [table.at(time) for time in schedule.times[schedule.case < cases]]


def held(content: Content, names: list[str]) -> dict[int, tuple[int, ...]]:
    """Return by node (from 0) the translations (0 to 2) that these conditions hold at zero."""
    found: dict[int, set[int]] = {}
    for name in names:
        c = content.conditions[name]
        if c.kind != "fixed":
            continue
        for dof, value in zip(c.dofs, c.values, strict=True):
            if dof <= 3 and value == 0.0:
                for node in (content.node_sets[c.on] - 1).tolist():
                    found.setdefault(node, set()).add(dof - 1)
    return {node: tuple(sorted(dofs)) for node, dofs in sorted(found.items())}


def supported(
    content: Content, nodes: dict[int, tuple[int, ...]], **sets: Any
) -> tuple[Mesh, dict[str, tuple[int, ...]]]:
    """Return the mesh, with a node set for each way of being held, and what each holds."""
    ways: dict[tuple[int, ...], list[int]] = {}
    for node, dofs in nodes.items():
        ways.setdefault(dofs, []).append(node)
    names = {f"held_{''.join(map(str, dofs))}": dofs for dofs in ways}
    groups = {f"held_{''.join(map(str, dofs))}": np.array(on) for dofs, on in ways.items()}
    quads = (content.connectivity - 1).astype(np.intp)
    return Mesh(content.coordinates, quads, {**groups, **sets}), names


def model_of(
    content: Content, schedule: Schedule, law: HypoelasticLaw
) -> tuple[Any, NDArray[np.bool_]]:
    """Return the model, and in which increments (n,) of the deck nothing moves.

    DeckError: Marc would run this, the stand-in cannot.
    """
    if content.gas is not None or np.ptp(content.coordinates[:, 2]) > 1e-9:
        return _closed_model(content, schedule, law)
    rests = np.zeros(len(schedule.times), dtype=bool)
    if len(content.thickness) != 1 or len(content.frames) != 1:
        raise DeckError("stand-in: a flat sheet of one thickness and one frame only")
    thickness, warp = content.thickness[0][0], content.frames[0][1]
    if all(c.kind != "pressure" for c in content.conditions.values()):
        return _strip(content, schedule, thickness, warp), rests
    if np.abs(warp - [1.0, 0.0, 0.0]).max() > 1e-9:
        raise DeckError("stand-in: the warp of a bubble has to be x")
    mesh, supports = supported(content, held(content, schedule.first))
    levels = pressures(content, schedule)
    return BubbleModel(mesh, thickness, levels, supports=supports), rests


def _strip(content: Content, schedule: Schedule, thickness: float, warp: Array) -> UniaxialModel:
    """Return the strip; its gauge is a line along the pull, from a pulled node to a held one."""
    conditions = [content.conditions[name] for name in schedule.first]
    moved = [c for c in conditions if any(c.values)]
    if len(moved) != 1 or moved[0].dofs != [2] or moved[0].values != [-1.0]:
        raise DeckError("stand-in: a strip is pulled along -y by one condition")
    table = content.tables[moved[0].tables[0]]
    pulled = content.node_sets[moved[0].on] - 1
    nodes = held(content, [c.name for c in conditions if c is not moved[0]])
    p = content.coordinates
    for lower in pulled.tolist():
        for upper, dofs in nodes.items():
            same = abs(p[upper, 0] - p[lower, 0]) < 1e-9 and p[upper, 1] > p[lower, 1]
            if same and 1 in dofs and 0 in nodes.get(lower, ()) and 0 in dofs:
                gauge = np.array([lower, upper])
                mesh, supports = supported(content, nodes, gauge=gauge, pulled=pulled)
                pulls = [table.at(time) for time in schedule.times]
                return UniaxialModel(mesh, warp, thickness, pulls, supports, "pulled")
    raise DeckError("stand-in: no pulled node with a held one above it")


def _closed_model(
    content: Content, schedule: Schedule, law: HypoelasticLaw
) -> tuple[InflatedModel, NDArray[np.bool_]]:
    """Return the inflated cylinder of a deck, or its bending between the deck's bodies."""
    thickness, warp = _sections(content)
    rests = np.zeros(len(schedule.times), dtype=bool)
    mesh, supports = supported(content, held(content, schedule.first))
    levels = pressures(content, schedule)
    if content.gas is None:
        return InflatedModel(mesh, thickness, warp, levels, supports), rests
    _as_expected(content)
    slack = InflatedModel(mesh, thickness, warp, levels, supports)
    position = mesh.points + MembraneSolver().run(slack, law).displacement[-1]
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
    """Raise DeckError unless there are three load cases with what each has to hold."""
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
    """Return support, collar, and mm of the collar below touching, after inflation."""
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
    way = content.tables[body.table].at(time) * body.direction
    if np.abs(way[[0, 2]]).max() > 1e-9:
        raise DeckError(f"stand-in: body {body.name} moves along y only")
    return way


def _sections(content: Content) -> tuple[Array, Array]:
    """Return thickness (elements,) and warp (elements, 3)."""
    count = content.parameters.elements
    thickness, warp = np.zeros(count), np.zeros((count, 3))
    for value, name in content.thickness:
        thickness[content.element_sets[name] - 1] = value
    for name, along, _ in content.frames:
        warp[content.element_sets[name] - 1] = along
    return thickness, warp


def support_of(body: Body) -> RigidCylinder:
    """Return a post along x: all corners on one circle, patches facing away from its axis."""
    corners = _corners(body)
    centre, radius = _circle(corners[:, 1:], body)
    _facing(body, np.array([0.0, *centre]), 0, outwards=True)
    return RigidCylinder(body.name, (1.0, 0.0, 0.0), (0.0, *centre), radius)


def collar_of(body: Body) -> RigidCylinder:
    """Return a ring along z: its inner cylinder, and a mouth on a circle in planes of the axis.

    What is there has to be a part of the ring that is alike on both sides of z = 0.
    """
    corners = _corners(body)
    rows = np.unique(np.round(corners[:, 2], 6))
    circles = [_circle(corners[np.abs(corners[:, 2] - z) < 1e-5, :2], body) for z in rows]
    centre = circles[0][0]
    if any(np.abs(c - centre).max() > ROUND for c, _ in circles):
        raise DeckError(f"body {body.name}: rows of its patches have several axes")
    radii = np.array([radius for _, radius in circles])
    radius = float(radii.min())
    mouth = radii > radius + 1e-4
    edge = rows[~mouth].max()
    profile = np.column_stack([radii, rows])[rows >= edge - 1e-6]
    if len(profile) < 3:
        raise DeckError(f"body {body.name} has no rounded mouth")
    (_, straight), fillet = _circle(profile, body)
    _facing(body, np.array([*centre, 0.0]), 2, outwards=False)
    place = (float(centre[0]), float(centre[1]), 0.0)
    length = 2.0 * (float(straight) + fillet)
    return RigidCylinder(body.name, (0.0, 0.0, 1.0), place, radius, True, length, fillet)


def first_touch(body: Body, nodes: Array) -> float:
    """Return mm that the patches of a ring go down until one of `nodes` (n, 3) lies on one of them.

    Straight down from each patch: a node above its plane, and between its ends along z, is met.
    """
    found = np.inf
    for patch in body.patches:
        a, b, c = patch[0], patch[1] - patch[0], patch[2] - patch[0]
        normal = np.cross(b, c)
        if abs(normal[1]) < 1e-3 * np.linalg.norm(normal) or a[1] < body.patches[..., 1].mean():
            continue
        inside = (nodes[:, 2] > patch[:, 2].min() - 1e-9) & (nodes[:, 2] < patch[:, 2].max() + 1e-9)
        # Height of the patch's plane over the node.
        x, y, z = (nodes[inside] - a).T
        height = -(normal[0] * x + normal[2] * z) / normal[1] - y
        found = min(found, float(height.min(initial=np.inf)))
    return found


def _corners(body: Body) -> Array:
    if body.patches is None or not len(body.patches):
        raise DeckError(f"body {body.name} has no patches")
    return body.patches.reshape(-1, 3)


def _circle(points: Array, body: Body) -> tuple[Array, float]:
    """Return centre (2,) and radius of the circle through all points (n, 2)."""
    middle = points.mean(axis=0)
    arm = points - middle
    rows = np.column_stack([2.0 * arm, np.ones(len(arm))])
    a, b, c = np.linalg.lstsq(rows, (arm**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(c + a * a + b * b))
    if np.abs(np.hypot(arm[:, 0] - a, arm[:, 1] - b) - radius).max() > ROUND:
        raise DeckError(f"body {body.name}: the corners of its patches are on no circle")
    return middle + np.array([a, b]), radius


def _facing(body: Body, centre: Array, axis: int, outwards: bool) -> None:
    """Raise DeckError unless corners are counter-clockwise seen from the fabric."""
    normal = np.cross(
        body.patches[:, 2] - body.patches[:, 0], body.patches[:, 3] - body.patches[:, 1]
    )
    arm = body.patches.mean(axis=1) - centre
    arm[:, axis] = 0.0
    side = np.einsum("pk,pk->p", normal, arm) * (1.0 if outwards else -1.0)
    if (side <= 0).any():
        bad = int(np.argmax(side <= 0)) + 1
        raise DeckError(f"body {body.name}: patch {bad} shows the fabric its back")
