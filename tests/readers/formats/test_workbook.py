"""readers/formats/workbook.py: sheets of workbooks."""

import zipfile
from datetime import datetime
from pathlib import Path

import openpyxl
from bubblefit.readers.curves import read_load_curves
from bubblefit.readers.formats import workbook as xlsx
from bubblefit.readers.histories import read_pressure_log

from ...support.refusals import complaint, complaint_with


def written_workbook(path: Path, **sheets) -> Path:
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


def test_sheet_of_a_workbook_with_the_quantities_is_read(tmp_path):
    facts = [["Prüfer", "X"], ["Breite", 25, "mm"]]
    path = written_workbook(tmp_path / "a.xlsx", Facts=facts, K1=[["Kette 1"], *TABLE])
    (curve,) = read_load_curves(path, direction="warp")
    assert curve.elongation.tolist() == [0, 1.25, 2] and curve.load.tolist() == [0, 10, 20.5]
    assert curve.source.format == "xlsx" and len(curve.notes) == 1
    two = written_workbook(tmp_path / "b.xlsx", K1=TABLE, K2=[*TABLE, [6, 2.5, 30]])
    complaint_with(["b.xlsx", "'K1', 'K2'", "sheet"], read_load_curves, two, direction="warp")
    (curve,) = read_load_curves(two, direction="warp", sheet="K2")
    assert curve.load.tolist() == [0, 10, 20.5, 30]
    own = {"direction": "warp", "sheet": "K3"}
    complaint_with(["b.xlsx: sheet", "'K3'", "'K1', 'K2'"], read_load_curves, two, **own)
    # Sheets that are named by directions are read together.
    by_direction = written_workbook(tmp_path / "e.xlsx", Kette=TABLE, Schuss=[*TABLE, [6, 2.5, 30]])
    warp, fill = read_load_curves(by_direction)
    assert (warp.direction, warp.load.tolist()) == ("warp", [0, 10, 20.5])
    assert (fill.direction, fill.load.tolist()) == ("fill", [0, 10, 20.5, 30])
    assert "'Kette', 'Schuss' are those directions" in fill.notes[0]
    other = [["Weg", "Kraft"], *TABLE[1:]]
    differing = written_workbook(tmp_path / "f.xlsx", warp=TABLE, bias=other)
    complaint_with(["f.xlsx", "'warp', 'bias' differ", "sheet"], read_load_curves, differing)
    # Formulas have the value that was stored with them, or none: nothing is computed.
    formula = written_workbook(
        tmp_path / "c.xlsx", a=[["Weg [mm]", "Kraft [N]"], [0, 0], ["=1+1", 3]]
    )
    said = complaint(read_load_curves, formula, direction="warp")
    assert "line 3, column 'Weg [mm]': expected a number, found nothing" in said
    times = [datetime(2021, 3, 12, 23, 59, 59, 500000), datetime(2021, 3, 13, 0, 0, 1)]
    rows = [["Zeitstempel", "Druck [kPa]"], *([t, 1.5 * i] for i, t in enumerate(times))]
    time, pressure = read_pressure_log(written_workbook(tmp_path / "d.xlsx", a=rows))
    assert time.tolist() == [86399.5, 86401.0] and pressure.tolist() == [0, 0.0015]


def test_damaged_or_too_large_workbook_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.xlsx"
    path.write_bytes(b"PK\x03\x04 nonsense")
    assert "is no workbook" in complaint(read_load_curves, path, direction="warp")
    written_workbook(path, a=[["x", "y"], [1, 2]])
    assert "no sheet has a row of names" in complaint(read_load_curves, path, direction="warp")
    monkeypatch.setattr(xlsx, "MOST_CELLS", 4)
    assert "more than 4 cells" in complaint(read_load_curves, path, direction="warp")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/workbook.xml", b"\0" * (2**20 + 1))
    monkeypatch.setattr(xlsx, "UNPACKED", 2**20)
    assert "unpacks to more than 1 MiB" in complaint(read_load_curves, path, direction="warp")
