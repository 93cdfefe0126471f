"""Load curves of strips from what test machines export."""

import zipfile
from datetime import datetime
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from bubblefit.experiments.bubble.placement import in_all_quarters, line_angle
from bubblefit.experiments.bubble.symmetry import Axes
from bubblefit.readers.curves import LoadCurve, read_load_curves, split_at_restarts
from bubblefit.readers.formats import workbook as xlsx
from bubblefit.readers.machine_tables import read_machine_loads, read_times
from bubblefit.readers.pressure_log import read_pressure_log
from bubblefit.readers.units import split_unit
from hypothesis import given, settings
from hypothesis import strategies as st

from ..support.refusals import complaint, complaint_with


@pytest.fixture(scope="module")
def scratch(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("exports") / "strip 3.csv"


def read(path: Path, text: str, encoding: str = "utf-8", **options) -> tuple[LoadCurve, ...]:
    path.write_bytes(text.encode(encoding))
    return read_load_curves(path, **{"direction": "warp", **options})


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
#: ZwickRoell testXpert: properties with value and unit, tabs, quoted names and units.
TESTXPERT = """\
"Probenkennung 2"\t"Kette_3"
"Messlänge Standardweg"\t80\t"mm"
"Prüfgeschwindigkeit"\t300\t"mm/min"
"Vorkraft"\t2\t"N"
"Prüfzeit"\t"Standardkraft"\t"Standardweg"\t"Dehnung"
"s"\t"N"\t"mm"\t"%"
0,0\t-0,02\t-0,01\t0
0,1\t100,5\t0,25\t0,3
"""
SEMICOLONS = "Weg in mm; Kraft in kN;\n-0,01;-0,00002;\n0,25;0,1005;\n;;\n"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_what_machines_export(scratch, encoding):
    for text in (
        BLUEHILL, BLUEHILL_COMMAS, BLUEHILL_BLOCK, TESTSUITE, TESTWORKS.replace("\t", ","),
        TESTWORKS, TESTXPERT, SEMICOLONS,
    ):  # fmt: skip
        (curve,) = read(scratch, text, encoding)
        np.testing.assert_allclose(curve.elongation, [-0.01, 0.25], rtol=1e-14)
        np.testing.assert_allclose(curve.load, [-0.02, 100.5], rtol=1e-14)
        assert (curve.direction, curve.specimen, curve.path) == ("warp", "strip 3", scratch)


def test_the_measured_points_need_no_options(shared_data):
    path = shared_data / "uniaxial/valmex7318_load_gauge.csv"
    curves = read_load_curves(path)
    assert [c.direction for c in curves] == ["warp", "fill", "bias"]
    assert [c.specimen for c in curves] == ["warp", "fill", "bias45"]
    assert [len(c.load) for c in curves] == [59, 39, 98]
    rows = [line.split(",") for line in path.read_text().splitlines()[2:]]
    for curve in curves:
        here = [row for row in rows if row[0] == curve.specimen]
        np.testing.assert_array_equal(curve.elongation, [float(row[1]) for row in here])
        np.testing.assert_array_equal(curve.load, [float(row[2]) for row in here])
    # Five specimens a direction (section 3.1), listed one after the other.
    parts = [[len(part.load) for part in split_at_restarts(curve)] for curve in curves]
    assert parts == [[10, 18, 10, 10, 11], [10, 9, 9, 3, 8], [11, 22, 21, 22, 22]]
    (fill,) = read_load_curves(path, direction="weft")
    np.testing.assert_array_equal(fill.load, curves[1].load)


def test_specimens_and_directions_have_columns(scratch):
    text = (
        "Specimen No.,Test direction,Load (kN),Extension (cm)\n"
        "A,Warp,0.1,1\nB,Warp,0.2,2\nA,Warp,0.3,3\nA,45-degree bias,0.4,4\n"
    )
    curves = read(scratch, text, direction=None)
    found = [(c.direction, c.specimen) for c in curves]
    assert found == [("warp", "A"), ("warp", "B"), ("bias", "A")]
    np.testing.assert_allclose(curves[0].load, [100, 300])
    np.testing.assert_allclose(curves[0].elongation, [10, 30])
    assert "no fill; it has: warp, bias" in complaint(read, scratch, text, direction="fill")
    columns = {"specimen": "Test direction", "direction": "Specimen No."}
    message = complaint(read, scratch, text, direction=None, columns=columns)
    assert "line 2, column 'Specimen No.': unknown direction 'A'" in message


def test_names_given_settle_what_is_ambiguous(scratch):
    text = TESTXPERT.replace("Dehnung", "Weg absolut").replace('"%"', '"mm"')
    message = complaint(read, scratch, text)
    assert "line 5: the column of elongation may be 'Standardweg' or 'Weg absolut'" in message
    (curve,) = read(scratch, text, columns={"elongation": "Weg absolut"})
    assert curve.notes == ()
    np.testing.assert_allclose(curve.elongation, [0, 0.3])
    # Names the reader does not know, with and without their unit; a column of time.
    columns = {"elongation": "Kanal 1", "load": "Kanal 2 [kN]", "time": "t"}
    (curve,) = read(scratch, "t,Kanal 1 [mm],Kanal 2 [kN]\n0,1,2\n5,3,4\n", columns=columns)
    np.testing.assert_allclose(curve.load, [2000, 4000])
    np.testing.assert_allclose(curve.time, [0, 5])
    (curve,) = read(scratch, TESTXPERT.replace("Dehnung", "Traversenweg").replace('"%"', '"mm"'))
    np.testing.assert_allclose(curve.elongation, [-0.01, 0.25])
    (note,) = curve.notes
    assert "the elongation is column 'Standardweg', not 'Traversenweg'" in note
    text = "Crosshead [mm],Extensometer displacement [mm],Load [N]\n5,1,0\n6,2,10\n"
    (curve,) = read(scratch, text)
    np.testing.assert_allclose(curve.elongation, [1, 2])
    (curve,) = read(scratch, text, columns={"elongation": "Crosshead"})
    np.testing.assert_allclose(curve.elongation, [5, 6])
    assert curve.notes == ()


#: Names and units of two columns; which is the elongation, mm for a reading, between the grips.
ORIGINS = [
    ("Standardweg [mm]", "Feindehnung [mm]", 1, 1.0, 0),
    ("Weg [mm]", "Videoextensometer [mm]", 1, 1.0, 0),
    ("Axial Displacement (mm)", "Extensometer (mm)", 1, 1.0, 0),
    ("Extension (mm)", "Extension (Strain 1) (mm)", 1, 1.0, 0),
    ("Standardweg [mm]", "Feindehnung [%]", 1, 0.2, 0),
    ("Elongation [%]", "Stroke [mm]", 0, 0.2, 0),
    ("Position (mm)", "Strain(8800:Extensometer) (mm/mm)", 1, 20.0, 0),
    ("Extensometer [%]", "Extensometer travel [mm]", 1, 1.0, 0),
    ("Dehnung [%]", "t [s]", 0, 0.2, 0),
    ("Tensile strain (Extension) (%)", "t", 0, 0.2, 1),
    ("Standardweg [mm]", "Dehnung [%]", 0, 1.0, 1),
    ("Video transverse [mm]", "Crosshead [mm]", 1, 1.0, 1),
    ("Axial Displacement (mm)", "t", 0, 1.0, 1),
    ("elongation_mm", "True strain [%]", 0, 1.0, 0),
]  # fmt: skip


@pytest.mark.parametrize(("first", "second", "which", "factor", "grips"), ORIGINS)
def test_what_is_measured_on_the_strip_wins(scratch, first, second, which, factor, grips):
    text = f"Load [N];{first};{second}\n0;0;0\n10;1;3\n20;2;5\n"
    (curve,) = read(scratch, text, gauge_length={"warp": 20.0})
    expected = factor * np.array([[0, 1, 2], [0, 3, 5]][which])
    np.testing.assert_allclose(curve.elongation, expected, rtol=1e-14)
    name = split_unit((first, second)[which])[0]
    assert split_unit(curve.between_grips)[0] == name * grips
    assert curve.source.notes == curve.notes and curve.source.columns["elongation"].startswith(name)
    # Naming it settles what a name leaves open; a crosshead stays one.
    columns = {"elongation": (first, second)[which]}
    (named,) = read(scratch, text, gauge_length={"warp": 20.0}, columns=columns)
    assert bool(named.between_grips) == (name == "Crosshead")
    if factor != 1.0:
        assert "say the warp strip's gauge_length" in complaint(read, scratch, text)


def test_an_extensometer_that_was_not_there(scratch):
    text = "Load [N];Standardweg [mm];Feindehnung [mm]\n0;0;0\n10;1;0\n20;2;0\n"
    assert "column 'Feindehnung [mm]': does not move" in complaint(read, scratch, text)
    (curve,) = read(scratch, text, columns={"elongation": "Standardweg"})
    assert curve.elongation.tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("unit", "newton"),
    [
        ("kN/m", 25.0), ("N/mm", 25.0), ("N/m", 0.025), ("N/cm", 2.5), ("N/50mm", 0.5),
        ("N/5 cm", 0.5), ("daN/5cm", 5.0),
    ],
)  # fmt: skip
def test_loads_per_width_are_those_of_the_whole_strip(scratch, unit, newton):
    for name in (f"Force [{unit}]", f"Force in {unit}"):
        text = f"Weg [mm];{name}\n0,5;2\n1,5;4,0\n"
        (curve,) = read(scratch, text, width=25.0)
        np.testing.assert_allclose(curve.load, [2 * newton, 4 * newton], rtol=1e-14)
    assert f"{unit.replace(' ', '')} is a load per width" in complaint(read, scratch, text)
    (curve,) = read(scratch, "Load,disp_mm\n2,1\n", load_unit="kN/m", width=50.0)
    assert curve.load == [100.0]


