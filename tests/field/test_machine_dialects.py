"""Field: load curves as the programs of test machines write them."""

import numpy as np
import pytest
from bubblefit.experiments.biaxial.paths import read_biaxial_table
from bubblefit.readers.curves import read_load_curves
from bubblefit.readers.histories import read_pressure_log

from ..readers.cases import TESTXPERT, read_export
from ..support.refusals import complaint_with

#: A strip of 800 MPa, 0.8 mm by 50 mm, over 50 mm: load in N, elongation in mm.
ELONGATION = np.linspace(0.0, 5.0, 61)
LOAD = 800.0 * 0.8 * ELONGATION
ZWICK = ["testXpert", "Kunde;M\u00fcller & S\u00f6hne", "Datum;12.03.2021", "Vorkraft;2;N"]


def with_decimal_comma(value: float, places: int = 3) -> str:
    return f"{value:,.{places}f}".translate(str.maketrans(",.", ".,"))


def comma_separated(value: float) -> str:
    return f"{value:.5f}".replace(".", ",")


def rows_of(*columns, form="{:.6f}", separator=","):
    text = [[c if isinstance(c, str) else form.format(c) for c in one] for one in columns]
    return [separator.join(row) for row in zip(*text, strict=True)]


def separated_by_blanks(mark: str) -> list[str]:
    loads = [f"{load:,.2f}".replace(",", mark) for load in LOAD]
    return ["Extension (mm);Load (N)", *rows_of(ELONGATION, loads, separator=";")]


TIMED = ["Time (s),Extension (mm),Load (N)", *rows_of(np.arange(61), ELONGATION, LOAD)]
LOST = [f"{load:.6f}" if i % 20 else "---" for i, load in enumerate(LOAD, 1)]
QUOTED = [f'"{u:.6f}","{load:,.3f}"' for u, load in zip(ELONGATION, LOAD, strict=True)]
WHOLE = [f"{load:,.0f}" for load in LOAD[::3]]
STRIPS = {
    "Zwick": (
        [
            *ZWICK,
            "Standardweg;Feindehnung;Standardkraft",
            "mm;mm;N",
            *rows_of(
                *(list(map(comma_separated, y)) for y in (2 * ELONGATION, ELONGATION, LOAD)),
                separator=";",
            ),
        ],
        "cp1252",
        61,
        1,
    ),
    "Instron": (["Extension,Load", '"(mm)","(N)"', *QUOTED], "utf-8", 61, 0),
    "German thousands": (
        [
            "Weg [mm];Kraft [N]",
            *rows_of(
                list(map(comma_separated, ELONGATION)),
                list(map(with_decimal_comma, LOAD)),
                separator=";",
            ),
        ],
        "latin-1",
        61,
        0,
    ),
    **{
        f"blank {ord(mark)}": (separated_by_blanks(mark), "utf-8", 61, 0)
        for mark in " '\u00a0\u202f"
    },
    "means below": ([*TIMED, "Mean,2.5,1600", "Std. dev.,1.5,940"], "utf-8", 61, 1),
    "a label behind": (
        [f"{TIMED[0]},Specimen", *(f"{row},A" for row in TIMED[1:]), "9,2.5,1600,Mean"],
        "utf-8",
        61,
        1,
    ),
    "signs below": ([*TIMED, "x\u0304,2.5,1600", "s,1.5,940", "95% conf.,0,9"], "utf-8", 61, 1),
    "results below": (
        [*TIMED, "", "Results", ",F (N),E (MPa)", "1,3200,800", "Mean,3200,800"],
        "utf-8",
        61,
        1,
    ),
    "means of two columns": (
        ["Extension (mm),Load (N)", *rows_of(ELONGATION, LOAD), "", "Mittelwert,1600"],
        "latin-1",
        61,
        1,
    ),
    "lost readings": (
        ["Weg [mm];Kraft [N]", *rows_of(ELONGATION, LOST, separator=";")],
        "utf-8",
        58,
        1,
    ),
    "rows of a clock alone": (
        [f"{k},," if k in (20, 40) else row for k, row in enumerate(TIMED)],
        "utf-8",
        59,
        1,
    ),
    "a column twice": (
        ["Load (N),Extension (mm),Load (N)", *rows_of(LOAD, ELONGATION, LOAD)],
        "utf-8",
        61,
        0,
    ),
    "kgf, UTF-16": (
        [
            "Load(kgf)\tExtension(\u00b5m)",
            *rows_of(LOAD / 9.80665, 1e3 * ELONGATION, separator="\t"),
        ],
        "utf-16",
        61,
        0,
    ),
    **{
        f"label {word!r}": (
            [f"{TIMED[0]},Note", *(f"{row}," for row in TIMED[1:]), f"60,9,20,{word}"],
            "utf-8",
            61,
            1,
        )
        for word in ("min", "Max", "Std. dev.", "Standard deviation", "Spannweite")
    },
    "thousands of whole numbers": (
        ["Extension (mm);Load (N)", *rows_of(ELONGATION[::3], WHOLE, separator=";")],
        "utf-8",
        21,
        0,
    ),
    "German thousands of whole numbers": (
        [
            "Weg [mm];Kraft [N]",
            *rows_of(
                [comma_separated(u) for u in ELONGATION[::3]],
                [load.replace(",", ".") for load in WHOLE],
                separator=";",
            ),
        ],
        "utf-8",
        21,
        0,
    ),
    "channels below the units": (
        ["Weg\tKraft", "mm\tN", "Channel 1\tChannel 2", *rows_of(ELONGATION, LOAD, separator="\t")],
        "utf-8",
        61,
        0,
    ),
    "types above the units": (
        ["Weg\tKraft", "Laser\tFloat64", "mm\tN", *rows_of(ELONGATION, LOAD, separator="\t")],
        "utf-8",
        61,
        0,
    ),
    **{
        f"{length}, {load}": (
            [
                "Extension,Load",
                f"{length},{load}",
                *rows_of(ELONGATION / mm, LOAD / newton, form="{:.9f}"),
            ],
            "utf-8",
            61,
            0,
        )
        for length, mm in {"in": 25.4, "inch": 25.4, "Inches": 25.4, "ft": 304.8}.items()
        for load, newton in {"lb": 4.44822, "lbs": 4.44822, "g": 9.80665e-3, "kg": 9.80665}.items()
    },
    **{
        head: ([head, *rows_of(ELONGATION / mm, LOAD / newton, form="{:.9f}")], "utf-8", 61, 0)
        for head, mm, newton in (
            ('Extension ["],Load (ozf)', 25.4, 0.278013851),
            ("Extension (mils),Load (oz)", 0.0254, 0.278013851),
            ("Extension in mil,Load [kip]", 0.0254, 4448.22162),
        )
    },
    "inches at the end": (
        ["Extension in,Load_lb", *rows_of(ELONGATION / 25.4, LOAD / 4.44822)],
        "utf-8",
        61,
        0,
    ),
    "pounds per inch": (
        ["Extension (in),Load (lbf/in)", *rows_of(ELONGATION / 25.4, LOAD / 50 / 0.1751268352)],
        "utf-8",
        61,
        0,
    ),
    "blanks": (
        [
            "extension_mm  force_kN",
            *rows_of(ELONGATION, LOAD / 1e3, form="{:.6E}", separator="   "),
        ],
        "utf-8",
        61,
        0,
    ),
}


