"""Bubble and strip in Marc: their decks, and what their post files hold."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ...errors import InputError, Note, NoteKind, SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.mesh import Array, Mesh
from ...meshes.strip_models import UniaxialModel
from ..base import History
from ..prescribed import gauge_opened, grip_pulls, inflated_history, strip_history, without_cords
from .deck import (
    MEMBRANE,
    Run,
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
MOVED, REACTION = "Displacement", "Reaction Force"
#: Six digits: times of some hundreds are good to this, nodes to this part of the mesh's size.
NEAR_TIME, NEAR_PLACE = 1e-2, 1e-5
NO_FORCES = (
    f"the .t19 holds no {REACTION!r}; ask for it in a block 'post' of your own "
    "(bubblefit docs marc)"
)


def analyse_bubble(
    model: BubbleModel, law: HypoelasticLaw, settings: MarcSettings, run: Run
) -> History:
    """Inflate a bubble; SolverFailure: no good end, slack, a moving rim; InputError."""
    without_cords(model, "Marc")
    if (
        any(model.slack)
        or model.strains
        or model.strain is not None
        or model.rim_motion is not None
    ):
        problem = "takes no slack sheet, no metric and no rim that moves, use another solver"
        raise SolverFailure(problem, "marc")
    deck, count = bubble_deck(model, law, settings), len(model.increments)
    return run(deck, count, lambda t19, iterations: bubble_history(t19, model, iterations))


def bubble_deck(model: BubbleModel, law: HypoelasticLaw, settings: MarcSettings) -> str:
    """Return the deck of an inflation, total time the increments; InputError as `deck_text`."""
    warp = WARP if model.mesh.warp is None else model.mesh.warp
    fabric = fabric_context(model.mesh, warp, model.thickness)
    sets = {name: dofs for name, dofs in model.supports.items() if name in model.mesh.node_sets}
    held = supports(sets, settings.element)
    cases = [("inflation", len(model.increments), [*(one["name"] for one in held), "pressure"])]
    tables = [time_table(1, "load", (0.0, *model.increments))]
    named, pressure = node_sets(model.mesh, list(sets)), pressure_context(settings)
    return deck_text("bubble.dat.j2", "Bubble", settings, law, fabric, named, cases, tables, held,
                     pressure=pressure)  # fmt: skip


def pressure_context(settings: MarcSettings) -> dict[str, float]:
    """Return load type of a pressure on the fabric, and the magnitude that inflates by 1 MPa."""
    return {"type": settings.pressure_type, "magnitude": float(settings.pressure_sign)}


def analyse_strip(
    model: UniaxialModel, law: HypoelasticLaw, settings: MarcSettings, run: Run
) -> History:
    """Pull a strip, its grips driven by `pulls`; SolverFailure: no good end, or not so far."""

    def gauge(pulls: Array) -> Array:
        deck, count = strip_deck(model, law, settings, pulls), len(pulls)
        frames = run(deck, count, lambda t19, _: whole_times(t19, model.mesh, count))
        return gauge_opened(model, displacements(frames))

    pulls, driven = grip_pulls(model, law, gauge, "marc")
    deck, count = strip_deck(model, law, settings, pulls), len(pulls)

    def read(t19: Path, iterations: int) -> History:
        frames = whole_times(t19, model.mesh, count)
        forces, sets = reactions(frames), model.mesh.node_sets
        if forces is None:
            raise SolverFailure(NO_FORCES, "marc")
        u = displacements(frames)
        return strip_history(model, u, forces, sets, "marc", iterations, driven)

    return run(deck, count, read)


def strip_deck(
    model: UniaxialModel, law: HypoelasticLaw, settings: MarcSettings, pulls: Array
) -> str:
    """Return the deck of a pull; `pulls` (increments,) mm along -y; InputError as `deck_text`."""
    mesh = model.mesh
    fabric = fabric_context(mesh, model.warp, model.thickness)
    # In its plane a strip neither bends nor twists.
    flat = (2,) if settings.element == MEMBRANE else (2, 3, 4, 5)
    held = [*supports(model.supports, MEMBRANE), fixed("flat", FLAT, flat)]
    pull = fixed("pull", model.pulled.lower(), (1,), (-1.0,), table=1)
    sets = node_sets(mesh, list(dict.fromkeys([*model.supports, model.pulled])))
    sets.append(named_set("node", FLAT, np.arange(len(mesh.points))))
    cases = [("pull", len(pulls), [*(one["name"] for one in held), "pull"])]
    tables = [time_table(1, "load", (0.0, *pulls.tolist()))]
    deck = "uniaxial.dat.j2", "Strip", settings, law, fabric, sets, cases, tables, held
    return deck_text(*deck, fixed=[*held, pull])


def whole_times(path: Path, mesh: Mesh, count: int) -> list[dict[str, Array]]:
    """Return vectors by name at times 1 to `count`, (nodes, components); SolverFailure: not all."""
    try:
        found = by_time(path, mesh)
        for time in range(1, count + 1):
            if time not in found:
                raise InputError(path, f"time {time} of {count}", f"holds no {MOVED} of x, y and z")
    except InputError as error:
        raise SolverFailure(f"no usable results: {error}", "marc") from None
    return [found[time] for time in range(1, count + 1)]


def by_time(path: Path, mesh: Mesh, ended: bool = True) -> dict[int, dict[str, Array]]:
    """Return vectors by name at whole times, `ended` as `T19File.frames`; InputError: damaged."""
    file = T19File(path)
    nodes = len(mesh.points)
    if not np.array_equal(file.mesh.numbers, np.arange(1, nodes + 1)):
        raise InputError(path, "nodes", f"are not the deck's {nodes}")
    size = float(np.abs(mesh.points).max())
    if np.abs(file.mesh.points - mesh.points).max() > NEAR_PLACE * size:
        raise InputError(path, "nodes", "are not where the deck has them: of another job?")
    found: dict[int, dict[str, Array]] = {}
    for frame in file.frames(ended):
        time, moved = round(frame.time), frame.fields.get(MOVED)
        if abs(frame.time - time) < NEAR_TIME and moved is not None and moved.shape[1] >= 3:
            found[time] = frame.fields
    return found


def displacements(frames: Sequence[Mapping[str, Array]]) -> Array:
    """Return (frames, nodes, 3) mm."""
    return np.ascontiguousarray([frame[MOVED][:, :3] for frame in frames])


def reactions(frames: Sequence[Mapping[str, Array]]) -> Array | None:
    """Return forces of the supports on the nodes, (frames, nodes, 3) N; None without them."""
    if any(REACTION not in frame for frame in frames):
        return None
    return np.ascontiguousarray([frame[REACTION][:, :3] for frame in frames])


def bubble_history(path: Path, model: BubbleModel, iterations: int) -> History:
    """Return displacements, support forces and strains; SolverFailure as `whole_times`."""
    frames = whole_times(path, model.mesh, len(model.increments))
    forces, sets = reactions(frames), model.mesh.node_sets
    remarks = () if forces is not None else (Note(NO_REACTIONS, NO_FORCES),)
    given = None if forces is None else forces[model.reported]
    return inflated_history(model, displacements(frames), given, sets, iterations, remarks)