def test_blocks_of_specimens_are_read_one_after_the_other(scratch):
    results = "Results\nSpecimen,Maximum load [N],Extension at break [mm]\n1,20,14.5\n2,21,14.1\n\n"
    (curve,) = read(scratch, results + "Extension [mm],Load [N]\n0,0\n1,100\n2,180\n")
    np.testing.assert_allclose(curve.load, [0, 100, 180])
    (note,) = curve.notes
    assert "names in line 6, which has most rows, is read; not that of line 2" in note
    block = "Time,Extension,Load\n(s),(mm),(N)\n0,0,0\n1,1,100\n2,2,{}\n"
    text = "Specimen 1\n" + block.format(180) + "\nSpecimen 2\nWidth,25,mm\n" + block.format(190)
    (curve,) = read(scratch, text)
    np.testing.assert_allclose(curve.load, [0, 100, 180, 0, 100, 190])
    assert [len(part.load) for part in split_at_restarts(curve)] == [3, 3] and curve.notes == ()
    message = complaint(read, scratch, text.replace("1,1,100", "1,x,100"))
    assert "line 5, column 'Extension': expected a number, found 'x'" in message
    # A specimen that begins below zero is one.
    (curve,) = read(scratch, "Weg [mm];Kraft [N]\n-0,2;0\n0,1;1\n0,3;2\n0,1;0\n0,3;2\n")
    assert [len(part.load) for part in split_at_restarts(curve)] == [3, 2]
    # One number that can only be a decimal settles it for the file: 1,234 is no thousand.
    for text, options in (("1,234;2\n", {"decimal": ","}), ("1,234;2\n0,5;3\n", {})):
        assert read(scratch, "Load (N);disp_mm\n" + text, **options)[0].load[0] == 1.234


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("", {}, "no header row"),
        ("Load\0(N),disp_mm\n1,2\n", {}, "not a text file"),
        ("a,b\n1,2\n", {}, "line 1, above the first numbers, has: a, b"),
        ("t\na,b\n(mm),s\n1,2\n", {}, "line 2, above the first numbers, has: a, b"),
        ("a,b\n1,x\n", {}, "no line with two numbers"),
        ("Load (N),Extension (mm)\n", {}, "line 1: no rows of numbers"),
        ("Load,Extension\n1,2\n", {}, "column 'Extension': say length_unit"),
        ("Load (stone),disp_mm\n1,2\n", {}, "column 'Load (stone)': unit 'stone' is not one of"),
        ("Load (kN),disp_mm\n1,2\n", {"load_unit": "N"}, "the file says 'kN', load_unit 'N'"),
        ("Load (N),disp_mm\nkN,mm\n1,2\n", {}, "line 2, column 'Load (N)': unit 'kN' here"),
        ("Load (N),disp_mm\n1,2\n\n3,x\n", {}, "line 4, column 'disp_mm': expected a number"),
        ("Load (N),disp_mm\n1,2\n3\n", {}, "line 3, column 'disp_mm': expected a number, found no"),
        ("Load (N),disp_mm\n1,2\n3,4,5\n", {}, "line 3: expected 2 cells as in line 1, found 3"),
        ('Load (N),disp_mm\n"1,234","2,345"\n', {}, "column 'disp_mm': '2,345': is the comma a"),
        ('Load (N),disp_mm\n"1.234,5",1\n', {}, "expected a number, found '1.234,5'"),
        ("Load (N);disp_mm\n1,5;1.000\n", {"decimal": ","}, "column 'disp_mm': expected a number"),
        ("Load (N),disp_mm,disp_mm\n1,2,3\n", {}, "'disp_mm' appears twice, with other numbers"),
        ("Load (N),disp_mm\n1,2\n", {"direction": None}, "no column says the direction"),
        (
            "Load (N),disp_mm\n1,2\n",
            {"columns": {"force": "Load"}},
            "columns: expected one of elongation, load",
        ),
        ("Load (N),disp_mm\n1,2\n", {"columns": {"time": "t"}}, "column of time 't' is missing"),
        ("Load (N),disp_mm\n1,2\n", {"columns": {"load": "F"}}, "with the columns one of elon"),
        ("Load,disp_mm\n1,2\n", {"load_unit": "stone"}, "load_unit: expected one of N, kN"),
        ("Load (kN),disp_mm\n1e307,2\n", {}, "numbers too large; is the unit 'kN' right?"),
        ("Specimen,Load (N),disp_mm\n,1,2\n", {}, "column 'Specimen': expected the specimen's"),
    ],
)
def test_the_refusal_says_what_is_wrong(scratch, text, options, words):
    assert words in complaint(read, scratch, text, **options)


