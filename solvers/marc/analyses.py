"""Analyses of the bubble, the strip and the cylinder in Marc: their decks and their results."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.cylinder_model import CylinderModel
from ...meshes.mesh import Array, Mesh, Numbers
from ...meshes.strip_models import UniaxialModel
from ...notes import Note, NoteKind
from ..base import EARLY, History, extremes, log_strain
from ..prescribed import (
    ABOVE,
    bodies,
    gauge_opened,
    grip_pulls,
    inflated_history,
    may_touch,
    strip_history,
    volumes,
    without_cords,
)
from .deck import (
    MEMBRANE,
    MarcRun,
    deck_text,
    fabric_context,
    fixed,
    named_set,
    node_sets,
    supports,
    time_table,
)
from .settings import MarcSettings
from .t19 import T19File

NO_REACTIONS = NoteKind("no reactions")

WARP = np.array([1.0, 0.0, 0.0])
#: The set of all nodes.
FLAT = "all_nodes"
#: Names of nodal vectors in a .t19 file.
DISPLACEMENT = "Displacement"
REACTION = "Reaction Force"
#: Tolerance of times, of which a .t19 has six digits.
NEAR_TIME = 1e-2
#: Tolerance of the positions of nodes, as a share of the mesh's size.
NEAR_PLACE = 1e-5
NO_FORCES = (
    f"the .t19 holds no {REACTION!r}; ask for it in a block 'post' of your own "
    "(bubblefit docs marc)"
)


def analyse_bubble(
    model: BubbleModel,
    law: HypoelasticLaw,
    settings: MarcSettings,
    run: MarcRun,
) -> History:
    """Inflate a bubble.

    SolverFailure if the run fails, or for a slack sheet, a stress-free strain or a moving rim.
    InputError for cords.
    """
    without_cords(model, "Marc")
    if (
        any((*model.slack, *model.tension))
        or model.strains
        or model.strain is not None
        or model.rim_motion is not None
    ):
        problem = (
            "takes no slack sheet, no metric and no rim that moves, and no tension of the sheet"
        )
        raise SolverFailure(problem, "marc")
    deck = bubble_deck(model, law, settings)
    count = len(model.increments)
    return run(deck, count, lambda t19, iterations: bubble_history(t19, model, iterations))


def bubble_deck(model: BubbleModel, law: HypoelasticLaw, settings: MarcSettings) -> str:
    """Return the deck of a bubble, in which an increment of the law is a unit of time."""
    warp = WARP if model.mesh.warp is None else model.mesh.warp
    fabric = fabric_context(model.mesh, warp, model.thickness)
    sets = {name: dofs for name, dofs in model.supports.items() if name in model.mesh.node_sets}
    supported = supports(sets, settings.element)
    cases = [
        (
            "inflation",
            len(model.increments),
            [*(condition["name"] for condition in supported), "pressure"],
        )
    ]
    tables = [time_table(1, "load", (0.0, *model.increments))]
    named = node_sets(model.mesh, list(sets))
    pressure = pressure_context(settings)
    return deck_text(
        "bubble.dat.j2",
        "Bubble",
        settings,
        law,
        fabric,
        named,
        cases,
        tables,
        supported,
        pressure=pressure,
    )


def pressure_context(settings: MarcSettings) -> dict[str, float]:
    """Return the load type of a pressure on the fabric, and its magnitude for 1 MPa inside."""
    return {"type": settings.pressure_type, "magnitude": float(settings.pressure_sign)}


def analyse_strip(
    model: UniaxialModel,
    law: HypoelasticLaw,
    settings: MarcSettings,
    run: MarcRun,
) -> History:
    """Pull a strip by its grips to the elongations of its gauge; see `grip_pulls`.

    SolverFailure if a run fails, or does not reach the last elongation.
    """

    def gauge(pulls: Array) -> Array:
        deck = strip_deck(model, law, settings, pulls)
        count = len(pulls)
        frames = run(deck, count, lambda t19, _: whole_times(t19, model.mesh, count))
        return gauge_opened(model, displacements(frames))

    pulls, driven = grip_pulls(model, law, gauge, "marc")
    deck = strip_deck(model, law, settings, pulls)
    count = len(pulls)

    def read(t19: Path, iterations: int) -> History:
        frames = whole_times(t19, model.mesh, count)
        forces = reactions(frames)
        sets = model.mesh.node_sets
        if forces is None:
            raise SolverFailure(NO_FORCES, "marc")
        u = displacements(frames)
        return strip_history(
            model,
            u,
            forces,
            sets,
            "marc",
            iterations,
            driven,
        )

    return run(deck, count, read)


def strip_deck(
    model: UniaxialModel,
    law: HypoelasticLaw,
    settings: MarcSettings,
    pulls: Array,
) -> str:
    """Return the deck of a strip.

    Parameters
    ----------
    pulls : array
        Displacement of the pulled end along -y, (increments,) mm.
    """
    mesh = model.mesh
    fabric = fabric_context(mesh, model.warp, model.thickness)
    # In its plane a strip neither bends nor twists.
    flat = (2,) if settings.element == MEMBRANE else (2, 3, 4, 5)
    supported = [*supports(model.supports, MEMBRANE), fixed("flat", FLAT, flat)]
    pull = fixed("pull", model.pulled.lower(), (1,), (-1.0,), table=1)
    sets = node_sets(mesh, list(dict.fromkeys([*model.supports, model.pulled])))
    sets.append(named_set("node", FLAT, np.arange(len(mesh.points))))
    cases = [("pull", len(pulls), [*(condition["name"] for condition in supported), "pull"])]
    tables = [time_table(1, "load", (0.0, *pulls.tolist()))]
    deck = "uniaxial.dat.j2", "Strip", settings, law, fabric, sets, cases, tables, supported
    return deck_text(*deck, fixed=[*supported, pull])


def whole_times(path: Path, mesh: Mesh, count: int) -> list[dict[str, Array]]:
    """Return the nodal vectors (nodes, components) by name at each of the times 1 to `count`.

    SolverFailure if the file does not hold them all.
    """
    try:
        frames = frames_by_time(path, mesh)
        for time in range(1, count + 1):
            if time not in frames:
                raise InputError(
                    path, f"time {time} of {count}", f"holds no {DISPLACEMENT} of x, y and z"
                )
    except InputError as error:
        raise SolverFailure(f"no usable results: {error}", "marc") from None
    return [frames[time] for time in range(1, count + 1)]


def frames_by_time(path: Path, mesh: Mesh, is_complete: bool = True) -> dict[int, dict[str, Array]]:
    """Return the nodal vectors by name nearest to each whole time; InputError for a damaged file.

    The decks end load k at time k, so whole times are the loads. Other frames, and those without
    three displacements, are left out; `whole_times` reports what is then missing.

    Parameters
    ----------
    is_complete : bool
        See `T19File.frames`.
    """
    file = T19File(path)
    node_count = len(mesh.points)
    if not np.array_equal(file.mesh.numbers, np.arange(1, node_count + 1)):
        raise InputError(path, "nodes", f"are not the deck's {node_count}")
    size = np.abs(mesh.points).max()
    if np.abs(file.mesh.points - mesh.points).max() > NEAR_PLACE * size:
        raise InputError(path, "nodes", "are not where the deck has them: of another job?")
    frames: dict[int, dict[str, Array]] = {}
    distances: dict[int, float] = {}
    for frame in file.frames(is_complete):
        time = round(frame.time)
        displacement = frame.fields.get(DISPLACEMENT)
        if (
            abs(frame.time - time) <= distances.get(time, NEAR_TIME)
            and displacement is not None
            and displacement.shape[1] >= 3
        ):
            frames[time] = frame.fields
            distances[time] = abs(frame.time - time)
    return frames


def displacements(frames: Sequence[Mapping[str, Array]]) -> Array:
    """Return the displacements (frames, nodes, 3) mm of frames."""
    return np.ascontiguousarray([frame[DISPLACEMENT][:, :3] for frame in frames])


def reactions(frames: Sequence[Mapping[str, Array]]) -> Array | None:
    """Return forces of the supports on the nodes, (frames, nodes, 3) N; None without them."""
    if any(REACTION not in frame for frame in frames):
        return None
    return np.ascontiguousarray([frame[REACTION][:, :3] for frame in frames])


def bubble_history(path: Path, model: BubbleModel, iterations: int) -> History:
    """Return the history of a bubble from its result file; SolverFailure as in `whole_times`."""
    frames = whole_times(path, model.mesh, len(model.increments))
    forces = reactions(frames)
    sets = model.mesh.node_sets
    remarks = () if forces is not None else (Note(NO_REACTIONS, NO_FORCES),)
    reported_forces = None if forces is None else forces[model.reported]
    return inflated_history(
        model,
        displacements(frames),
        reported_forces,
        sets,
        iterations,
        remarks,
    )


# From here to the end of the module: the cylinder, inflated only, and inflated and bent.

UNCONFIRMED = NoteKind("unconfirmed")
UNBALANCED = NoteKind("unbalanced forces")


#: Distance in mm below its place at which the support waits while the cylinder is inflated.
WAITING_DEPTH = 50.0
SUPPORT_PATH = 2
COLLAR_PATH = 3
UP = [0.0, 1.0, 0.0]


def contact_bodies(model: CylinderModel, inflated: Array) -> list[dict[str, Any]]:
    """Return support and collar as rigid patches (n, 12), of four corners each, for the template.

    Parameters
    ----------
    inflated : array
        Displacement (nodes, 3) mm.

    Raises
    ------
    InputError
        Unless a quarter of the cylinder is meshed.
    """
    mesh = model.mesh
    rigid_bodies = bodies(
        model, mesh.points + inflated, mesh.node_sets["support_bottom"], "Marc's deck"
    )
    named = zip(("support", "collar"), (SUPPORT_PATH, COLLAR_PATH), rigid_bodies, strict=True)
    return [
        {"name": n, "path": path, "direction": UP, "patches": body.faces.reshape(-1, 12).tolist()}
        for n, path, body in named
    ]


def paths(inflation: int, deflections: Sequence[float]) -> tuple[list[float], list[float]]:
    """Return the heights (mm) of support and collar above their places at times 0, 1, 2, ...

    Parameters
    ----------
    inflation : int
        Number of its increments.
    deflections : sequence of float, mm
        Of the collar.
    """
    bending_steps = len(deflections)
    support = [-WAITING_DEPTH] * (inflation + 1) + [0.0] * (1 + bending_steps)
    collar = [0.0] * (inflation + 2) + [-(ABOVE + d) for d in deflections]
    return support, collar


SUPPORT_SET = "support_bottom"
#: Number of increments between inflation and bending, in which the support is raised.
APPROACH = 1
TONNES = 1e-12  # t/mm^3 for 1 kg/m^3


def cylinder_deck(
    model: CylinderModel,
    law: HypoelasticLaw,
    settings: MarcSettings,
    shape: Array | None = None,
) -> str:
    """Return the deck of a cylinder, whose bottom is held at the supports during inflation.

    Parameters
    ----------
    shape : array or None
        Displacement (nodes, 3) mm of the inflated cylinder, for a deck of inflation and bending
        with gas in a cavity; None for one of inflation only.
    """
    mesh = model.mesh
    inflation_steps = len(model.inflation)
    bending_steps = len(model.increments)
    fabric = fabric_context(mesh, np.asarray(mesh.warp), model.thickness)
    guided = supports(model.guides, settings.element)
    names = [condition["name"] for condition in guided]
    supported = [*guided, fixed("hold", SUPPORT_SET, (1,))]
    load = [0.0, *model.inflation]
    tables = []
    bending = dict[str, Any]()
    if shape is None:
        cases = [("inflation", inflation_steps, [*names, "hold", "pressure"])]
    else:
        gas = model.gas
        density = TONNES * model.gas.density
        cavity = {"pressure": gas.ambient, "temperature": gas.temperature, "density": density}
        bending = {"gas": cavity, "bodies": contact_bodies(model, shape)}
        cases = [
            ("inflation", inflation_steps, [*names, "hold", "fill"]),
            ("approach", APPROACH, [*names, "hold", "closed"]),
            ("bending", bending_steps, [*names, "closed"]),
        ]
        load += [model.pressure] * (APPROACH + bending_steps)
        support, collar = paths(inflation_steps, model.increments)
        tables.append(time_table(SUPPORT_PATH, "support_path", support))
        tables.append(time_table(COLLAR_PATH, "collar_path", collar))
    tables.insert(0, time_table(1, "load", load))
    sets = node_sets(mesh, [*model.guides, SUPPORT_SET])
    deck = "cylinder.dat.j2", "Cylinder", settings, law, fabric, sets, cases, tables, supported
    return deck_text(*deck, pressure=pressure_context(settings), **bending)


#: Name of the nodal vector of contact forces; it has not been confirmed with a real file.
CONTACT = "Contact Normal Force"
#: Difference of the supports' force from the collar's, as a share of the latter, above which a
#: remark is made.
BALANCE = 0.02


def inflated(path: Path, model: CylinderModel) -> Array:
    """Return the displacement (nodes, 3) mm after inflation; SolverFailure as `whole_times`."""
    return displacements(whole_times(path, model.mesh, len(model.inflation)))[-1]


def cylinder_history(
    path: Path,
    model: CylinderModel,
    iterations: int,
    is_complete: bool = True,
) -> History:
    """Return the history of the inflated state and every reported deflection.

    Its load is the force of the collar in N, and its pressure that of a constant mass of gas in the
    volume of the frame.

    Parameters
    ----------
    is_complete : bool
        Whether the file must hold the whole run; if not, the history ends with the last complete
        increment.

    Raises
    ------
    SolverFailure
        For a file without usable results.
    """
    inflation_steps = len(model.inflation)
    expected_times = {inflation_steps: 0.0} | {
        inflation_steps + APPROACH + 1 + i: d
        for i, d in zip(model.reported, model.deflections, strict=True)
    }
    try:
        frames = frames_by_time(path, model.mesh, is_complete)
    except InputError as error:
        raise SolverFailure(f"no usable results: {error}", "marc") from None
    times = [time for time in expected_times if time in frames]
    # An increment that is missing ends the history there.
    without_gaps = list(expected_times)[: len(times)] == times
    if len(times) < 2 or not without_gaps or (is_complete and len(times) < len(expected_times)):
        problem = f"{path}: holds {len(times)} of {len(expected_times)} frames"
        raise SolverFailure(f"no usable results: {problem}", "marc")
    u = displacements([frames[time] for time in times])
    forces, remarks = _forces(model, [frames[time] for time in times])
    early = ""
    if len(times) < len(expected_times):
        last = expected_times[times[-1]]
        early = f"the run stopped early; the last increment is at {last:g} mm of deflection"
        remarks.append(Note(EARLY, early))
    mesh = model.mesh
    volume = volumes(model, u)
    gas = model.gas.closed_in(model.pressure, volume[0])
    pressure = [gas.pressure(v) for v in volume]
    return History(
        -forces["collar"][:, 1],
        u,
        *extremes(log_strain(mesh, u, mesh.warp)),
        forces,
        cavity_pressure=np.array(pressure),
        cavity_volume=volume,
        iterations=iterations,
        path=u,
        remarks=tuple(remarks),
        early=early,
    )


def touching(model: CylinderModel) -> dict[str, Numbers]:
    """Return the nodes of the tube that the supports, and the collar, may touch."""
    sets = model.mesh.node_sets
    tube = np.ones(len(model.mesh.points), bool)
    # The rim where caps and tube meet is the tube's.
    tube[np.setdiff1d(sets["caps"], sets["ends"])] = False
    support, collar = may_touch(model, model.mesh.points)
    return {"supports": np.flatnonzero(tube & support), "collar": np.flatnonzero(tube & collar)}


def _forces(
    model: CylinderModel, frames: list[dict[str, Array]]
) -> tuple[dict[str, Array], list[Note]]:
    """Return the forces (frames, 3) N of each body on the whole cylinder, and notes on them."""
    name = CONTACT if all(CONTACT in frame for frame in frames[1:]) else REACTION
    if any(name not in frame for frame in frames[1:]):
        raise SolverFailure(NO_FORCES, "marc")
    reactions = {body: np.zeros((len(frames), 3)) for body in ("supports", "collar")}
    for body, nodes in touching(model).items():
        # Along x and z the forces of a quarter cancel against those of the others. The inflated
        # cylinder has not touched the bodies yet.
        reactions[body][1:, 1] = [
            model.copies * frame[name][nodes, 1].sum() for frame in frames[1:]
        ]
    words = (
        f"the collar's force is the sum of {name!r}, which is not confirmed (bubblefit docs marc)"
    )
    remarks = [Note(UNCONFIRMED, words)]
    collar = reactions["collar"][-1, 1]
    supports = reactions["supports"][-1, 1]
    if abs(collar + supports) > BALANCE * abs(collar):
        words = (
            f"collar ({-collar:.4g} N) and supports ({supports:.4g} N) do not balance at the end: "
            "see run 5 in `bubblefit docs marc`"
        )
        remarks.append(Note(UNBALANCED, words))
    return reactions, remarks


def analyse_cylinder(
    model: CylinderModel,
    law: HypoelasticLaw,
    settings: MarcSettings,
    run: MarcRun,
) -> History:
    """Inflate and bend a cylinder, in two runs.

    The first only inflates it, to find where collar and supports touch; the second does it all. If
    that one stops early because Marc gives up, the history ends there.
    """
    without_cords(model, "Marc")
    inflation_steps = len(model.inflation)
    bending_steps = len(model.increments)
    deck = cylinder_deck(model, law, settings)
    shape = run(deck, inflation_steps, lambda t19, _: inflated(t19, model))
    return run(
        cylinder_deck(model, law, settings, shape),
        inflation_steps + APPROACH + bending_steps,
        lambda t19, n: cylinder_history(t19, model, n),
        lambda t19, n: cylinder_history(t19, model, n, is_complete=False),
    )
