"""Build models of the membrane solver from decks, and converge it as their control blocks ask."""

from collections import namedtuple
from contextlib import contextmanager

import numpy as np
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import Bending, Gas, InflatedModel, RigidCylinder
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.strip_models import UniaxialModel
from bubblefit.solvers.membrane import closed
from bubblefit.solvers.membrane.bending import BITE
from bubblefit.solvers.membrane.contact import brought_to_touch
from bubblefit.solvers.membrane.factorisation import SingularTangent
from bubblefit.solvers.membrane.membrane import Membrane
from bubblefit.solvers.membrane.newton import NewtonSettings
from bubblefit.solvers.membrane.solver import MembraneSolver

from .deck import TIME, DeckError, level

#: mm that a corner of a patch may be away from the circle through all of them, and a support from
#: where it touches the inflated membrane.
ROUND, NEAR = 1e-6, 0.2


#: The increments: times (n,) at their ends; case (n,) from 0; steps (n,); conditions.
Schedule = namedtuple("Schedule", "times case steps first last")


def schedule_of(content):
    case = np.repeat(np.arange(len(content.cases)), [case.increments for case in content.cases])
    steps = np.array([content.cases[i].step for i in case])
    times = np.cumsum(steps)
    times = np.where(np.abs(times - np.round(times)) < 1e-6, np.round(times), times)
    for number, table in content.tables.items():
        if table.variable == TIME and np.abs(table.x[[0, -1]] - [0.0, times[-1]]).max() > 1e-6:
            raise DeckError(f"table {number} does not go from 0 to {times[-1]:g}")
    return Schedule(times, case, steps, content.cases[0].conditions, content.cases[-1].conditions)


def pressures(content, schedule):
    """Return the MPa that inflates, at the increments of the first load case."""
    loads = [content.conditions[name] for name in schedule.first]
    loads = [c for c in loads if c.kind != "fixed"]
    if [(c.kind, c.load, c.values) for c in loads] not in (
        [("pressure", 2, [-1.0])], [("cavity", 1, [1.0])]
    ) or loads[0].tables == [0]:  # fmt: skip
        raise DeckError("stand-in: what inflates is load type 2 of -1, or one cavity's pressure")
    times = schedule.times[schedule.case == 0]
    return level(content.tables[loads[0].tables[0]], times).tolist()


def held(content, names):
    """Return by node (from 0) the translations (0 to 2) that these conditions hold at zero."""
    found = {}
    for c in (content.conditions[name] for name in names):
        for dof, value in zip(c.dofs, c.values, strict=True) if c.dofs else ():
            if dof <= 3 and value == 0.0:
                for node in (content.sets["node"][c.on] - 1).tolist():
                    found.setdefault(node, set()).add(dof - 1)
    return {node: tuple(sorted(dofs)) for node, dofs in sorted(found.items())}


def supported(content, nodes, **sets):
    """Return the mesh, with a node set for each way of being held, and what each holds."""
    names = {f"held_{''.join(map(str, dofs))}": dofs for dofs in nodes.values()}
    for name, dofs in names.items():
        sets[name] = np.array([node for node, own in nodes.items() if own == dofs])
    return Mesh(content.coordinates, (content.connectivity - 1).astype(np.intp), sets), names


def model_of(content, schedule, law):
    """Return the model, and in which increments (n,) of the deck nothing moves."""
    rests = np.zeros(len(schedule.times), dtype=bool)
    flat = np.ptp(content.coordinates[:, 2]) <= 1e-9 and not content.gas
    if flat and len(content.thickness) + len(content.frames) != 2:
        raise DeckError("stand-in: a flat sheet of one thickness and one frame only")
    (thickness, _), (_, along, _) = content.thickness[0], content.frames[0]
    if flat and all(c.kind == "fixed" for c in content.conditions.values()):
        return _strip(content, schedule, thickness, along), rests
    mesh, supports = supported(content, held(content, schedule.first))
    levels = pressures(content, schedule)
    if flat:
        if np.abs(along - [1.0, 0.0, 0.0]).max() > 1e-9:
            raise DeckError("stand-in: the warp of a bubble has to be x")
        return BubbleModel(mesh, thickness, levels, supports=supports), rests
    thick, warp = np.zeros(content.elements), np.zeros((content.elements, 3))
    for thickness, name in content.thickness:
        thick[content.sets["element"][name] - 1] = thickness
    for name, along, _ in content.frames:
        warp[content.sets["element"][name] - 1] = along
    slack = InflatedModel(mesh, thick, warp, levels, supports)
    return _bent(content, schedule, law, slack) if content.gas else (slack, rests)