@settings(deadline=None, max_examples=100)
@given(
    rows=st.lists(
        st.tuples(*[st.floats(-1e6, 1e6, allow_subnormal=False)] * 2), min_size=1, max_size=20
    ),
    separator=st.sampled_from([",", ";", "\t"]),
    comma=st.booleans(),
    quoted=st.booleans(),
    units=st.sampled_from(["names", "row", "options"]),
    load_unit=st.sampled_from(["N", "kN"]),
    length_unit=st.sampled_from(["mm", "m"]),
    noise=st.lists(
        st.sampled_from(
            ["", "Test run 3", "Load cell,30,kN", "Width;25;mm", '"Date"\t"1/2/2014"', "# comment"]
        )
    ),
    breaks=st.sampled_from(["\n", "\r\n", "\r"]),
    encoding=st.sampled_from(["utf-8", "utf-16", "latin-1"]),
    order=st.permutations([0, 1, 2]),
)
def test_good_exports_come_back(
    scratch, rows, separator, comma, quoted, units, load_unit, length_unit, noise, breaks,
    encoding, order,
):  # fmt: skip
    quoted = quoted or (comma and separator == ",")
    load, length = (f" ({load_unit})", f" ({length_unit})") if units == "names" else ("", "")
    table = [[f"Extension{length}", f"Load{load}", "Größe"]]
    table += [[f"({length_unit})", load_unit, ""]] * (units == "row")
    for u, f in rows:
        # One decimal sixteen places long: no thousand.
        cells = [f"{u:.16e}", f"{f:.16e}", "a b"]
        table.append([cell.replace(".", ",") if comma else cell for cell in cells])
    if quoted:
        table = [[f'"{cell}"' for cell in row] for row in table]
    lines = noise + [separator.join(row[i] for i in order) for row in table]
    asked = {"load_unit": load_unit, "length_unit": length_unit} if units == "options" else {}
    (curve,) = read(scratch, breaks.join(lines) + breaks, encoding, **asked)
    expected = np.array(rows) * [{"mm": 1, "m": 1e3}[length_unit], {"N": 1, "kN": 1e3}[load_unit]]
    np.testing.assert_allclose(np.stack([curve.elongation, curve.load], 1), expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        ("mm,kN\n", "mm,N\n", "column 'Load': unit 'N' here, but 'kN' in the table"),
        ("mm,kN\n", "cm,kN\n", "column 'Extension': unit 'cm' here, but 'mm' in the table"),
        ("", "mm,kN\n", "column 'Extension': unit 'mm' here, but none in the table"),
        ("mm,kN\n", "mm,kN\n", ""), ("mm,kN\n", "", ""),
    ],
)  # fmt: skip
def test_tables_of_the_same_names_have_the_same_units(scratch, first, second, words):
    rows = "0,0\n1,0.1\n2,0.2\n"
    text = f"Extension,Load\n{first}{rows}\nExtension,Load\n{second}{rows}"
    if words:
        assert f"line {6 + bool(first)}, {words}" in complaint(read, scratch, text)
    else:
        loads = [curve.load for curve in read(scratch, text)]
        assert np.concatenate(loads) == pytest.approx([0.0, 100.0, 200.0] * 2)


