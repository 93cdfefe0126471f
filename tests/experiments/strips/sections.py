"""Sections of strips and their files, for the tests of what is read from them."""

import tomllib
from pathlib import Path

import numpy as np
from bubblefit.experiments.kinds import Fabric, Place, Scales
from bubblefit.experiments.strips import KIND
from bubblefit.experiments.strips.test import StripsSection, StripsTest
from bubblefit.readers.sections import LENGTH_UNITS, first_error
from pydantic import ValidationError

from ...places import EXAMPLES

CURVES = EXAMPLES / "uniaxial-valmex7318"
#: Table 3.1: gauge and final lengths, mm.
LENGTHS = {"warp": (20.022, 23.329), "fill": (22.780, 28.721), "bias": (19.767, 30.734)}
ENDS = {direction: float(np.log(b / a)) for direction, (a, b) in LENGTHS.items()}

#: The published polynomials, everything said.
PUBLISHED = """
width = 25.0
grip_distance = 75.0
bias_angle = 45.0
increments = 100
match = "polynomial"
objective = "N"

[data]
polynomials = "curves.csv"
"""

#: As little as there can be, and machine exports as they come: one file a direction.
SMALL = """
[warp]
gauge_length = 20.0

[fill]
gauge_length = 22.0

[bias]
gauge_length = 19.0

[data]
files = { warp = ["w1.csv", "w2.csv"], fill = ["f.TXT"], bias = ["b.csv"] }
"""


def ends(further: float) -> list[tuple[str, str]]:
    """Final lengths (mm) of the small section so much beyond its gauges."""
    gauges = {a: f"gauge_length = {a}.0" for a in (20, 22, 19)}
    return [(said, f"{said}\nfinal_length = {a + further}") for a, said in gauges.items()]


def read(
    path: Path, data_folder: Path | None = None, need_data: bool = True, length: str = "mm"
) -> StripsTest:
    try:
        section = StripsSection.model_validate(tomllib.loads(path.read_text()))
    except ValidationError as found:
        raise first_error(path, found, StripsSection, at="strips[0]") from None
    scales = Scales(length=LENGTH_UNITS[length], length_unit=length)
    place = Place(path, "strips[0]", Fabric("", 0.81), scales, data_folder, need_data)
    return KIND.read(section, place, section.name or "strips")


def rows(separator: str, *columns: np.ndarray, comma: bool = False) -> str:
    lines = [separator.join(f"{v:.6f}" for v in row) for row in zip(*columns, strict=True)]
    text = "\n".join(lines)
    return text.replace(".", ",") if comma else text


def write_exports(folder: Path):
    """MTS (warp, 200 N/mm, in kN), ZwickRoell (fill, 80 N/mm), Instron (bias, 50 N/mm)."""
    u = np.linspace(0, 4, 21)
    mts = "Test: cut strip\nTest Run: 3\n\nAxial Displacement,Axial Force,Running Time\nmm,kN,sec\n"
    (folder / "w1.csv").write_text(mts + rows(",", u, 0.2 * u, u))
    (folder / "w2.csv").write_text(mts + rows(",", 0.9 * u, 0.18 * u, u))
    zwick = (
        '"Prüfgeschwindigkeit"\t300\t"mm/min"\n"Prüfzeit"\t"Standardkraft"\t"Standardweg"\n'
        '"s"\t"N"\t"mm"\n'
    )
    text = zwick + rows("\t", u, 80 * u, u, comma=True)
    (folder / "f.TXT").write_bytes(text.encode("latin-1"))
    instron = "Specimen label,,\n\nTime,Extension,Load,Tensile stress\n(s),(mm),(N),(MPa)\n"
    # Two specimens one after the other.
    two = np.concatenate([u, u[:11]])
    (folder / "b.csv").write_text(instron + rows(",", two, two, 50 * two, two))
