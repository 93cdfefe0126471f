"""Parts that the Marc decks of all models share: law, load cases, supports, sets, and mesh."""

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
from ...meshes.mesh import Array, Mesh, Numbers, fabric_frames
from ...version import __version__
from ..decks import render
from ..prescribed import held_dofs
from .settings import MarcSettings

#: Residual force and displacement, relative (thesis, section 2.2).
TOLERANCE = 1e-3
MEMBRANE = 18
THICK = 75


def law_context(law: HypoelasticLaw, settings: MarcSettings) -> dict[str, Any]:
    """Return the variables of the templates for the law; InputError if NLELAST cannot apply it."""
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
    """Return the variables of the templates for load cases.

    Parameters
    ----------
    cases : sequence of (str, int, sequence of str)
        Name, number of the law's increments, and boundary conditions of each. An increment of the
        law is divided so that there are at least `settings.increments` increments of Marc in all.
    """
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
    name: str,
    members: str,
    dofs: Sequence[int],
    values: Sequence[float] = (),
    table: int = 0,
) -> dict[str, Any]:
    """Return a boundary condition FIXED DISP on the node set `members`.

    Parameters
    ----------
    dofs : sequence of int
        Degrees of freedom, from 0.
    values : sequence of float
        Prescribed displacements, zero unless given; those that are not zero are multiplied by the
        table of the number `table`.
    """
    amounts = list(values) or [0.0] * len(dofs)
    return {
        "name": name,
        "set": members,
        "dofs": [dof + 1 for dof in dofs],
        "amounts": amounts,
        "tables": [table if value else 0 for value in amounts],
    }


def supports(dofs_by_set: Mapping[str, Sequence[int]], element: int) -> list[dict[str, Any]]:
    """Return boundary conditions, named `fix_SET`, that hold directions of node sets at zero."""
    return [
        fixed(f"fix_{name.lower()}", name.lower(), dofs if element == MEMBRANE else held_dofs(dofs))
        for name, dofs in dofs_by_set.items()
    ]


def time_table(number: int, name: str, values: Sequence[float]) -> dict[str, Any]:
    """Return a table of Marc over time, with `values` at the times 0, 1, 2, ..."""
    points = [[time, value] for time, value in enumerate(values)]
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
    """Return the text of a deck.

    The arguments are those of the functions of this module whose results they take; `context` has
    further variables of the template. InputError if a template cannot be used, or as `law_context`.
    """
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
#: Number of digits to which unit vectors are compared.
DIGITS = 9


def set_lines(numbers: Numbers) -> list[str]:
    """Return the lines in which Marc lists the members of a set, sorted numbers from 0.

    Consecutive numbers are written as `a to b`; a line that is continued ends with ` c`.
    """
    items = []
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) != 1) + 1)
    for run in runs:
        first = run[0] + 1
        last = run[-1] + 1
        if len(run) > 2:
            items.append(f"{first:10d} to {last:d}")
        else:
            items += [f"{n + 1:10d}" for n in run.tolist()]
    rows = [items[i : i + PER_LINE] for i in range(0, len(items), PER_LINE)]
    return ["".join(row) + (" c" if row is not rows[-1] else "") for row in rows]


def named_set(kind: str, name: str, numbers: Numbers) -> dict[str, Any]:
    """Return a set of nodes or elements for the block `define`.

    Parameters
    ----------
    kind : {"node", "element"}
    name : str
    numbers : (n,) array of int
        From 0.

    Raises
    ------
    InputError
        Marc does not take the name, or the set is empty.
    """
    if not re.fullmatch(r"[a-z0-9_]{1,28}", name):
        problem = f"{name!r}: Marc takes at most 28 letters, digits and _; rename the set"
        raise InputError(None, f"{kind} set", problem)
    if not len(numbers):
        raise InputError(None, f"{kind} set {name}", "holds nothing; mend the mesh")
    return {"kind": kind, "name": name, "lines": set_lines(np.sort(numbers))}


def fabric_context(mesh: Mesh, warp: Array, thickness: Array | float) -> dict[str, Any]:
    """Return the variables of the templates for mesh, directions of the yarns, and thicknesses.

    `sets` among them holds sets of elements only; see `node_sets` for those of nodes.

    Parameters
    ----------
    mesh : Mesh
    warp : (3,) or (quads, 3) array
        Direction of the warp.
    thickness : (quads,) array or float, mm
    """
    quads = np.asarray(mesh.quads)
    everything = np.arange(len(quads))
    sets = [named_set("element", FABRIC, everything)]

    def groups(values: Array, name: str) -> list[tuple[str, int]]:
        """Return, for each different row of `values`, the set of its elements and one of them."""
        _, group_of = np.unique(values, axis=0, return_inverse=True)
        group_of = group_of.ravel()
        count = group_of.max() + 1
        if count == 1:
            return [(FABRIC, 0)]
        named_groups = []
        for number in range(count):
            members = np.flatnonzero(group_of == number)
            named_groups.append((f"{name}_{number + 1}", members[0]))
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
    """Return the mesh's node sets of these names for the block `define`."""
    return [named_set("node", name.lower(), mesh.node_sets[name]) for name in names]


T = TypeVar("T")
#: Function that reads results, from the .t19 file and the number of iterations.
Reader = Callable[[Path, int], T]


class MarcRun(Protocol):
    """A function that runs Marc on a deck, in a scratch folder of its own."""

    def __call__(
        self,
        deck: str,
        units: int,
        read: Reader[T],
        rescue: Reader[T] | None = None,
    ) -> T:
        """Run a deck to the total time `units` and return what `read` returns for the results.

        Parameters
        ----------
        rescue
            Reads the results of a run that stopped early.
        """