LONG = (
    "Probe;Richtung;Kraft [N/5cm];Dehnung [%]\nA;Kette;0;0\nA;Kette;100;1\n"
    "B;Kette;0;0\nB;Kette;110;1,5\nC;Schuss;50;2\n"
)
#: Tables of several specimens; direction, specimen, mm, N of each, of strips 50 mm wide and gauges
#: of 20 and 30 mm.
SEVERAL = {
    "long": (LONG, [("warp", "A", [0, 0.2], [0, 100]), ("warp", "B", [0, 0.3], [0, 110]),
                    ("fill", "C", [0.6], [50])]),
    "pairs": ("Extension (mm),Load (N),Extension (mm),Load (N)\n0,0,0,0\n1,10,1,12\n2,20,,\n",
              [("warp", "strip 3 1", [0, 1, 2], [0, 10, 20]),
               ("warp", "strip 3 2", [0, 1], [0, 12])]),
    "titles": ("P 7;;;;P 9;;;\nZeit [s];Weg [mm];Kraft [N];;Zeit [s];Weg [mm];Kraft [N];\n"
               "0;0;0;;0;0;0;\n1;1,5;10;;1;1;12;\n",
               [("warp", "P 7", [0, 1.5], [0, 10]), ("warp", "P 9", [0, 1], [0, 12])]),
    "directions": ("Kette;;Schuss;\nWeg;Kraft;Weg;Kraft\nmm;kN;mm;kN\n0;0;0;0\n1,5;0,1;1;0,2\n",
                   [("warp", "Kette", [0, 1.5], [0, 100]), ("fill", "Schuss", [0, 1], [0, 200])]),
    "numbers": ("t,Load 1 (N),Stroke 1 (mm),Load 2 (N),Stroke 2 (mm)\n0,0,0,0,0\n1,10,1,12,2\n",
                [("warp", "strip 3 1", [0, 1], [0, 10]), ("warp", "strip 3 2", [0, 2], [0, 12])]),
}  # fmt: skip


