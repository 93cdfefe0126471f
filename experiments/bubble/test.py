"""A bubble test as its section says, and the model of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from ...data.outline import Outline
from ...errors import InputError
from ...materials.law import HypoelasticLaw
from ...meshes.elliptic_disk import elliptic_disk_mesh
from ...meshes.facet_reading import Facet
from ...models.bubble import BubbleModel, default_increments
from ..base import MakeSolver, Place, Reach, Refined
from ..fittable import PreparedTest
from .filter_section import facet_of
from .increments import merge_increments
from .outline_section import outline_of
from .point_files import PointFiles, measured_files
from .section import BubbleSection, Symmetry
from .sheet_section import Sheet, sheet_of
from .sources import KnownSolution, data_source

PART = "bubble"
NO_PRESSURES = (
    "this key is missing; add it, or say in [bubble.data.points.pressure] where each frame's own"
    " stands"
)


@dataclass(frozen=True, eq=False, kw_only=True)
class BubbleTest:
    """A clamped disk that is inflated. Lengths mm, pressures MPa.

    `pressures` are reported and matched, `increments` are the load steps and contain them.
    `noise` (mm) of one measured displacement, None where it is not given. `facet` : by which the
    camera reads displacements, None for those of points.
    """

    name: str
    place: Place
    weight: float
    outline: Outline
    elements: int
    symmetry: Symmetry
    generator: Literal["blocks", "gmsh"]
    pressures: tuple[float, ...]
    increments: tuple[float, ...]
    data: KnownSolution | PointFiles
    match_by: Literal["surfaces", "points"]
    match_degree: int
    objective: Literal["e", "mm"]
    displacement_offset: bool
    pressure_offset: bool
    sheet: Sheet
    noise: float | None = None
    facet: Facet | None = None
    kind: str = "bubble"

    @property
    def radius(self) -> float:
        """Of the disk, mm; of an ellipse the mean of the semi-axes."""
        return self.outline.radius

    @property
    def thickness(self) -> float:
        """Of the fabric, mm."""
        return self.place.fabric.thickness

    @property
    def reach(self) -> Reach:
        """Nothing: how far a bubble is strained is known only when its law is."""
        return Reach()

    @property
    def reads_files(self) -> bool:
        """Not where its data are computed."""
        return isinstance(self.data, PointFiles)

    def model(
        self,
        thickness: float | None = None,
        elements: int | None = None,
        symmetry: Symmetry | None = None,
        increments: tuple[float, ...] | None = None,
    ) -> BubbleModel:
        """The test's model, or one of the same disk with another mesh or other increments.

        Raises
        ------
        InputError : a mesh that cannot be had.
        """
        mesh = elliptic_disk_mesh(
            self.outline, elements or self.elements, symmetry or self.symmetry, self.generator
        )
        thick = self.thickness if thickness is None else thickness
        return BubbleModel(mesh, thick, self.pressures, increments or self.increments)

    def models(
        self, thickness: float | None = None, what: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, BubbleModel]:
        """The one model; edges of its quads, or its increments, divided by a factor.

        Raises
        ------
        InputError : a mesh that cannot be had; increments to be joined.
        """
        own = self.model(thickness)
        if factor == 1:
            return {PART: own}
        if what == "elements":
            # From the count that the mesh has, not the one asked for: so that finer meshes divide
            # its quads, as far as there is such a mesh.
            whole = len(own.mesh.quads) * (4 if self.symmetry == "quarter" else 1)
            return {PART: self.model(thickness, elements=round(whole * factor**2))}
        if factor != int(factor):
            problem = "the bubble's steps are divided, never joined: use --coarser 0"
            raise InputError(None, "increments", problem)
        ends = (0.0, *self.increments)
        parts = [np.linspace(a, b, int(factor) + 1)[1:] for a, b in pairwise(ends)]
        steps = tuple(float(p) for part in parts for p in part)
        return {PART: self.model(thickness, increments=steps)}

    def settings(self) -> Mapping[str, object]:
        """Everything but names and places of files."""
        names = (
            "elements", "symmetry", "generator", "pressures", "increments", "match_by",
            "match_degree", "objective", "displacement_offset", "pressure_offset", "weight",
        )  # fmt: skip
        said: dict[str, object] = {name: getattr(self, name) for name in names}
        said["outline"] = asdict(self.outline)
        if self.facet is not None:
            said["filter"] = asdict(self.facet)
        if self.sheet != Sheet():
            said["sheet"] = asdict(self.sheet)
        if isinstance(self.data, PointFiles) and self.data.registration is not None:
            said["registration"] = asdict(self.data.registration)
        if isinstance(self.data, KnownSolution):
            known = asdict(self.data)
            said["known_solution"] = {**known, "beta": self.data.beta.tolist()}
        return said

    def prepare(self, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedTest:
        """Read the measured fields, or compute those of the known solution.

        Raises
        ------
        InputError : in the data. SolverFailure : the known solution cannot be run.
        """
        from .preparation import prepare

        return prepare(self, law, make_solver)


def read(section: BubbleSection, place: Place, name: str) -> BubbleTest:
    """The test of a section.

    Raises
    ------
    InputError : naming the file and the dotted key.
    """
    scales = place.scales
    asked = _pressures(section, place)
    measured = measured_files(section, place, asked)
    recorded = None if measured is None else measured.recorded
    pressures = asked if recorded is None else tuple(recorded.pressure.tolist())
    if pressures is None:
        raise place.error("pressures", NO_PRESSURES)
    increments = default_increments(pressures)
    if section.increments is not None:
        increments = merge_increments(place, "increments", section.increments, pressures)
    outline = outline_of(section, place)
    source = data_source(section, place, pressures, increments, measured)
    return BubbleTest(
        name=name,
        place=place,
        weight=section.weight,
        outline=outline,
        elements=section.elements,
        symmetry=section.symmetry,
        generator=section.generator,
        pressures=pressures,
        increments=increments,
        data=source,
        match_by=section.match.by,
        match_degree=section.match.degree,
        objective=section.objective,
        displacement_offset=section.nuisance.displacement_offset,
        pressure_offset=section.nuisance.pressure_offset,
        noise=None if section.noise is None else section.noise * scales.length,
        facet=facet_of(
            None if section.data.points is None else section.data.points.filter,
            place,
            scales.length,
            section.symmetry,
            section.match.by,
        ),
        sheet=sheet_of(
            section.sheet,
            place,
            pressures,
            section.symmetry,
            isinstance(source, PointFiles),
            section.nuisance.displacement_offset,
        ),
    )


def _pressures(section: BubbleSection, place: Place) -> tuple[float, ...] | None:
    given = section.pressures
    if given is None:
        return None
    for i in range(1, len(given)):
        if given[i] <= given[i - 1]:
            problem = f"pressures must increase, got {given[i]:g} after {given[i - 1]:g}"
            raise place.error(f"pressures[{i}]", problem)
    return tuple(p * place.scales.pressure for p in given)