@pytest.mark.parametrize("name", STRIPS)
def test_strips_of_test_machines_are_read_as_written(tmp_path, name):
    lines, encoding, count, notes = STRIPS[name]
    path = tmp_path / "a.txt"
    path.write_bytes("\r\n".join(lines).encode(encoding))
    (curve,) = read_load_curves(path, direction="warp", width=50.0)
    assert (len(curve.load), len(curve.notes)) == (count, notes)
    np.testing.assert_allclose(curve.load, 640.0 * curve.elongation, rtol=2e-4, atol=6e-3)
    assert curve.elongation.max() == pytest.approx(5.0, rel=1e-5)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        # Integers with one mark may be decimals; a word in the midst is no summary.
        (["Weg [mm];Kraft [N]", "1,250;1.013", "2,500;2.026"], ["line 2", "'1,250'"]),
        (["Weg [mm];Kraft [N]", "0;0", "1;12.34,5"], ["line 3", "'12.34,5'"]),
        (["Weg [mm];Kraft [N]", "0;1,013", "2;2,026"], ["line 2", "'1,013'"]),
        (["Weg [mm];Kraft [N]", "0;101", "2.5;1,013.5", "3;2,13"], ["line 4", "'2,13'"]),
        ([*TIMED[:9], "", "pause,,", *TIMED[9:]], ["line 11", "found nothing"]),
        (["Weg [mm];Kraft [N]", "0;---", "1;---", "2;5"], ["line 2", "'---'; so in 1 more row"]),
        (["Weg [mm];Kraft [N];Weg [mm]", "0;0;1", "1;5;2"], ["'Weg [mm]' appears twice"]),
        (["extension_mm load_N", "0 0", "1 2 3"], ["line 3", "expected 2 cells"]),
    ],
)
def test_ambiguous_numbers_are_refused(tmp_path, lines, words):
    path = tmp_path / "a.txt"
    path.write_text("\n".join(lines))
    complaint_with([str(path), *words], read_load_curves, path, direction="warp")