@pytest.mark.parametrize("name", SEVERAL)
def test_specimens_below_and_beside_each_other(scratch, name):
    text, expected = SEVERAL[name]
    own = {"width": 50.0, "gauge_length": {"warp": 20.0, "fill": 30.0}}
    direction = None if {"fill"} & {one[0] for one in expected} else "warp"
    curves = read(scratch, text, direction=direction, **own)
    assert [(c.direction, c.specimen) for c in curves] == [one[:2] for one in expected]
    for curve, (*_, elongation, load) in zip(curves, expected, strict=True):
        np.testing.assert_allclose(curve.elongation, elongation, atol=1e-14)
        np.testing.assert_allclose(curve.load, load, atol=1e-12)
    assert any("side by side" in note for note in curves[0].notes) == (name != "long")
    # A file of two directions listed for one gives that one.
    assert {c.direction for c in read(scratch, text, direction="warp", **own)} == {"warp"}


def test_columns_beside_each_other_that_are_no_specimens(scratch):
    head = "Load 1 (N),Load 2 (N),Extension 1 (mm),Extension 2 (mm)\n"
    assert "may be 'Ext" in complaint(read, scratch, head + "0,0,0,0\n1,2,3,4\n")
    head = "Extension 1 (mm),Load 1 (N),Extension 2 (mm),Load 2 (kN)\n"
    words = "column 'Load 2 (kN)': another unit than column 'Load 1 (N)'"
    assert words in complaint(read, scratch, head + "0,0,0,0\n1,2,3,4\n")
    names = {"elongation": "Extension 2 (mm)", "load": "Load 2 (kN)"}
    (curve,) = read(scratch, head + "0,0,0,0\n1,2,3,4\n", columns=names)
    assert curve.load.tolist() == [0, 4000]


