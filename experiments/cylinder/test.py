"""A cylinder in bending: its data and its model, of a membrane or of a beam."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from ...materials.card import MaterialCard
from ...materials.law import HypoelasticLaw
from ...meshes.beam_model import BeamModel
from ...meshes.cylinder_model import (
    Collar,
    Cord,
    CurveReading,
    CylinderModel,
    Gas,
    RigidSupports,
    inflated_cylinder,
)
from ...readers.bending import BendingCurve, bending_file_name
from ...readers.frames import FrameSource
from ..base import Reach, Refined, SectionTest
from ..data_files import DataFile, joined
from ..forward import divided

#: The one part of the test.
PART = "cylinder"
#: m/s^2 of self weight.
GRAVITY = 9.80665


@dataclass(frozen=True, eq=False, kw_only=True)
class CylinderTest(SectionTest):
    """One cylinder at one pressure.

    Parameters
    ----------
    diameter, length, seam_width, size : float
        Of the cylinder before inflation and of an element, mm.
    pressure : float
        Gauge pressure, MPa.
    symmetry, cap_warp, supports, collar, gas, reading, cords
        See `inflated_cylinder`.
    deflections : tuple of float
        Frames of the bending, mm.
    mass_per_area : float
        kg/m^2 of one layer.
    beam : BeamModel, optional
        The model in place of a membrane.
    measured : tuple of BendingCurve
        Repetitions that were measured.
    reads_files : bool
        Whether the section lists any.
    assumed : tuple of str
        What the section leaves to usual values, in words.
    """

    diameter: float
    pressure: float
    length: float
    seam_width: float
    size: float
    symmetry: Literal["quarter", "full"]
    cap_warp: Literal["x", "y"]
    supports: RigidSupports
    collar: Collar
    deflections: tuple[float, ...]
    gas: Gas
    reading: CurveReading
    cords: tuple[Cord, ...] = ()
    mass_per_area: float = 0.0
    beam: BeamModel | None = None
    measured: tuple[BendingCurve, ...] = ()
    reads_files: bool = False
    assumed: tuple[str, ...] = ()
    kind: str = "cylinder"
    #: The strains are known only with a card.
    reach = Reach()

    def data_files(self) -> Sequence[DataFile]:
        """Return the measured files, with how they were read."""
        return joined(
            DataFile(
                c.path or Path(bending_file_name(c)),
                c.source or FrameSource(),
                len(c.load),
                c.dropped,
                () if c.path is not None else (c.deflection, c.load),
            )
            for c in self.measured
            if c.path is not None or c.source is not None
        )

    @property
    def own_card(self) -> MaterialCard | None:
        """Return the wall of a beam as a card of constant moduli, of the fabric's thickness."""
        if self.beam is None:
            return None
        thickness = self.thick(None)
        axial, hoop, shear, nu = self.beam.section.wall.moduli
        law = HypoelasticLaw.linear(axial / thickness, hoop / thickness, shear / thickness, nu)
        return MaterialCard(law, thickness, "its wall")

    def model(self, thickness: float | None = None) -> CylinderModel | BeamModel:
        """Return the model with a fabric of this thickness (mm), else of the project's."""
        if self.beam is not None:
            return self.beam
        return inflated_cylinder(
            diameter=self.diameter,
            pressure=self.pressure,
            thickness=self.thick(thickness),
            size=self.size,
            length=self.length,
            seam_width=self.seam_width,
            supports=self.supports,
            collar=self.collar,
            deflections=self.deflections,
            symmetry=self.symmetry,
            cap_warp=self.cap_warp,
            gas=self.gas,
            reading=self.reading,
            cords=self.cords,
            weight=1e-6 * GRAVITY * self.mass_per_area,
        )

    def models(
        self, thickness: float | None = None, refined: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, CylinderModel | BeamModel]:
        """Return the one model, refined.

        Parameters
        ----------
        thickness : float, optional
            Of the fabric, mm; the project's unless given.
        refined : {"elements", "increments"}
            What is refined.
        factor : float
            By which edges, or every increment, are divided.
        """
        if refined == "elements":
            if self.beam is not None:
                return {PART: replace(self.beam, size=self.beam.size / factor)}
            return {PART: replace(self, size=self.size / factor).model(thickness)}
        model = self.model(thickness)
        steps = ("inflation", "increments") if self.beam is None else ("increments",)
        finer: dict[str, Any] = {
            name: divided(getattr(model, name), factor, "cylinder") for name in steps
        }
        return {PART: replace(model, **finer)}

    def settings(self) -> Mapping[str, object]:
        """Return everything but names, measurements and where the curve is read."""
        settings: dict[str, object] = {
            "diameter": self.diameter,
            "pressure": self.pressure,
            "length": self.length,
            "seam_width": self.seam_width,
            "size": self.size,
            "symmetry": self.symmetry,
            "cap_warp": self.cap_warp,
            "deflections": self.deflections,
            "mass_per_area": self.mass_per_area,
            "supports": asdict(self.supports),
            "collar": asdict(self.collar),
            "gas": asdict(self.gas),
        }
        if self.cords:
            settings["cords"] = repr(self.cords)
        if self.beam is not None:
            settings["beam"] = repr(self.beam)
        return settings
