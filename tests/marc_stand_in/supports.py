"""Which nodes a deck holds, as the models have it."""

from __future__ import annotations

from typing import Any

import numpy as np
from bubblefit.meshes.mesh import Mesh

from .content import Content


def held(content: Content, names: list[str]) -> dict[int, tuple[int, ...]]:
    """By node (from 0): translations (0 to 2) that these conditions hold at zero."""
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
    """The mesh, with a node set for each way of being held, and what each holds."""
    assert content.connectivity is not None and content.coordinates is not None
    ways: dict[tuple[int, ...], list[int]] = {}
    for node, dofs in nodes.items():
        ways.setdefault(dofs, []).append(node)
    names = {f"held_{''.join(map(str, dofs))}": dofs for dofs in ways}
    groups = {f"held_{''.join(map(str, dofs))}": np.array(on) for dofs, on in ways.items()}
    quads = (content.connectivity - 1).astype(np.intp)
    return Mesh(content.coordinates, quads, {**groups, **sets}), names