def test_rows_after_the_largest_load_are_cut():
    u, load = np.arange(6.0), np.array([0, 5, 9, 10, 3, 1.0])
    cut = LoadCurve("warp", "1", u, load, None, time=u, frame=np.arange(6)).until_largest_load()
    assert cut.elongation.tolist() == [0, 1, 2, 3] and cut.load.max() == cut.load[-1] == 10
    assert (cut.cut, len(cut.time), len(cut.frame)) == (2, 4, 4)


def workbook(path: Path, **sheets) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


TABLE = [["Standardweg", "Feindehnung", "Standardkraft"], ["mm", "mm", "N"], [0, 0, 0],
         [3.5, 1.25, 10], [5, 2, 20.5]]  # fmt: skip


def test_a_workbook(tmp_path):
    facts = [["Prüfer", "X"], ["Breite", 25, "mm"]]
    path = workbook(tmp_path / "a.xlsx", Facts=facts, K1=[["Kette 1"], *TABLE])
    (curve,) = read_load_curves(path, direction="warp")
    assert curve.elongation.tolist() == [0, 1.25, 2] and curve.load.tolist() == [0, 10, 20.5]
    assert curve.source.format == "xlsx" and len(curve.notes) == 1
    two = workbook(tmp_path / "b.xlsx", K1=TABLE, K2=[*TABLE, [6, 2.5, 30]])
    complaint_with(["b.xlsx", "'K1', 'K2'", "sheet"], read_load_curves, two, direction="warp")
    (curve,) = read_load_curves(two, direction="warp", sheet="K2")
    assert curve.load.tolist() == [0, 10, 20.5, 30]
    own = {"direction": "warp", "sheet": "K3"}
    complaint_with(["b.xlsx: sheet", "'K3'", "'K1', 'K2'"], read_load_curves, two, **own)
    # Formulas have the value that was stored with them, or none: nothing is computed.
    formula = workbook(tmp_path / "c.xlsx", a=[["Weg [mm]", "Kraft [N]"], [0, 0], ["=1+1", 3]])
    said = complaint(read_load_curves, formula, direction="warp")
    assert "line 3, column 'Weg [mm]': expected a number, found nothing" in said
    times = [datetime(2021, 3, 12, 23, 59, 59, 500000), datetime(2021, 3, 13, 0, 0, 1)]
    rows = [["Zeitstempel", "Druck [kPa]"], *([t, 1.5 * i] for i, t in enumerate(times))]
    time, pressure = read_pressure_log(workbook(tmp_path / "d.xlsx", a=rows))
    assert time.tolist() == [86399.5, 86401.0] and pressure.tolist() == [0, 0.0015]


def test_workbooks_that_are_none_or_too_large(tmp_path, monkeypatch):
    path = tmp_path / "a.xlsx"
    path.write_bytes(b"PK\x03\x04 nonsense")
    assert "is no workbook" in complaint(read_load_curves, path, direction="warp")
    workbook(path, a=[["x", "y"], [1, 2]])
    assert "no sheet has a row of names" in complaint(read_load_curves, path, direction="warp")
    monkeypatch.setattr(xlsx, "MOST_CELLS", 4)
    assert "more than 4 cells" in complaint(read_load_curves, path, direction="warp")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/workbook.xml", b"\0" * (2**20 + 1))
    monkeypatch.setattr(xlsx, "UNPACKED", 2**20)
    assert "unpacks to more than 1 MiB" in complaint(read_load_curves, path, direction="warp")


