"""What a deck holds once it is read: plain data, numbers of nodes and elements as in the deck."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .parameters import Parameters

Array = NDArray[np.float64]


@dataclass
class Table:
    """A function, straight between its points."""

    number: int
    variable: int
    x: Array
    y: Array

    def at(self, x: float) -> float:
        return float(np.interp(x, self.x, self.y))


@dataclass
class Condition:
    """A boundary condition of any kind.

    kind: "fixed", "pressure" or "cavity"; of a fixed one dofs, values and tables (0: constant);
    of a pressure values and tables of one, kind_number its load type; of a cavity likewise,
    kind_number 1 pressure, 2 constant mass.
    """

    name: str
    kind: str
    on: str
    values: list[float]
    tables: list[int]
    dofs: list[int] = field(default_factory=list)
    kind_number: int = 0
    line: int = 0


@dataclass
class Material:
    """kind: "nlelast" (multipliers and tables of E1, E2, nu12, G12) or "hypoelastic"."""

    kind: str
    name: str
    on: str
    multipliers: list[float] = field(default_factory=list)
    tables: list[int] = field(default_factory=list)


@dataclass
class Body:
    """A contact body: patches (n, 4, 3) mm and the path of a rigid one."""

    name: str
    rigid: bool
    on: str = ""
    patches: Array | None = None
    table: int = 0
    direction: Array | None = None


@dataclass
class Control:
    """When an increment has converged: relative residual AND relative correction, and most
    iterations of one."""

    residual: float
    correction: float
    iterations: int


@dataclass
class LoadCase:
    """A block of history: increments (of `step`), what holds in it, when they have converged."""

    title: str
    conditions: list[str]
    increments: int
    step: float
    line: int = 0
    control: Control | None = None


@dataclass
class Content:
    """The whole deck. connectivity (elements, 4), coordinates (nodes, 3) in order of number."""

    parameters: Parameters
    connectivity: NDArray[np.int64] | None = None
    coordinates: Array | None = None
    node_sets: dict[str, NDArray[np.int64]] = field(default_factory=dict)
    element_sets: dict[str, NDArray[np.int64]] = field(default_factory=dict)
    tables: dict[int, Table] = field(default_factory=dict)
    material: Material | None = None
    frames: list[tuple[str, Array, Array]] = field(default_factory=list)
    thickness: list[tuple[float, str]] = field(default_factory=list)
    conditions: dict[str, Condition] = field(default_factory=dict)
    gas: tuple[float, float, float] | None = None
    gas_on: str = ""
    bodies: list[Body] = field(default_factory=list)
    initial: list[str] | None = None
    every: int = 0
    cases: list[LoadCase] = field(default_factory=list)
    has: list[str] = field(default_factory=list)
