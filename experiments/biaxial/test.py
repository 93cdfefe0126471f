"""A biaxial test as its section says, and the models of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...data.biaxial.paths import BiaxialPath
from ...materials.law import HypoelasticLaw
from ...models.patch import PatchModel
from ..base import MakeSolver, Place, Reach, Refined
from .reading import BiaxialData, read_biaxial
from .section import BiaxialSection

if TYPE_CHECKING:
    from .prepared import PreparedBiaxial

#: Strains below it are none that a law could be fitted over.
LEAST_STRAIN = 1e-4


@dataclass(frozen=True, eq=False, kw_only=True)
class BiaxialTest:
    """A cruciform loaded along warp and fill. Loads N/mm (kN/m), strains as shares.

    `noise` of one measured strain, None where it is not given.
    """

    name: str
    place: Place
    weight: float
    data: BiaxialData
    section: BiaxialSection
    noise: float | None = None
    kind: str = "biaxial"

    @property
    def reads_files(self) -> bool:
        """Yes: a biaxial test is measured."""
        return True

    @property
    def reach(self) -> Reach:
        """The largest strains along warp and fill."""
        return reach_of(self.data.paths)

    def models(
        self, thickness: float | None = None, what: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, PatchModel]:
        """A patch for each ratio, driven by the loads as they were measured.

        Nothing is there to be refined: one point of the law, one increment a reading.
        """
        thick = self.place.fabric.thickness if thickness is None else thickness
        return {path.ratio: PatchModel(path.load, thick) for path in self.data.paths}

    def settings(self) -> Mapping[str, object]:
        """What of the section a result depends on; the data count by themselves."""
        return {"weight": self.weight, "noise": self.noise}

    def prepare(self, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedBiaxial:
        """The test as it is: its files were read with its section."""
        from .prepared import PreparedBiaxial

        return PreparedBiaxial(self)


def reach_of(paths: Sequence[BiaxialPath]) -> Reach:
    """The largest strains along warp and fill; of the shear a test tells nothing."""
    if not paths:
        return Reach()
    ends = np.max([path.strain.max(axis=0) for path in paths], axis=0)
    warp, fill = (float(np.log1p(end)) if end > LEAST_STRAIN else None for end in ends)
    return Reach((warp, fill, None))


def read(section: BiaxialSection, place: Place, name: str) -> BiaxialTest:
    """The test of a section, and its files.

    Raises
    ------
    InputError : naming the file and the dotted key, or a data file.
    """
    noise = None if section.noise is None else 0.01 * section.noise
    return BiaxialTest(
        name=name,
        place=place,
        weight=section.weight,
        data=read_biaxial(place, section),
        section=section,
        noise=noise,
    )
