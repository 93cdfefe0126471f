"""readers/machine_export.py: one table of a test machine's export."""

import numpy as np
import pytest
from bubblefit.readers.curves import split_at_restarts
from bubblefit.readers.machine_export import columns_by_quantity, count_unit_rows
from bubblefit.readers.machine_tables import TableOptions
from bubblefit.readers.tables import Row
from bubblefit.readers.units import split_unit
from hypothesis import given, settings
from hypothesis import strategies as st

from ..support.refusals import complaint
from .cases import TESTXPERT, read_export


def test_named_columns_settle_ambiguous_names(export_file):
    text = TESTXPERT.replace("Dehnung", "Weg absolut").replace('"%"', '"mm"')
    message = complaint(read_export, export_file, text)
    assert "line 5: the column of elongation may be 'Standardweg' or 'Weg absolut'" in message
    (curve,) = read_export(export_file, text, columns={"elongation": "Weg absolut"})
    assert curve.notes == ()
    np.testing.assert_allclose(curve.elongation, [0, 0.3])
    # Names the reader does not know, with and without their unit; a column of time.
    columns = {"elongation": "Kanal 1", "load": "Kanal 2 [kN]", "time": "t"}
    (curve,) = read_export(
        export_file, "t,Kanal 1 [mm],Kanal 2 [kN]\n0,1,2\n5,3,4\n", columns=columns
    )
    np.testing.assert_allclose(curve.load, [2000, 4000])
    np.testing.assert_allclose(curve.time, [0, 5])
    (curve,) = read_export(
        export_file, TESTXPERT.replace("Dehnung", "Traversenweg").replace('"%"', '"mm"')
    )
    np.testing.assert_allclose(curve.elongation, [-0.01, 0.25])
    (note,) = curve.notes
    assert "the elongation is column 'Standardweg', not 'Traversenweg'" in note
    text = "Crosshead [mm],Extensometer displacement [mm],Load [N]\n5,1,0\n6,2,10\n"
    (curve,) = read_export(export_file, text)
    np.testing.assert_allclose(curve.elongation, [1, 2])
    (curve,) = read_export(export_file, text, columns={"elongation": "Crosshead"})
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
def test_column_measured_on_the_strip_is_preferred(
    export_file, first, second, which, factor, grips
):
    text = f"Load [N];{first};{second}\n0;0;0\n10;1;3\n20;2;5\n"
    (curve,) = read_export(export_file, text, gauge_length={"warp": 20.0})
    expected = factor * np.array([[0, 1, 2], [0, 3, 5]][which])
    np.testing.assert_allclose(curve.elongation, expected, rtol=1e-14)
    name = split_unit((first, second)[which])[0]
    assert split_unit(curve.between_grips)[0] == name * grips
    assert curve.source.notes == curve.notes and curve.source.columns["elongation"].startswith(name)
    # Naming it settles what a name leaves open; a crosshead stays one.
    columns = {"elongation": (first, second)[which]}
    (named,) = read_export(export_file, text, gauge_length={"warp": 20.0}, columns=columns)
    assert bool(named.between_grips) == (name == "Crosshead")
    if factor != 1.0:
        assert "say the warp strip's gauge_length" in complaint(read_export, export_file, text)


def test_extensometer_that_does_not_move_is_refused(export_file):
    text = "Load [N];Standardweg [mm];Feindehnung [mm]\n0;0;0\n10;1;0\n20;2;0\n"
    assert "column 'Feindehnung [mm]': does not move" in complaint(read_export, export_file, text)
    (curve,) = read_export(export_file, text, columns={"elongation": "Standardweg"})
    assert curve.elongation.tolist() == [0, 1, 2]