def _strip(content, schedule, thickness, warp):
    """Return the strip; its gauge is a line along the pull, from a pulled node to a held one."""
    conditions = [content.conditions[name] for name in schedule.first]
    (name, moved), *more = [
        (n, c) for n, c in zip(schedule.first, conditions, strict=True) if any(c.values)
    ]
    if more or moved.dofs != [2] or moved.values != [-1.0]:
        raise DeckError("stand-in: a strip is pulled along -y by one condition")
    table, p = content.tables[moved.tables[0]], content.coordinates
    pulled = content.sets["node"][moved.on] - 1
    nodes = held(content, [other for other in schedule.first if other != name])
    for lower in pulled.tolist():
        for upper, dofs in nodes.items():
            above = abs(p[upper, 0] - p[lower, 0]) < 1e-9 and p[upper, 1] > p[lower, 1]
            if above and {0, 1} <= {*dofs} and 0 in nodes.get(lower, ()):
                gauge = np.array([lower, upper])
                mesh, supports = supported(content, nodes, gauge=gauge, pulled=pulled)
                pulls = level(table, schedule.times).tolist()
                # Every increment is solved, as Marc does.
                return UniaxialModel(
                    mesh, warp, thickness, pulls, supports, "pulled", unloaded=True
                )
    raise DeckError("stand-in: no pulled node with a held one above it")


def _bent(content, schedule, law, slack):
    """Return the inflated cylinder bent between the deck's bodies, and when nothing moves."""
    kinds = [[content.conditions[n].load for n in c.conditions] for c in content.cases]
    if [[k for k in case if k] for case in kinds] != [[1], [2], [2]]:
        raise DeckError("stand-in: inflation by pressure, approach and bending at constant mass")
    if [body.rigid for body in content.bodies] != [False, True, True]:
        raise DeckError("stand-in: bodies are the membrane, a support and a collar")
    position = slack.mesh.points + MembraneSolver().run(slack, law).displacement[-1]
    post, ring, moves = _bodies(content, schedule, position)
    late, early = held(content, schedule.last), held(content, schedule.first)
    released = [node for node, dofs in early.items() if dofs != late.get(node, ())]
    ways = {tuple(set(early[node]) - set(late.get(node, ()))) for node in released}
    if len(ways) != 1:
        raise DeckError("stand-in: what is let go after inflation is held in one way")
    mesh, supports = supported(content, late, released=np.array(released))
    gas = Gas(content.gas[0], content.gas[1], content.gas[2] * 1e12)
    bending = Bending([post], [ring], moves[moves > 0].tolist(), released="released", gas=gas)
    supports = {**supports, "released": ways.pop()}
    rests = np.concatenate([np.zeros(len(slack.pressures), dtype=bool), moves <= 0])
    model = InflatedModel(mesh, slack.thickness, slack.warp, slack.pressures, supports, 1, bending)
    return model, rests


