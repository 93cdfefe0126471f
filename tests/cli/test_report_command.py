"""bubblefit report: the page again, of what is not finished, of two folders, on paper."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from bubblefit.cli.main import main
from bubblefit.reports import html as pdf
from bubblefit.reports.content import Table, read_page_data
from bubblefit.reports.html import write_report
from bubblefit.reports.run_pages import UNFINISHED, page_of_folder
from click.testing import CliRunner, Result

from ..reports.test_html import drawn, full_report

START = {
    "number": 3, "seed": [1, 3], "objective": 0.25, "status": "converged", "analyses": 7,
    "unknowns": [1.0], "coefficients": [2.0], "wall_s": 1.5,
}  # fmt: skip


def report(*arguments: Path | str) -> Result:
    return CliRunner().invoke(main, ["report", *map(str, arguments)])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """An output folder with a page."""
    path = tmp_path / "one"
    path.mkdir()
    drawn(path)
    write_report(path, full_report())
    return path


def test_the_same_bytes_again(folder: Path) -> None:
    page = folder / "report.html"
    first = page.read_bytes()
    page.unlink()
    done = report(folder)
    assert (done.exit_code, done.output) == (0, f"page: {page}\n")
    assert page.read_bytes() == first


def unfinished(folder: Path) -> Path:
    """What a fit that was killed leaves: two starts, one written half, eleven analyses."""
    folder.mkdir()
    (folder / "run.json").write_text("{}")
    (folder / "starts.jsonl").write_text(json.dumps(START) + '\n{"number": 4, "se')
    (folder / "history.csv").write_text("start,analysis\n" + "3,1\n" * 11)
    record = {
        "project": {"file": "/lab/fabric.toml"},
        "runs": [{"command_line": ["bubblefit", "fit", "fabric.toml"], "date": "2026-01-02"}],
        "data": [{"name": "a.csv", "sha256": "0123456789abcdef"}],
    }
    (folder / "provenance.json").write_text(json.dumps(record))
    return folder


def test_an_unfinished_fit(tmp_path: Path) -> None:
    """It says first that it is none, then what is there."""
    made = page_of_folder(unfinished(tmp_path / "fit"))
    assert made.title == "fabric.toml: unfinished" and made.summary == UNFINISHED
    facts, starts, record = made.parts
    assert facts.pairs == [("starts that ended", 1), ("analyses", 11)]
    assert starts.rows == [[3, "full", 0.25, 7, "converged"]]
    assert ["command", "bubblefit fit fabric.toml"] in record.rows
    assert ["data: a.csv", "sha256 0123456789ab …"] in record.rows
    assert report(tmp_path / "fit").exit_code == 0
    assert "Unfinished: there is no result yet" in (tmp_path / "fit" / "report.html").read_text()
    # It leaves no data of a page behind, which would be taken for a result's.
    assert not (tmp_path / "fit" / "page.json").exists()


def test_an_unfinished_study(tmp_path: Path) -> None:
    """A folder of fits: which of them are finished."""
    unfinished(tmp_path / "without one")
    (tmp_path / "without two").mkdir()
    (tmp_path / "without two" / "result.json").write_text("{}")
    (tmp_path / "notes").mkdir()
    (table,) = page_of_folder(tmp_path).sections[0].parts
    assert table.title == "Fits within"
    assert table.rows == [["without one", "unfinished"], ["without two", "finished"]]


@pytest.mark.parametrize(
    ("holds", "said"),
    [
        ([], "is no output folder: neither page.json nor run.json is there"),
        (["result.json"], "has a result but no page.json: an older version wrote it"),
        (["page.json"], "is damaged"),
    ],
)
def test_what_is_no_folder_of_a_page(tmp_path: Path, holds: list[str], said: str) -> None:
    for name in holds:
        (tmp_path / name).write_text("")
    done = report(tmp_path)
    assert done.exit_code == 2 and said in done.stderr and done.stderr.count("\n") == 1
    assert not (tmp_path / "report.html").exists()
    done = report(tmp_path / "nowhere")
    assert done.exit_code == 2 and "there is no such folder" in done.stderr


def test_two_side_by_side(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables of one heading as one, curves in one chart, pictures of both folders."""
    monkeypatch.chdir(tmp_path)
    other = Path(shutil.copytree(folder, tmp_path / "two"))
    content = json.loads((other / "page.json").read_text())
    (section,) = [own for own in content["sections"] if own["title"] == "Tables"]
    section["parts"][0]["rows"] = [[22, 0.5], [59, 1]]
    (other / "page.json").write_text(json.dumps(content))
    done = report(folder, other)
    assert (done.exit_code, done.output) == (0, "page: one-beside-two.html\n")
    text = (tmp_path / "one-beside-two.html").read_text()
    assert "one: Good. two: Good." in text and text.count("data:image/png") == 2
    # Told apart by colour and dashes.
    assert 'class="chart"' in text and "#d55e00" in text
    assert '"measured, one"' in text and '"measured, two"' in text
    assert '<tr><td>one</td><td class="text">22</td><td>0.9997</td>' in text
    assert '<td>two</td><td class="text">22</td><td>0.5</td>' in text
    assert '<td>two</td><td class="text">59</td><td>1</td>' in text
    assert report(folder, folder).exit_code == 2
    assert report(folder, other, folder).exit_code == 2


def test_no_browser(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pdf, "find_browser", lambda: None)
    done = report(folder, "--format", "pdf")
    assert done.exit_code == 2 and done.stderr.count("\n") == 1
    assert "report.pdf: needs a browser to print with" in done.stderr
    assert not (folder / "report.pdf").exists()


def test_tables_stay_tables(folder: Path) -> None:
    """A page that was read back has what was written."""
    assert read_page_data(folder).tables == [
        Table("Surfaces", ["kPa", "R²"], [[22, 0.99971]], "Table 4.1", [])
    ]