def test_blocks_of_specimens_are_read_one_after_the_other(export_file):
    results = "Results\nSpecimen,Maximum load [N],Extension at break [mm]\n1,20,14.5\n2,21,14.1\n\n"
    (curve,) = read_export(export_file, results + "Extension [mm],Load [N]\n0,0\n1,100\n2,180\n")
    np.testing.assert_allclose(curve.load, [0, 100, 180])
    (note,) = curve.notes
    assert "names in line 6, which has most rows, is read; not that of line 2" in note
    block = "Time,Extension,Load\n(s),(mm),(N)\n0,0,0\n1,1,100\n2,2,{}\n"
    text = "Specimen 1\n" + block.format(180) + "\nSpecimen 2\nWidth,25,mm\n" + block.format(190)
    (curve,) = read_export(export_file, text)
    np.testing.assert_allclose(curve.load, [0, 100, 180, 0, 100, 190])
    assert [len(part.load) for part in split_at_restarts(curve)] == [3, 3] and curve.notes == ()
    message = complaint(read_export, export_file, text.replace("1,1,100", "1,x,100"))
    assert "line 5, column 'Extension': expected a number, found 'x'" in message
    # A specimen that begins below zero is one.
    (curve,) = read_export(export_file, "Weg [mm];Kraft [N]\n-0,2;0\n0,1;1\n0,3;2\n0,1;0\n0,3;2\n")
    assert [len(part.load) for part in split_at_restarts(curve)] == [3, 2]
    # One number that can only be a decimal settles it for the file: 1,234 is no thousand.
    for text, options in (("1,234;2\n", {"decimal": ","}), ("1,234;2\n0,5;3\n", {})):
        assert read_export(export_file, "Load (N);disp_mm\n" + text, **options)[0].load[0] == 1.234


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
        ("Load (N),disp_mm\n1,2\n", {"columns": {"load": "F"}}, "no column of F in the header row"),
        ("Load,disp_mm\n1,2\n", {"load_unit": "stone"}, "load_unit: expected one of N, kN"),
        ("Load (kN),disp_mm\n1e307,2\n", {}, "numbers too large; is the unit 'kN' right?"),
        ("Specimen,Load (N),disp_mm\n,1,2\n", {}, "column 'Specimen': expected the specimen's"),
    ],
)
def test_refused_export_says_what_is_wrong(export_file, text, options, words):
    assert words in complaint(read_export, export_file, text, **options)


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
def test_any_good_export_comes_back(
    export_file, rows, separator, comma, quoted, units, load_unit, length_unit, noise, breaks,
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
    (curve,) = read_export(export_file, breaks.join(lines) + breaks, encoding, **asked)
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
def test_tables_of_the_same_names_have_the_same_units(export_file, first, second, words):
    rows = "0,0\n1,0.1\n2,0.2\n"
    text = f"Extension,Load\n{first}{rows}\nExtension,Load\n{second}{rows}"
    if words:
        assert f"line {6 + bool(first)}, {words}" in complaint(read_export, export_file, text)
    else:
        loads = [curve.load for curve in read_export(export_file, text)]
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
def test_specimens_below_and_beside_one_another_are_told_apart(export_file, name):
    text, expected = SEVERAL[name]
    own = {"width": 50.0, "gauge_length": {"warp": 20.0, "fill": 30.0}}
    direction = None if {"fill"} & {one[0] for one in expected} else "warp"
    curves = read_export(export_file, text, direction=direction, **own)
    assert [(c.direction, c.specimen) for c in curves] == [one[:2] for one in expected]
    for curve, (*_, elongation, load) in zip(curves, expected, strict=True):
        np.testing.assert_allclose(curve.elongation, elongation, atol=1e-14)
        np.testing.assert_allclose(curve.load, load, atol=1e-12)
    assert any("side by side" in note for note in curves[0].notes) == (name != "long")
    # A file of two directions listed for one gives that one.
    assert {c.direction for c in read_export(export_file, text, direction="warp", **own)} == {
        "warp"
    }


def test_repeated_columns_that_are_no_specimens_are_refused(export_file):
    head = "Load 1 (N),Load 2 (N),Extension 1 (mm),Extension 2 (mm)\n"
    assert "may be 'Ext" in complaint(read_export, export_file, head + "0,0,0,0\n1,2,3,4\n")
    head = "Extension 1 (mm),Load 1 (N),Extension 2 (mm),Load 2 (kN)\n"
    words = "column 'Load 2 (kN)': another unit than column 'Load 1 (N)'"
    assert words in complaint(read_export, export_file, head + "0,0,0,0\n1,2,3,4\n")
    names = {"elongation": "Extension 2 (mm)", "load": "Load 2 (kN)"}
    (curve,) = read_export(export_file, head + "0,0,0,0\n1,2,3,4\n", columns=names)
    assert curve.load.tolist() == [0, 4000]


@pytest.mark.parametrize(("count", "expected"), [(2000, [[0], [1]]), (2001, [])])
def test_row_of_more_than_two_thousand_cells_is_no_header(count, expected):
    names = ["Load", "Extension", *("x" * (count - 2))]
    options = TableOptions(quantities=("load", "elongation"))
    assert columns_by_quantity(names, options) == expected


@pytest.mark.parametrize(
    ("cells", "count"),
    [
        ([], 0),
        (["1,2"], 0),
        (["N,mm"], 1),
        (["N,mm", "1,2"], 1),
        (["N,mm", "float,float"], 1),
        (["N,mm", "float,float", "1,2"], 2),
        (["N,mm", "float,float", "a,b", "1,2"], 1),
    ],
)
def test_rows_of_units_are_those_in_words_above_a_reading(cells, count):
    rows = [Row(number, row.split(",")) for number, row in enumerate(cells, start=2)]
    assert count_unit_rows(rows, [0, 1]) == count
