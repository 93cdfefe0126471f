"""A test of a cylinder in bending: its data, and its model as a membrane or as a beam."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Literal

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
#: Acceleration of gravity, m/s^2, for the self weight.
GRAVITY = 9.80665


@dataclass(frozen=True, eq=False, kw_only=True)
class CylinderTest(SectionTest):
    """A bending test of one cylinder at one pressure.

    Parameters
    ----------
    diameter, length, seam_width : float
        Dimensions of the cylinder before inflation, mm.
    size : float
        Edge length of an element, mm.
    pressure : float
        Gauge pressure, MPa.
    symmetry, cap_warp, supports, collar, gas, reading, cords
        Arguments of the same names of `inflated_cylinder`.
    deflections : tuple of float
        Deflection of each frame of the bending, mm.
    mass_per_area : float
        Mass of one layer of fabric, kg/m^2.
    beam : BeamModel, optional
        Model of a beam, which takes the place of a membrane.
    measured : tuple of BendingCurve
        Measured repetitions.
    reads_files : bool
        Whether the section lists measured files.
    assumed : tuple of str
        Words on each key for which a usual value is assumed.
    """

    setting_names: ClassVar[tuple[str, ...]] = (
        "diameter",
        "pressure",
        "length",
        "seam_width",
        "size",
        "symmetry",
        "cap_warp",
        "deflections",
        "mass_per_area",
    )

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
    #: Strains that the test reaches are unknown: they depend on the card it is predicted with.
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
        """Return a beam's wall as a material card with constant moduli; None for a membrane."""
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
            Thickness of the fabric, mm; the project's unless given.
        refined : {"elements", "increments"}
            What is refined.
        factor : float
            Number by which edges of elements, or increments, are divided.
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
        settings = {
            **super().settings(),
            "supports": asdict(self.supports),
            "collar": asdict(self.collar),
            "gas": asdict(self.gas),
        }
        if self.cords:
            settings["cords"] = repr(self.cords)
        if self.beam is not None:
            settings["beam"] = repr(self.beam)
        return settings