#: The clock of a log: the heading, two stamps, seconds since midnight of the first.
CLOCKS = [
    ("Zeitstempel", "12.03.2021 14:02:11,500", "12.03.2021 14:02:12,000", 50531.5, 50532.0),
    ("Timestamp", "2021-03-12T23:59:59.5Z", "2021-03-13T00:00:00.5Z", 86399.5, 86400.5),
    ("Time", "12:00:01 AM", "2:02:11 PM", 1.0, 50531.0), ("Uhrzeit", "23:59:59,5", "0:00:00,5",
     86399.5, 86400.5), ("Time", "2/28/2021 12:00:00 PM", "3/1/2021 12:00:00 PM", 43200, 129600),
    ("Zeit", "30.12.21 00:00:01", "01.01.22 00:00:01", 1, 172801),
]  # fmt: skip


@pytest.mark.parametrize(("name", "first", "second", "start", "end"), CLOCKS)
def test_the_clock_on_the_wall(scratch, name, first, second, start, end):
    scratch.write_text(f"{name};Load [N];Druck [bar]\n{first};1,5;0,1\n{second};2;0,2\n")
    assert read_times(scratch).tolist() == [start, end]
    assert read_machine_loads(scratch, timed=True)[1].tolist() == [start, end]
    time, pressure = read_pressure_log(scratch)
    assert time.tolist() == [start, end] and pressure == pytest.approx([0.01, 0.02])
    scratch.write_text(scratch.read_text() + "14.2;1;0,3\n")
    assert f"line 4, column '{name}': expected a time" in complaint(read_times, scratch)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("t_sek;Prüfzeit\n;s\n0;1,5\n0;2\n", [1.5, 2.0]), ("Time (min)\n1\n2\n", [60.0, 120.0]),
        ("frame,time_ms\n0,1500\n1,1600.5\n", [1.5, 1.6005]),
        ("Running Time,Cycle time\n3,4\n", [3.0]),
        ("Time (d)\n1\n", "line 1, column 'Time (d)': unit 'd' is not one of s, sec, ms, min, h"),
        ("Time,Running time\n1,2\n", "the column of time may be 'Time' or 'Running time'"),
        ("frame\n1\n", "no header row with the columns one of time"),
        ("time\n1\nx\n", "line 3, column 'time': expected a number, found 'x'"),
    ],
)  # fmt: skip
def test_units_of_time(scratch, text, expected):
    scratch.write_text(text)
    if isinstance(expected, list):
        np.testing.assert_allclose(read_times(scratch), expected, rtol=1e-14)
    else:
        complaint_with([expected, str(scratch)], read_times, scratch)


def test_loads_need_no_elongation(scratch):
    scratch.write_text("Time (min),Load (kN),Load rate (kN/s)\n0,1,7\n0.5,2,7\n")
    plain, timed = read_machine_loads(scratch), read_machine_loads(scratch, timed=True)
    assert plain[0].tolist() == [1000, 2000] and timed[1].tolist() == [0, 30]
    assert plain[1] is None
    scratch.write_text("Load (kN)\n1\n")
    said = complaint(read_machine_loads, scratch, timed=True)
    assert "no header row with the columns one of load and one of t" in said


@given(st.integers(-720, 720))
def test_a_line_and_two_axes_are_told_by_one_angle_each(degrees):
    line, axes = line_angle(degrees), Axes(degrees, 0.0, 0.0).off
    assert -90 <= line < 90 and (line - degrees) % 180 == 0
    assert -45 <= axes < 45 and (axes - degrees) % 90 == 0


@pytest.mark.parametrize("missing", range(4))
def test_points_in_three_quarters_are_not_all_around(missing):
    # Heights of both signs are neither here nor there.
    points = np.array([[1.0, 1, 9], [1, -1, 9], [-1, 1, -9], [-1, -1, -9]] * 2)
    points[4:, 2] *= -1
    assert in_all_quarters(points) and in_all_quarters(points[:, :2])
    assert not in_all_quarters(np.delete(points, [missing, missing + 4], axis=0))
    assert not in_all_quarters(points[:0])