def test_logs_and_biaxial_tables_leave_out_lost_readings(tmp_path):
    path = tmp_path / "a.csv"
    stamps = [f"2021-03-12T14:02:{second:06.3f}" for second in range(9)]
    values = [f"{p:.3f}" if p != 4 else "NaN" for p in range(9)]
    path.write_text("\n".join(["timestamp,Druck [mbar]", *rows_of(stamps, values), "Mean,4"]))
    time, pressure = read_pressure_log(path)
    np.testing.assert_allclose(time - time[0], [0, 1, 2, 3, 5, 6, 7, 8])
    np.testing.assert_allclose(pressure, 1e-4 * (time - time[0]), rtol=1e-12)
    names = "Kraft Kette;Kraft Schuss;Dehnung Kette;Dehnung Schuss"
    path.write_bytes(
        f"{names}\nlbf/in;lbf/in;%;%\n0;0;0;0\n---;1;1;1\n10;5;1,5;2\n".encode("latin-1")
    )
    table = read_biaxial_table(path)
    np.testing.assert_allclose(table.load, [[0, 0], [1.751268352, 0.875634176]], rtol=1e-8)
    np.testing.assert_allclose(table.strain, [[0, 0], [0.015, 0.02]], rtol=1e-12)
    assert len(table.source.notes) == 1


#: Instron Bluehill: properties, then names and bracketed units; with a German setting every
#: number is a quoted decimal comma, though the separator is a comma; with several specimens, the
#: specimen's number stands before the names.
BLUEHILL = """\
Specimen properties : Width,25.0,mm
Specimen properties : Specimen label,""

Time,Extension,Load,Tensile strain (Extension),Tensile stress,Cycle count
(s),(mm),(N),(mm/mm),(MPa),
0.000,-0.01,-0.02,0.0,0.0,0
0.100,0.25,100.5,0.003,5.0,0
"""
BLUEHILL_COMMAS = """\
Results Table 1


Time,Displacement,Force
(s),(mm),(kN)
"0,0000","-0,0100","-0,00002"
"0,1000","0,2500","0,1005"
"""
BLUEHILL_BLOCK = """\
Results Table 1
,Width,Thickness
,(mm),(mm)
"1","25.0","0.81"

1,Time,Displacement,Force
,(s),(mm),(kN)
,"0.0","-0.01","-0.00002"
,"0.1","0.25","0.1005"
"""
#: MTS TestSuite: lines about the test, blank ones, names, units without brackets.
TESTSUITE = """\
C:\\MTS\\Strip tests\\DAQ- Crosshead, Load.csv
Test: cut strip, ASTM D751
Date: 1/2/2014 10:11:12 AM


Axial Displacement,Axial Force,Running Time
mm,kN,sec
-0.01,-0.00002,0.0
0.25,0.1005,0.1
"""
#: MTS TestWorks and Elite: quoted names, rates among the properties.
TESTWORKS = """\
"Test Method","Strip test, extension control"
"Load Cell","30","kN"
"Test speed","300","mm/min"
"Crosshead [mm]"\t"Load [N]"\t"Time [s]"
-0.01\t-0.02\t0
0.25\t100.5\t0.1
"""
SEMICOLONS = "Weg in mm; Kraft in kN;\n-0,01;-0,00002;\n0,25;0,1005;\n;;\n"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_exports_of_machines_are_read(export_file, encoding):
    for text in (
        BLUEHILL, BLUEHILL_COMMAS, BLUEHILL_BLOCK, TESTSUITE, TESTWORKS.replace("\t", ","),
        TESTWORKS, TESTXPERT, SEMICOLONS,
    ):  # fmt: skip
        (curve,) = read_export(export_file, text, encoding)
        np.testing.assert_allclose(curve.elongation, [-0.01, 0.25], rtol=1e-14)
        np.testing.assert_allclose(curve.load, [-0.02, 100.5], rtol=1e-14)
        assert (curve.direction, curve.specimen, curve.path) == ("warp", "strip 3", export_file)
