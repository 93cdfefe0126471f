"""Write what the decks of all models share: law, schedule, supports, sets, fabric."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from ...errors import InputError
from ...materials.exports.subroutines import NUMBERS, STATE_VARIABLES, guarded
from ...materials.law import HypoelasticLaw
from ...materials.modulus_tables import modulus_tables
from ...meshes.mesh import Array, Mesh, Numbers
from ...version import __version__
from ..decks import render
from ..prescribed import held_dofs
from .settings import MarcSettings

JOB = "job"
#: Residual force and displacement, relative (thesis, section 2.2).
TOLERANCE = 1e-3
MEMBRANE = 18
THICK = 75


def law_context(law: HypoelasticLaw, settings: MarcSettings) -> dict[str, Any]:
    """Return what the templates hold of the law; InputError: one that NLELAST does not carry."""
    if settings.law == "hypela2":
        kind = "thick shell" if settings.element == THICK else "membrane"
        return {"law": "hypoelastic", "state_variables": STATE_VARIABLES[kind]}
    if law.thickness_change != "constant":
        problem = "'incompressible' is nothing that NLELAST knows; use 'constant', or "
        problem += "[solver.marc] law = 'hypela2'"
        raise InputError(None, "material.thickness_change", problem)
    tables = modulus_tables(law)
    moduli = [
        {"name": name.lower(), "number": number, "points": guarded(tables[name])}
        for name, number in NUMBERS.items()
    ]
    return {"law": "nlelast", "state_variables": 0, "moduli": moduli, "nu12": law.nu12}


def schedule(
    settings: MarcSettings, cases: Sequence[tuple[str, int, Sequence[str]]]
) -> dict[str, Any]:
    """Return load cases of increments, each cut so that `settings.increments` come together."""
    units = sum(count for _, count, _ in cases)
    cuts = max(1, math.ceil(settings.increments / units))
    return {
        "every": cuts,
        "tolerance": TOLERANCE,
        "cases": [
            {
                "name": n,
                "increments": cuts * count,
                "step": 1 / cuts,
                "conditions": list(conditions),
            }
            for n, count, conditions in cases
        ],
    }


def fixed(
    name: str, members: str, dofs: Sequence[int], values: Sequence[float] = (), table: int = 0
) -> dict[str, Any]:
    """Return a condition of FIXED DISP on a node set; `dofs` from 0, zero without `values`."""
    amounts = list(values) or [0.0] * len(dofs)
    return {
        "name": name,
        "set": members,
        "dofs": [dof + 1 for dof in dofs],
        "amounts": amounts,
        "tables": [table if value else 0 for value in amounts],
    }


def supports(dofs_by_set: Mapping[str, Sequence[int]], element: int) -> list[dict[str, Any]]:
    """Return conditions `fix_SET` from directions held at zero by node set."""
    return [
        fixed(f"fix_{name.lower()}", name.lower(), dofs if element == MEMBRANE else held_dofs(dofs))
        for name, dofs in dofs_by_set.items()
    ]


def time_table(number: int, name: str, values: Sequence[float]) -> dict[str, Any]:
    """Return a table over time: `values` at times 0, 1, 2, ..."""
    points = [[float(time), float(value)] for time, value in enumerate(values)]
    return {"number": number, "name": name, "points": points}


def deck_text(
    template: str,
    title: str,
    settings: MarcSettings,
    law: HypoelasticLaw,
    fabric: dict[str, Any],
    sets: Sequence[dict[str, Any]],
    cases: Sequence[tuple[str, int, Sequence[str]]],
    tables: Sequence[dict[str, Any]],
    supports: Sequence[dict[str, Any]],
    **context: Any,
) -> str:
    """Return the deck, `context` for its template; InputError: a template, or as `law_context`."""
    variables = {
        "version": __version__,
        "title": f"{title}, {len(fabric['elements'])} elements {settings.element}",
        "element": settings.element,
        "shell": settings.element != MEMBRANE,
        "follower": "pressure" in context,
        "gas": None,
        **fabric,
        "sets": [*fabric["sets"], *sets],
        **law_context(law, settings),
        **schedule(settings, cases),
        "time_tables": tables,
        "fixed": supports,
        "start": {"name": "start", "conditions": [condition["name"] for condition in supports]},
        **context,
    }
    folder = Path(settings.templates) if settings.templates is not None else None
    instead = {f"{name}.dat.j2": Path(file) for name, file in settings.include.items()}
    return render("marc", template, variables, folder, instead)


FABRIC = "fabric"
PER_LINE = 8
#: Digits to which unit vectors are the same.
DIGITS = 9


def set_lines(numbers: Numbers) -> list[str]:
    """Return members (from 0, sorted) as Marc reads them: `a to b` for runs, ` c` to go on."""
    items = []
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) != 1) + 1)
    for run in runs:
        first = int(run[0]) + 1
        last = int(run[-1]) + 1
        if len(run) > 2:
            items.append(f"{first:10d} to {last:d}")
        else:
            items += [f"{n + 1:10d}" for n in run.tolist()]
    rows = [items[i : i + PER_LINE] for i in range(0, len(items), PER_LINE)]
    return ["".join(row) + (" c" if row is not rows[-1] else "") for row in rows]


def named_set(kind: str, name: str, numbers: Numbers) -> dict[str, Any]:
    """Return a `define`, kind "node" or "element"; InputError: a bad name, nothing in it."""
    if not re.fullmatch(r"[a-z0-9_]{1,28}", name):
        problem = f"{name!r}: Marc takes at most 28 letters, digits and _; rename the set"
        raise InputError(None, f"{kind} set", problem)
    if not len(numbers):
        raise InputError(None, f"{kind} set {name}", "holds nothing; mend the mesh")
    return {"kind": kind, "name": name, "lines": set_lines(np.sort(numbers))}


def fabric_frames(mesh: Mesh, warp: Array) -> tuple[Array, Array]:
    """Return unit warp and fill in the plane of each quad, (quads, 3); InputError: warp normal."""
    corner = mesh.points[mesh.quads]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    yarn = np.broadcast_to(warp, normal.shape)
    along = yarn - np.einsum("mk,mk->m", yarn, normal)[:, None] * normal
    length = np.linalg.norm(along, axis=1, keepdims=True)
    if (length < 1e-6).any():
        raise InputError(None, "warp", "the warp direction is normal to a facet")
    along /= length
    return along, np.cross(normal, along)


def fabric_context(mesh: Mesh, warp: Array, thickness: Array | float) -> dict[str, Any]:
    """Return mesh, frames and thicknesses for the templates; sets without the nodes'."""
    quads = np.asarray(mesh.quads)
    everything = np.arange(len(quads))
    sets = [named_set("element", FABRIC, everything)]

    def groups(values: Array, name: str) -> list[tuple[str, int]]:
        """Return the set of elements with the same row of `values`, and one of them."""
        _, group_of = np.unique(values, axis=0, return_inverse=True)
        group_of = group_of.ravel()
        count = int(group_of.max()) + 1
        if count == 1:
            return [(FABRIC, 0)]
        named_groups = []
        for number in range(count):
            members = np.flatnonzero(group_of == number)
            named_groups.append((f"{name}_{number + 1}", int(members[0])))
            sets.append(named_set("element", named_groups[-1][0], members))
        return named_groups

    layer = np.broadcast_to(np.asarray(thickness, float), len(quads))
    thick = groups(layer[:, None], "layer")
    layers = [
        {"set": name, "thickness": float(layer[first_element])} for name, first_element in thick
    ]
    along, across = fabric_frames(mesh, warp)
    # Adding zero turns -0 into 0.
    rows = np.asarray(np.round(np.hstack([along, across]), DIGITS) + 0.0, float)
    frames = [
        {
            "set": name,
            "warp": rows[first_element, :3].tolist(),
            "fill": rows[first_element, 3:].tolist(),
        }
        for name, first_element in groups(rows, "frame")
    ]
    points = np.asarray(mesh.points, float).tolist()
    elements = (quads + 1).tolist()
    return {
        "points": points,
        "elements": elements,
        "sets": sets,
        "layers": layers,
        "frames": frames,
    }


def node_sets(mesh: Mesh, names: Mapping[str, Any] | list[str]) -> list[dict[str, Any]]:
    """Return the `define`s of the mesh's node sets of these names."""
    return [named_set("node", name.lower(), mesh.node_sets[name]) for name in names]


T = TypeVar("T")
#: Makes something of the .t19 file and the number of iterations.
Reader = Callable[[Path, int], T]


class MarcRun(Protocol):
    """Runs a deck in a scratch folder of its own."""

    def __call__(
        self, deck: str, units: int, read: Reader[T], rescue: Reader[T] | None = None
    ) -> T:
        """Return what `read` makes of the results to time `units`, or `rescue` of a bad end."""
