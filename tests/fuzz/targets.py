"""Every reader of bubblefit with valid files of its formats, which mutations begin from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import meshio
import numpy as np
from bubblefit.experiments.biaxial.data import read_biaxial_table
from bubblefit.experiments.kinds import Reach
from bubblefit.materials.card import MaterialCard, read_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.readers import hdf5_files
from bubblefit.readers import names as name_numbers
from bubblefit.readers.bending import read_bending_curves
from bubblefit.readers.columns import PRESSURE_UNITS
from bubblefit.readers.curves import read_load_curves, read_published_polynomials
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.machine_tables import Channel, read_machine_loads, read_times
from bubblefit.readers.names import value_in_file
from bubblefit.readers.pressure_log import read_pressure_log
from bubblefit.readers.surfaces import read_surfaces
from bubblefit.runs.setup import bounds_of, law_of
from bubblefit.solvers.calculix.frd import FrdFile
from bubblefit.solvers.marc.job import exit_number, increments, repeated
from bubblefit.solvers.marc.settings import site_settings
from bubblefit.solvers.marc.t19 import T19File
from bubblefit.solvers.registry import FORMATS

from .. import dic_exports, projects
from ..biaxial_files import BENT, HEAD, rows_of, write_rows
from ..marc_files import sts_text, t19_text
from ..places import EXAMPLES, ROOT
from ..solvers.calculix import test_frd

# A damaged HDF5 file is given up sooner than a user's.
hdf5_files.SECONDS = name_numbers.SECONDS = 2.0

#: What the data of a test would say of the law.
REACH = Reach((0.2, 0.2, 0.5), ((0.3, 0.6), (0.3, 0.6), (0.3, 0.6)))
POINTS = np.array([[1.0, 2, 0.5], [4, -5, 0.25], [7, 8, -1], [0, 3, 0], [2, 2, 1], [3, 1, 1]])
FRAMES = [(POINTS, 0.01 * POINTS[:, [1, 0, 2]] + 0.02)]
QUADS = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
CARD = """format = 3
name = "a"
law = "hypoelastic orthotropic"
form = "FORM"
unit = "GPa"
beta = [0, 0, 0, 0.08, 0, 0, 0, 0.4, 0, 0, 0, 0.8]
nu12 = 0.24
thickness_mm = 0.81
thickness_change = "constant"
[valid_strain]
warp = [0.0, 0.07]
fill = [0.0, 0.1]
shear = [0.0, 0.3]
"""
MACHINE = "\n".join(
    ["Prüfung;12", "Datum;1.2.2020", "", "Zeit;Weg;Kraft", "s;mm;N"]
    + [f"{i},5;{0.1 * i:.3f};{2 * i}".replace(".", ",") for i in range(12)]
)
LOG = "time [s],pressure [kPa]\n" + "\n".join(f"{i},{3.5 * i}" for i in range(12))
SAME = "x [mm],pressure [kPa]\n" + "\n".join(f"{i},35.5" for i in range(12))
BENDING = "deflection [mm],load [N]\n" + "\n".join(f"{i},{12.5 * i}" for i in range(12))


@dataclass(frozen=True)
class Target:
    """A reader: suffix of its files, valid contents of them, and what reads one."""

    suffix: str
    seeds: Sequence[bytes]
    read: Callable[[Path], object]


def _project(path: Path) -> None:
    project = read_project(path, need_data=False)
    law = law_of(project, [REACH])
    if project.law.bounds is not None:  # one that only predicts has none
        bounds_of(project, law.form)


def _card(path: Path) -> None:
    card = read_card(path)
    card.law.E1(0.01), card.law.G12(np.linspace(-1, 1, 5))
    for name in ("csv", "abaqus-umat", "ls-dyna-mat34"):
        if name in FORMATS:
            FORMATS[name].export(card)


def _frames(path: Path) -> None:
    for frame in read_frames([path], FrameOptions(planar=True)):
        assert frame.points.shape == frame.displacement.shape and frame.points.shape[1:] == (3,)
        assert not np.isinf(frame.points).any() and not np.isinf(frame.displacement).any()


def _machine(path: Path) -> None:
    for read in (read_load_curves, read_machine_loads, read_times):
        try:
            read(path)
        except Exception as error:
            failed = error
        else:
            failed = None
        if failed is not None and read is read_times:
            raise failed
        if failed is not None and type(failed).__name__ != "InputError":
            raise failed


def _result(kind: Callable[[Path], FrdFile | T19File]) -> Callable[[Path], None]:
    def read(path: Path) -> None:
        for ended in (False, True):
            for frame in kind(path).frames(ended):
                for values in frame.fields.values():
                    assert len(values) <= path.stat().st_size
        meshio.read(path)

    return read


def _status(path: Path) -> None:
    repeated(increments(path))
    number = exit_number(path)
    assert number is None or number >= 0


@cache
def targets() -> dict[str, Target]:
    """Every reader by name."""
    with TemporaryDirectory() as name:
        return _targets(Path(name))


def _targets(folder: Path) -> dict[str, Target]:
    def text(content: str) -> bytes:
        return content.encode()

    toml = [path.read_bytes() for path in sorted(EXAMPLES.glob("*/*.toml"))]
    ours = [content for content in toml if b"[fabric]" in content and b"datasheet" not in content]
    # Those whose data lie beside them are left out.
    ours = [content for content in ours if b"curves.csv" not in content]
    found = {
        "project": Target(".toml", [*ours, text(projects.BUBBLE), text(projects.STRIPS)], _project),
        "card": Target(".toml", _cards(folder), _card),
        "site": Target(".toml", [_site()], site_settings),
        "machine": Target(".csv", [text(MACHINE), text(MACHINE.replace(";", "\t"))], _machine),
        "pressure log": Target(".csv", [text(LOG)], read_pressure_log),
        "pressure in file": Target(
            ".csv", [text("# pressure [kPa] = 35.5\nx,y\n1,2\n"), text(SAME)], _value
        ),
        "bending": Target(".csv", [text(BENDING)], read_bending_curves),
        "biaxial": Target(".csv", [_biaxial(folder)], read_biaxial_table),
        "surfaces": Target(".csv", [_surfaces(folder)], read_surfaces),
        "polynomials": Target(".csv", [_curves()], read_published_polynomials),
        "frd": Target(".frd", [_frd(folder, flag) for flag in (1, 2, 3)], _result(FrdFile)),
        "t19": Target(".t19", [_t19()], _result(T19File)),
        "sts": Target(".sts", [text(sts_text([0.1, 0.2, 1.0]))], _status),
    }
    for case, (_, write) in {**dic_exports.EXPORTS, "ncorr": ("", dic_exports.ncorr)}.items():
        place = folder / case
        place.mkdir()
        frames = [(np.abs(POINTS), FRAMES[0][1])] if case == "ncorr" else FRAMES
        file = write(place, frames)[0]
        found[f"frame {case}"] = Target(file.suffix, [file.read_bytes()], _frames)
    return found


def _cards(folder: Path) -> list[bytes]:
    breaks = np.array([[0.01, 0.02]] * 3)
    moduli = np.array([[800.0, 700.0, 600.0], [400.0, 300.0, 200.0], [10.0, 20.0, 30.0]])
    law = HypoelasticLaw.trilinear(*moduli, breaks, 0.24, np.array([0.07, 0.1, 0.3]))
    MaterialCard(law, 0.81, "a").write(folder / "card.toml")
    return [
        (folder / "card.toml").read_bytes(),
        *(CARD.replace("FORM", form).encode() for form in ("cubic", "constant")),
    ]


def _site() -> bytes:
    document = (ROOT / "docs" / "how-to" / "marc.md").read_text()
    return document.split("```toml\n")[1].split("```")[0].encode()


def _value(path: Path) -> float:
    return value_in_file(path, Channel("pressure"), PRESSURE_UNITS)


def _biaxial(folder: Path) -> bytes:
    return write_rows(folder / "b.csv", rows_of(BENT, ("1:1", "2:1"), rows=6), HEAD).read_bytes()


def _surfaces(folder: Path) -> bytes:
    from bubblefit.readers.fields import DisplacementField
    from bubblefit.readers.surfaces import fit_surface, write_surfaces

    angle = np.linspace(0, 60, 60)
    points = np.stack([angle * np.cos(angle), angle * np.sin(angle)], axis=1)
    field = DisplacementField(0.3, points, 0.01 * np.stack([*points.T, points[:, 0]], axis=1))
    write_surfaces([fit_surface(field, 2)], folder / "s.csv")
    return (folder / "s.csv").read_bytes()


def _curves() -> bytes:
    return (EXAMPLES / "uniaxial-valmex7318" / "curves.csv").read_bytes()


def _frd(folder: Path, flag: int) -> bytes:
    return test_frd.write(folder / "job.frd", test_frd.frames(2), flag).read_bytes()


def _t19() -> bytes:
    random = np.random.default_rng(5)
    names = ("Displacement", "Reaction Force")
    frames = [(float(i), {n: random.normal(size=(6, 3)) for n in names}) for i in range(2)]
    return t19_text(POINTS, QUADS, frames).encode()
