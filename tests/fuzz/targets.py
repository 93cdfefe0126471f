"""Every reader of bubblefit with valid files of its formats, which mutations begin from."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import meshio
import numpy as np
from bubblefit.errors import InputError
from bubblefit.experiments.base import Reach
from bubblefit.experiments.biaxial.paths import read_biaxial_table
from bubblefit.materials.card import MaterialCard, read_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.readers import mat_files, values_in_files
from bubblefit.readers.bending import read_bending_curves
from bubblefit.readers.curves import read_load_curves, read_published_polynomials
from bubblefit.readers.fields import read_fields
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.histories import read_pressure_log
from bubblefit.readers.machine_tables import Channel, read_machine_loads, read_times
from bubblefit.readers.registry import format_names
from bubblefit.readers.units import PRESSURE_UNITS
from bubblefit.readers.values_in_files import values_in_file
from bubblefit.runs.law_setup import bounds_of, law_of
from bubblefit.solvers.calculix.frd import FrdFile
from bubblefit.solvers.export_formats import FORMATS
from bubblefit.solvers.marc.settings import site_settings
from bubblefit.solvers.marc.solver import exit_number, increments, repeated
from bubblefit.solvers.marc.t19 import T19File
from openpyxl import Workbook

from ..builders import camera_exports, projects
from ..builders.biaxial_tests import BENT_LAW, HEAD, biaxial_rows, write_biaxial_rows
from ..builders.frd_files import frd_frames, write_frd
from ..marc_stand_in.files import sts_text, t19_text
from ..support.paths import EXAMPLES, ROOT

# A damaged HDF5 file is given up sooner than a user's.
mat_files.SECONDS = values_in_files.SEARCH_SECONDS = 2.0

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
WEG = "Weg in mm; Kraft in kN;\n-0,01;-0,00002;\n0,25;0,1005;\n;;\n"
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
    options = FrameOptions(planar=True)
    names = format_names("frame")
    with suppress(InputError):
        read_frames([path], options, names[path.stat().st_size % len(names)])
    try:
        frames = read_frames([path], options)
    except InputError as error:
        assert str(path) in str(error)
        raise
    for frame in frames:
        assert frame.points.shape == frame.displacement.shape and frame.points.shape[1:] == (3,)
        assert not np.isinf(frame.points).any() and not np.isinf(frame.displacement).any()
    for field in read_fields([path], range(len(frames)), options=options):
        assert len(field.points) == len(field.displacement) > 0
        assert np.isfinite(field.points).all() and np.isfinite(field.displacement).all()


def _machine(path: Path) -> None:
    for read in (read_load_curves, read_machine_loads):
        with suppress(InputError):
            read(path)
    with suppress(InputError):
        for curve in read_load_curves(path, direction="fill"):
            assert len(curve.load) == len(curve.elongation) > 0
            assert np.isfinite([curve.load, curve.elongation]).all()
    with suppress(InputError):
        read_times(path)


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
    with TemporaryDirectory() as name:
        return _targets(Path(name))


def _targets(folder: Path) -> dict[str, Target]:
    without_data = {"deck-picture-frame", "etfe-foil", "soft-membranes", "strips-nylon"}
    toml = [
        path.read_bytes()
        for path in sorted(EXAMPLES.glob("*/*.toml"))
        if path.parent.name not in without_data
    ]
    # Those whose data lie beside them are left out.
    ours = [
        content for content in toml
        if b"[fabric]" in content and b"datasheet" not in content and b"curves.csv" not in content
    ]  # fmt: skip
    ours += [projects.CONSTANT_BUBBLE.encode(), projects.CONSTANT_STRIPS.encode()]
    site = (ROOT / "docs" / "how-to" / "marc.md").read_text().split("```toml\n")[1].split("```")[0]
    curves = (EXAMPLES / "uniaxial-valmex7318" / "curves.csv").read_text()
    biaxial = write_biaxial_rows(
        folder / "b.csv", biaxial_rows(BENT_LAW, ("1:1", "2:1"), rows=6), HEAD
    ).read_text()
    found = {
        "project": Target(".toml", ours, _project),
        "card": Target(".toml", _cards(folder), _card),
        "frd": Target(".frd", [_frd(folder, flag) for flag in (1, 2, 3)], _result(FrdFile)),
    }
    for name, suffix, read, *texts in (
        ("site", ".toml", site_settings, site),
        ("machine", ".csv", _machine, MACHINE, MACHINE.replace(";", "\t"), WEG),
        ("pressure log", ".csv", read_pressure_log, LOG),
        ("pressure in file", ".csv", _value, "# pressure [kPa] = 35.5\nx,y\n1,2\n", SAME),
        ("bending", ".csv", read_bending_curves, BENDING),
        ("biaxial", ".csv", read_biaxial_table, biaxial),
        ("polynomials", ".csv", read_published_polynomials, curves),
        ("t19", ".t19", _result(T19File), _t19()),
        ("sts", ".sts", _status, sts_text([0.1, 0.2, 1.0])),
    ):
        found[name] = Target(suffix, [text.encode() for text in texts], read)
    for case, (_, write) in {**camera_exports.EXPORTS, "ncorr": ("", camera_exports.ncorr)}.items():
        place = folder / case
        place.mkdir()
        frames = [(np.abs(POINTS), FRAMES[0][1])] if case == "ncorr" else FRAMES
        file = write(place, frames)[0]
        found[f"frame {case}"] = Target(file.suffix, [file.read_bytes()], _frames)
    book, rows = (
        Workbook(),
        [["elongation (mm)", "load (N)"], *([k / 9, 5.0 * k] for k in range(20))],
    )
    for row in rows:
        book.active.append(row)
    book.save(folder / "s.xlsx")
    found["workbook"] = Target(".xlsx", [(folder / "s.xlsx").read_bytes()], _machine)
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


def _value(path: Path) -> float:
    return float(values_in_file(path, Channel("pressure"), PRESSURE_UNITS)[0])


def _frd(folder: Path, flag: int) -> bytes:
    return write_frd(folder / "job.frd", frd_frames(2), flag).read_bytes()


def _t19() -> str:
    random = np.random.default_rng(5)
    names = ("Displacement", "Reaction Force")
    frames = [(float(i), {n: random.normal(size=(6, 3)) for n in names}) for i in range(2)]
    return t19_text(POINTS, QUADS, frames)