def _bodies(content, schedule, position):
    """Return support, collar, and mm of the collar below touching, after inflation."""
    support, collar = content.bodies[1:]
    post, ring = support_of(support), collar_of(collar)
    after = schedule.case > 0
    heights = []
    for body in (support, collar):
        ways = np.outer(level(content.tables[body.table], schedule.times), body.direction)
        if np.abs(ways[:, [0, 2]]).max() > 1e-9:
            raise DeckError(f"stand-in: body {body.name} moves along y only")
        heights.append(ways[:, 1])
    if (
        heights[0][~after][-1] > -1.0
        or np.ptp(heights[0][np.flatnonzero(schedule.case == 1)[-1] :]) > 1e-9
    ):
        raise DeckError("stand-in: the support comes after inflation, and rests on bending")
    touching = brought_to_touch(post, position, np.array([0.0, 1.0, 0.0]), BITE)
    away = touching.centre[1] - post.centre[1] - heights[0][-1]
    if abs(away) > NEAR:
        raise DeckError(f"stand-in: the support is {away:.3g} mm below where it touches")
    # Marc has flat patches, chords of the ring: its collar touches when one of them does. From
    # there on the ring is round.
    free = first_touch(collar, position)
    if free < 0:
        raise DeckError(f"the collar begins {-free:.3g} mm inside the inflated membrane")
    return post, ring, -heights[1][after] - free


def support_of(body):
    """Return a post along x: all corners on one circle, patches facing away from its axis."""
    centre, radius = _circle(body.patches.reshape(-1, 3)[:, 1:], body)
    _facing(body, np.array([0.0, *centre]), 0, 1.0)
    return RigidCylinder(body.name, (1.0, 0.0, 0.0), (0.0, *centre), radius)


def collar_of(body):
    """Return a ring along z: its inner cylinder, and a mouth on a circle in planes of the axis."""
    corners = body.patches.reshape(-1, 3)
    rows = np.unique(np.round(corners[:, 2], 6))
    circles = [_circle(corners[np.abs(corners[:, 2] - z) < 1e-5, :2], body) for z in rows]
    centre = circles[0][0]
    if any(np.abs(c - centre).max() > ROUND for c, _ in circles):
        raise DeckError(f"body {body.name}: rows of its patches have several axes")
    radii = np.array([radius for _, radius in circles])
    radius = float(radii.min())
    edge = rows[radii <= radius + 1e-4].max()
    (_, straight), fillet = _circle(np.column_stack([radii, rows])[rows >= edge - 1e-6], body)
    _facing(body, np.array([*centre, 0.0]), 2, -1.0)
    place = (float(centre[0]), float(centre[1]), 0.0)
    length = 2.0 * (float(straight) + fillet)
    return RigidCylinder(body.name, (0.0, 0.0, 1.0), place, radius, True, length, fillet)


def first_touch(body, nodes):
    """Return mm that the patches of a ring go down until one of `nodes` (n, 3) is on one."""
    found = np.inf
    for patch in body.patches:
        a, normal = patch[0], np.cross(patch[1] - patch[0], patch[2] - patch[0])
        if abs(normal[1]) < 1e-3 * np.linalg.norm(normal) or a[1] < body.patches[..., 1].mean():
            continue
        inside = (nodes[:, 2] > patch[:, 2].min() - 1e-9) & (nodes[:, 2] < patch[:, 2].max() + 1e-9)
        # Height of the patch's plane over the node.
        x, y, z = (nodes[inside] - a).T
        height = -(normal[0] * x + normal[2] * z) / normal[1] - y
        found = min(found, float(height.min(initial=np.inf)))
    return found


