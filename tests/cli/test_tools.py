"""The command `report`: pages made again, of unfinished folders, and of two side by side."""

import json
import shutil
from pathlib import Path

import pytest
from bubblefit.reports import html
from bubblefit.reports.content import Table, read_page_data
from bubblefit.reports.html import write_report
from bubblefit.reports.run_pages import UNFINISHED, page_of_folder
from bubblefit.runs.folder import Provenance
from bubblefit.runs.verification import verify as verification

from ..builders.pages import drawn, full_report
from ..support.commands import in_process, one_line

START = {
    "number": 3, "seed": [1, 3], "objective": 0.25, "status": "converged", "analyses": 7,
    "unknowns": [1.0], "coefficients": [2.0], "wall_s": 1.5,
}  # fmt: skip


def report(*arguments, code=0):
    return in_process("report", *arguments, cwd=".", code=code)


@pytest.fixture
def folder(tmp_path):
    path = tmp_path / "one"
    path.mkdir()
    drawn(path)
    write_report(path, full_report())
    return path


def test_report_writes_the_same_page_and_no_pdf_without_a_browser(folder, monkeypatch):
    page = folder / "report.html"
    first = page.read_bytes()
    page.unlink()
    assert report(folder).output == f"page: {page}\n"
    assert page.read_bytes() == first
    tables = [Table("Surfaces", ["kPa", "R²"], [[22, 0.99971]], "Table 4.1", [])]
    assert [p for p in read_page_data(folder).parts if p.part == "table"] == tables
    monkeypatch.setattr(html, "find_browser", lambda: None)
    one_line(report(folder, "--format", "pdf", code=2), "report.pdf: needs a browser")
    assert not (folder / "report.pdf").exists()


def unfinished(folder):
    """What a fit that was killed leaves: two starts, one written half, eleven analyses."""
    folder.mkdir()
    (folder / "run.json").write_text("{}")
    (folder / "starts.jsonl").write_text(json.dumps(START) + '\n{"number": 4, "se')
    (folder / "history.csv").write_text("start,analysis\n" + "3,1\n" * 11)
    runs = [{"command_line": ["bubblefit", "fit", "fabric.toml"], "date": "2026-01-02"}]
    data = {"test": "one", "name": "a.csv", "sha256": "0123456789abcdef", "format": "csv"}
    data |= {"columns": {}, "units": {}, "rows_used": 3, "rows_dropped": {}}
    Provenance(Path("/lab/fabric.toml"), None, None, [data], {}, runs).write(folder)
    return folder


def test_report_of_an_unfinished_fit_lists_its_starts(tmp_path):
    made = page_of_folder(unfinished(tmp_path / "fit"))
    assert made.title == "fabric.toml: unfinished" and made.verdicts == [("", UNFINISHED)]
    facts, starts, record, files = made.parts
    assert facts.pairs == [("starts that ended", 1), ("analyses", 11)]
    assert starts.rows == [[3, "full", 0.25, 7, "converged"]]
    assert ["command", "bubblefit fit fabric.toml"] in record.rows
    assert files.rows[0][:3] == ["one", "a.csv", "0123456789ab"]
    (tmp_path / "fit" / "provenance.json").write_text("{}")
    assert len(list(page_of_folder(tmp_path / "fit").parts)) == 3
    report(tmp_path / "fit")
    assert (
        "the run is unfinished: there is no result yet"
        in (tmp_path / "fit" / "report.html").read_text()
    )
    # It leaves no data of a page behind, which would be taken for a result's.
    assert not (tmp_path / "fit" / "page.json").exists()


def test_report_of_an_unfinished_study_says_so(tmp_path):
    unfinished(tmp_path / "without one")
    (tmp_path / "without two").mkdir()
    (tmp_path / "without two" / "result.json").write_text("{}")
    (tmp_path / "notes").mkdir()
    (table,) = page_of_folder(tmp_path).sections[0].parts
    assert table.title == "Fits within"
    assert table.rows == [["without one", "unfinished"], ["without two", "finished"]]
    assert table.text == (1,)


def test_folder_without_a_page_is_refused(tmp_path):
    for name, said in (
        (None, "is no output folder: neither page.json nor run.json is there"),
        ("result.json", "has a result but no page.json: an older version wrote it"),
        ("page.json", "is damaged"),
        ("nowhere", "there is no such folder"),
    ):
        folder = tmp_path / str(name)
        if name != "nowhere":
            folder.mkdir()
        if name and folder.is_dir():
            (folder / name).write_text("")
        one_line(report(folder, code=2), said)
        assert not (folder / "report.html").exists()


def test_two_folders_are_shown_side_by_side(folder, tmp_path, monkeypatch):
    """Tables of one heading as one, curves in one chart, pictures of both folders."""
    monkeypatch.chdir(tmp_path)
    other = Path(shutil.copytree(folder, tmp_path / "two"))
    content = json.loads((other / "page.json").read_text())
    (section,) = [own for own in content["sections"] if own["title"] == "Tables"]
    section["parts"][0]["rows"] = [[22, 0.5], [59, 1]]
    (other / "page.json").write_text(json.dumps(content))
    assert report(folder, other).output == "page: one-beside-two.html\n"
    text = (tmp_path / "one-beside-two.html").read_text()
    assert "one: Good. two: Good." in text and text.count("data:image/png") == 2
    # Told apart by colour and dashes.
    assert 'class="chart"' in text and "#d55e00" in text
    assert '"measured, one"' in text and '"measured, two"' in text
    assert '<tr><td>one</td><td class="text">22</td><td>0.9997</td>' in text
    assert '<td>two</td><td class="text">22</td><td>0.5</td>' in text
    assert '<td>two</td><td class="text">59</td><td>1</td>' in text
    report(folder, folder, code=2)
    report(folder, other, folder, code=2)


def test_second_verification_is_refused_before_it_computes(tmp_path, monkeypatch):
    bars = ("verify", "--subject", "bars")
    in_process(*bars, cwd=tmp_path)
    first = (tmp_path / "out" / "verified" / "result.json").stat().st_mtime_ns
    with monkeypatch.context() as patched:
        patched.setattr(verification, "verify", lambda *_, **__: pytest.fail("it computes"))
        refused = in_process(*bars, cwd=tmp_path, code=2)
    one_line(refused, "already holds a result; use --overwrite or another --out")
    in_process(*bars, "--overwrite", cwd=tmp_path)
    assert (tmp_path / "out" / "verified" / "result.json").stat().st_mtime_ns > first
