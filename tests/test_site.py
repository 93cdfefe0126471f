"""The documents as a site, and on the terminal: every page is there, every link leads somewhere."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from bubblefit.cli.start import find_document, pages, title_of

from .commands import in_process
from .complaints import complaint
from .places import ROOT
from .test_documents import messages

SITE: Any = SimpleNamespace(**runpy.run_path(str(ROOT / "docs/make_site.py")))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built whole."""
    out = tmp_path_factory.mktemp("site") / "site"
    done = SITE.build(out)
    assert done.returncode == 0 and "WARNING" not in done.stderr, done.stderr
    return out


def test_every_document_is_a_page(site: Path) -> None:
    documents = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("examples/*/*.md")]
    for document in documents:
        page = site / document.relative_to(ROOT).with_suffix(".html")
        page = page.with_name("index.html") if document.name == "README.md" else page
        assert page.is_file(), document
    assert 'class="' in (site / "index.html").read_text()


def test_the_notebook_and_the_interface_are_in_it(site: Path) -> None:
    notebook = (site / "examples/notebook/first-fit.html").read_text()
    assert "A first fit from Python" in notebook and "bf.read_project(" in notebook
    assert "start 0: converged" in notebook
    listed = (site / "index.html").read_text()
    for page in ("docs/reference/api/fits.html", "examples/notebook/first-fit.html"):
        assert f'href="{page}"' in listed
    assert "write_table" in (site / "docs/reference/api/fits.html").read_text()
    # Linked to as a page, not as a file to take away.
    assert 'href="examples/notebook/first-fit.html">notebook</a>' in listed


def test_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    for page in site.rglob("*.html"):
        text = page.read_text()
        loaded = re.findall(r'<(?:script|img|link|iframe)[^>]*(?:src|href)="([^"]+)"', text)
        assert not [address for address in loaded if re.match(r"(https?:)?//", address)], page


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("[x](how-to/none.md)", "how-to/none.md"),
        ("[x](../README.md#nowhere)", "#nowhere"),
        ("[x](pictures/none.png)", "pictures/none.png"),
    ],
)
def test_a_link_that_leads_nowhere_is_an_error(tmp_path: Path, words: str, said: str) -> None:
    root = tmp_path / "root"
    (root / "docs").mkdir(parents=True)
    (root / "README.md").write_text("# One\n\n[two](docs/README.md)\n")
    (root / "docs/README.md").write_text(f"# Two\n\n{words}\n")
    done = SITE.build(tmp_path / "site", root)
    assert done.returncode != 0 and said in done.stderr


def test_pages_stand_in_the_order_of_the_index(tmp_path: Path) -> None:
    for name in ("README.md", "LAST.md", "docs/how-to/a.md", "docs/how-to/b.md", "docs/how-to/c.md",
                 "docs/reference/d.md", "docs/reference/api/e.md"):  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f"# {name}\n")
    (tmp_path / "docs/README.md").write_text("[b](how-to/b.md), [c](how-to/c.md)")
    assert SITE.navigation(tmp_path) == [
        {"bubblefit": "README.md"},
        {"Documents": "docs/README.md"},
        {"How to": ["docs/how-to/b.md", "docs/how-to/c.md", "docs/how-to/a.md"]},
        {"Reference": ["docs/reference/d.md"]},
        {"Python": ["docs/reference/api/e.md"]},
        {"About": ["LAST.md"]},
    ]


def test_a_notebook_is_words_code_and_what_it_gave() -> None:
    cells = [
        {"cell_type": "markdown", "source": ["# A\n", "b"]},
        {"cell_type": "code", "source": ["1 + 1"], "outputs": [
            {"text": ["out\n"]}, {"data": {"text/plain": ["2"], "text/html": ["<b>2</b>"]}},
            {"data": {"image/png": "QUJD\n", "text/plain": ["<Figure>"]}},
        ]},
    ]  # fmt: skip
    assert [line.strip() for line in SITE.notebook({"cells": cells})] == [
        "# A\nb", "```python\n1 + 1\n```", "```text\nout\n```", "```text\n2\n```",
        "![drawn](data:image/png;base64,QUJD)",
    ]  # fmt: skip


# On the terminal


def test_every_page_is_listed_with_its_title(tmp_path: Path) -> None:
    said = in_process("docs", cwd=tmp_path).stdout.splitlines()
    assert len(said) == len(pages()) == len({line.split()[0] for line in said})
    assert "how-to/terminal" in pages() and "changelog" in pages()
    for path in (ROOT / "docs").rglob("*.md"):
        assert path in pages().values(), path
    (line,) = (line for line in said if line.startswith("reference/law "))
    assert line.split(maxsplit=1)[1] == title_of(ROOT / "docs/reference/law.md")


@pytest.mark.parametrize("topic", ["marc", "how-to/marc", "docs/how-to/marc.md"])
def test_a_page_by_any_of_its_names(topic: str, tmp_path: Path) -> None:
    page = ROOT / "docs/how-to/marc.md"
    assert in_process("docs", topic, cwd=tmp_path).stdout == page.read_text()
    assert in_process("docs", topic, "--path", cwd=tmp_path).stdout == f"{page}\n"


def test_of_two_pages_of_one_name_the_other_is_named(tmp_path: Path) -> None:
    done = in_process("docs", "bending", "--path", cwd=tmp_path)
    assert done.stdout == f"{ROOT}/docs/how-to/bending.md\n"
    assert done.stderr == "note: there is also validation/bending\n"
    assert find_document("validation/bending", pages()) == ("validation/bending", [])


def test_a_page_that_is_not_there(tmp_path: Path) -> None:
    done = in_process("docs", "projet-file", cwd=tmp_path, code=2)
    said = "projet-file: no such page; did you mean 'project-file'? (`bubblefit docs` lists every"
    assert done.stderr == f"bubblefit: {said} page)\n"
    assert "did you mean" not in complaint(find_document, "zzzzzz", pages())


def test_messages_point_to_pages_that_come_with_it() -> None:
    """Also in templates of decks; nobody who installed a wheel has a docs/ folder at hand."""
    pointed = 0
    for place, text in messages():
        for topic in re.findall(r"bubblefit docs ([\w/-]+)", text):
            pointed += 1
            assert find_document(topic, pages()), place
        for name in re.findall(r"docs/[\w/-]+\.md", text):
            assert (ROOT / name).is_file(), (place, name)
            assert place.startswith("templates/"), f"{place}: say `bubblefit docs` for {name}"
    assert pointed > 5