def _circle(points, body):
    """Return centre (2,) and radius of the circle through all points (n, 2)."""
    if len(points) < 3:
        raise DeckError(f"body {body.name} has no patches, or no rounded mouth")
    middle = points.mean(axis=0)
    arm = points - middle
    rows = np.column_stack([2.0 * arm, np.ones(len(arm))])
    a, b, c = np.linalg.lstsq(rows, (arm**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(c + a * a + b * b))
    if np.abs(np.hypot(arm[:, 0] - a, arm[:, 1] - b) - radius).max() > ROUND:
        raise DeckError(f"body {body.name}: the corners of its patches are on no circle")
    return middle + np.array([a, b]), radius


def _facing(body, centre, axis, outwards):
    """Raise DeckError unless corners are counter-clockwise seen from the fabric."""
    p = body.patches
    arm = p.mean(axis=1) - centre
    arm[:, axis] = 0.0
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    if (outwards * np.einsum("pk,pk->p", normal, arm) <= 0).any():
        raise DeckError(f"body {body.name}: a patch shows the fabric its back")


#: displacement (n, 3) mm, unbalance (n, 3) N: what supports take; contact (n, 3) N, or 0.
State = namedtuple("State", "displacement unbalance contact")


def control_of(content):
    """Return what all load cases ask for; DeckError where they differ, which Marc would run."""
    first, *others = [case.control for case in content.cases]
    if any(other != first for other in others):
        raise DeckError("stand-in: one control for all load cases")
    return first


@contextmanager
def converging(control, found=None):
    """Within, converge every equilibrium of the membrane solver as `control` asks, no better.

    The largest residual force is at most `residual` times the largest reaction, and the largest
    correction of the last iteration at most `correction` times the largest displacement of the
    increment so far. No increment goes without an iteration, and none has chord steps.

    found : is called with every increment but those that the solver adds to pass a snap.
    """
    unbalance, accept, plain = Membrane.unbalance, Membrane.accept, Membrane.equilibrium
    searched = closed.searched_equilibrium

    def measured(self, u, pressure, with_tangent):
        ratio = unbalance(self, u, pressure, with_tangent)
        if not hasattr(self, "increment_start"):
            # A membrane without stress begins at rest; one with stress where another one ended.
            self.increment_start = u.copy() if self.strain_old.any() else np.zeros_like(u)
        self.evaluated = u.copy()
        force = np.abs(self.residual)
        reaction = float(np.delete(force, self.free).max(initial=0.0))
        if ratio == np.inf or not reaction > 0:
            return ratio
        return float(force[self.free].max()) / reaction

    def accepted(self):
        accept(self)
        self.increment_start = self.evaluated
        bodies = getattr(self, "bodies", ())
        if found is None or (getattr(self, "gas", None) is not None and not bodies):
            return
        # Residuals hold the push of the bodies as well, with its sign changed: gone from there.
        residual = self.residual.reshape(self.reference.shape).copy()
        found(State(self.evaluated, residual, sum(self.contact) if bodies else 0.0))

    def full(original):
        def equilibrium(self, u, pressure, *settings):
            self.tolerance = control.residual
            self.newton = NewtonSettings(chord_below=0.0)
            tangent, last = self.tangent, [np.inf]
            solve = tangent.solve

            def solved(rhs):
                answer = solve(rhs)
                last[0] = float(np.abs(answer).max())
                return answer

            tangent.solve = solved
            try:
                end = original(self, u, pressure, *settings)
            finally:
                del tangent.solve
            return None if end is None else _corrected(self, end, pressure, last[0], control)

        return equilibrium

    Membrane.unbalance, Membrane.accept, Membrane.equilibrium = measured, accepted, full(plain)
    closed.searched_equilibrium = full(searched)
    try:
        yield
    finally:
        Membrane.unbalance, Membrane.accept, Membrane.equilibrium = unbalance, accept, plain
        closed.searched_equilibrium = searched


def _corrected(membrane, u, pressure, last, control):
    """Iterate from u (n, 3), whose residual is small, until the `last` correction (mm) is, too."""
    u, before = u.copy(), np.inf
    for _ in range(control.iterations):
        norm = membrane.unbalance(u, pressure, with_tangent=True)
        # A residual that is small and falls no further is rounding.
        settled = norm <= control.residual or 0.5 * before < norm < membrane.newton.rounding_below
        increment = float(np.abs(u - membrane.increment_start).max())
        if settled and last <= control.correction * increment:
            return u
        try:
            membrane.tangent.factor()
        except SingularTangent:
            return None
        step = -membrane.tangent.solve(membrane.residual[membrane.free])
        u.reshape(-1)[membrane.free] += step
        last, before = float(np.abs(step).max()), norm
        if not np.isfinite(last):
            return None
    return None
