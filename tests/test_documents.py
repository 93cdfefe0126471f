"""The documents against what they speak of: tests with their tolerances, scripts, figures."""

from __future__ import annotations

import ast
import html
import re
import runpy
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import unquote, urlsplit

import bubblefit
import pytest
from bubblefit.cli.main import COMMANDS
from bubblefit.cli.start import find_document, pages, title_of
from bubblefit.experiments.registry import kind_names
from bubblefit.project.schema import project_file as project_model
from bubblefit.solvers.registry import solver_sections

from .support.browser import browser
from .support.commands import in_process, one_line
from .support.golden import is_alike_line, normalised
from .support.paths import PUBLISHED, ROOT, load_script, syntax_tree
from .support.refusals import complaint


def test_documents_that_speak_of_the_thesis_link_to_it():
    for document in (ROOT / "docs").glob("*/*.md"):
        text = re.sub(r"```.*?```|^    .*?$", "", document.read_text(), flags=re.DOTALL | re.M)
        if re.search(r"\bthe thesis\b", text, re.IGNORECASE):
            assert re.search(r"he thesis\]\([./]*references\.md", text), document


def test_every_key_of_the_project_file_is_documented():
    text = (ROOT / "docs" / "reference" / "project-file.md").read_text()

    def keys(annotation):
        for name, field in getattr(annotation, "model_fields", {}).items():
            yield name
            yield from keys(field.annotation)
        for inside in getattr(annotation, "__args__", ()):
            yield from keys(inside)

    models = project_model(frozenset(kind_names())), *solver_sections().values()
    names = {key for model in models for key in keys(model)}
    missing = {key for key in names if not re.search(rf"\b{key}\b", text)}
    assert len(names) > 100 and not missing


def test_every_published_table_has_source_and_units(shared_data):
    described = (PUBLISHED / "README.md").read_text()
    tables = {path.name: path.read_bytes() for path in PUBLISHED.glob("*.csv")}
    assert len(tables) == 4
    for name, content in tables.items():
        assert f"| `{name}` |" in described and content.startswith(b"# ")
    there = {path.name: path.read_bytes() for path in (shared_data / "benchmarks").glob("*.csv")}
    assert tables == there


DOCUMENTS = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").glob("*/*.md")]
)


RESULTS, FIGURES = (ROOT / "docs" / "validation" / f"{name}.md" for name in ("results", "figures"))


#: "0.5 %", "1e-4", "0.03 mm".
TOLERANCE = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?(?:e-?\d+)?)( %)?(?![\w.])")


TEST = re.compile(r"`(tests/[\w/]+\.py)::(\w+)`")


#: What a tolerance is called where it is not compared with.
NAMES = {"rel", "abs", "rtol", "atol", "tolerance"}


SAMPLES = [(p, s) for p in DOCUMENTS for s in re.findall(r"```text\n(.*?)```", p.read_text(), re.S)]


@pytest.mark.parametrize(("path", "sample"), SAMPLES, ids=lambda x: getattr(x, "stem", ""))
def test_samples_of_output_stand_in_golden_files(path, sample):
    """Every line stands in one golden file, in its order; an error is that of its command."""
    if sample.startswith("bubblefit: bubbel:"):
        assert in_process("bubbel", cwd=ROOT, code=2).stderr == sample
        return
    said = normalised(sample, Path("no-such-folder"))
    lines = [line for line in said.splitlines() if line != "..."]
    runs = [golden.read_text().splitlines() for golden in (ROOT / "tests" / "golden").iterdir()]

    def holds(printed):
        # `any` on an iterator goes on behind what it found.
        return all(any(is_alike_line(line, other) for other in printed) for line in lines)

    assert any(holds(iter(run)) for run in runs), path


def verified():
    """Row by row of the table of results: what, within, and asserted by."""
    section = RESULTS.read_text().split("\n## Verified against\n")[1].split("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("| ")]
    assert rows[0] == ["what", "against", "within", "asserted by"]
    return [(f"{what}, {against}", within, by) for what, against, within, by in rows[1:]]


def definition(path, name):
    for node in syntax_tree(path).body:
        if isinstance(node, ast.FunctionDef) and node.name == name:
            return node, path
        if isinstance(node, ast.Assign) and name in [ast.unparse(t) for t in node.targets]:
            return node, path
        if isinstance(node, ast.ImportFrom) and node.level and node.module:
            if name in [a.name for a in node.names]:
                beside = path.parents[node.level - 1].joinpath(*node.module.split("."))
                return definition(beside.with_suffix(".py"), name)
    return None


def tolerances(node, path, deep=2):
    """Numbers that a test compares with, or gives as tolerance; of what it calls, likewise."""
    if isinstance(node, ast.Assign):
        yield from numbers(node.value)
    for part in ast.walk(node):
        if isinstance(part, ast.Compare):
            yield from numbers(part)
        elif isinstance(part, ast.keyword) and part.arg in NAMES:
            yield from numbers(part.value)
        elif isinstance(part, ast.FunctionDef):
            for argument, default in zip(part.args.args[::-1], part.args.defaults[::-1]):  # noqa: B905
                yield from numbers(default) if argument.arg in NAMES else ()
            yield from (n for d in part.decorator_list for n in numbers(d))
        elif isinstance(part, ast.Name) and deep:
            found = definition(path, part.id)
            if found is not None and found[0] is not node:
                yield from tolerances(*found, deep - 1)


def numbers(node):
    values = (part.value for part in ast.walk(node) if isinstance(part, ast.Constant))
    return (value for value in values if isinstance(value, float))


@pytest.mark.parametrize(("what", "within", "by"), verified(), ids=[row[0] for row in verified()])
def test_row_of_results_is_asserted_with_its_tolerance(what, within, by):
    tests, asserted = TEST.findall(by), set()
    assert tests, f"{what}: names no test"
    for place, name in tests:
        found = definition(ROOT / place, name)
        assert found is not None, f"{place} has no {name}"
        asserted |= set(tolerances(*found))
    said = [float(number) / (100 if cent else 1) for number, cent in TOLERANCE.findall(within)]
    assert said, f"{what}: says no tolerance"
    for number in said:
        close = [a for a in asserted if a == pytest.approx(number, rel=1e-9)]
        assert close, f"{what}: {number:g} is not in {by}"


def test_scripts_named_in_documents_exist_and_benchmarks_have_figures():
    for document in DOCUMENTS:
        for name in re.findall(r"(?:benchmarks|tests|solvers)/[\w/]+\.py", document.read_text()):
            assert (ROOT / name).is_file(), f"{document.relative_to(ROOT)} names {name}"
    named = set(re.findall(r"benchmarks/[\w/]+\.py", FIGURES.read_text()))
    commands = (p for p in (ROOT / "benchmarks").rglob("*.py") if "__main__" in p.read_text())
    assert named == {str(path.relative_to(ROOT)) for path in commands}


#: A number with a percent sign, or a number of times: a share that somebody has typed.
TYPED = re.compile(r"\d\s?%|\d\s(?:per cent|percent|times)\b")


#: Rooms of the product, in which no message says what was measured elsewhere.
OUTSIDE = {"tests", "benchmarks", "docs", "examples", ".venv", "build", "out"}


def messages():
    for path in sorted(ROOT.rglob("*.py")):
        if path.relative_to(ROOT).parts[0] in OUTSIDE:
            continue
        nodes, apart = list(ast.walk(syntax_tree(path))), set()
        for node in nodes:  # docstrings, and formats of what is computed, such as ".0%"
            if isinstance(node, ast.Expr):
                apart.add(id(node.value))
            elif isinstance(node, ast.FormattedValue) and node.format_spec is not None:
                apart.update(id(part) for part in ast.walk(node.format_spec))
        for node in nodes:
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                if id(node) not in apart:
                    yield f"{path.relative_to(ROOT)}:{node.lineno}", node.value
    for path in sorted((ROOT / "templates").rglob("*.*")):
        for number, line in enumerate(path.read_text().splitlines(), 1):
            tags = re.sub(r"\{%.*?%\}|\{\{.*?\}\}|:\s*\d+%;", "", line)
            yield f"{path.relative_to(ROOT)}:{number}", tags


def test_no_message_states_a_fixed_percentage():
    """A share in a message ("off by 56 %") would be right for one example at best."""
    typed = [
        f"{place}: {text.strip()}"
        for place, text in messages()
        if TYPED.search(re.sub(r"\{:[^}]*\}", "", text)) and ".css" not in place
    ]
    assert typed == []


def visible(page):
    """The text of a page of the site, without tags, such as those that colour code."""
    return html.unescape(re.sub(r"<[^>]+>", "", page.read_text()))


SITE = SimpleNamespace(**runpy.run_path(str(ROOT / "docs/make_site.py")))


def test_site_has_every_document_the_notebook_and_the_interface(tmp_path):
    site = tmp_path / "site"
    done = SITE.build(site)
    assert done.returncode == 0 and "WARNING" not in done.stderr, done.stderr
    for document in DOCUMENTS:
        page = SITE.place(document.relative_to(ROOT).as_posix())
        assert (site / page).with_suffix(".html").is_file(), document
    notebook = visible(site / "examples/notebook/first-fit.html")
    assert "A first fit from Python" in notebook and "bf.read_project(" in notebook
    assert "start 0: converged" in notebook
    assert len(list((site / "examples/gallery").glob("*.html"))) == 9  # with the list of them
    beam = (site / "examples/gallery/a-beam.html").read_text()
    assert beam.count("data:image/svg+xml;base64,") == 2 and "<caption>uniaxial" in beam
    assert "never used Python" in (site / "index.html").read_text()
    listed = (site / "README.html").read_text()
    assert 'href="docs/reference/api/fits.html"' in listed
    assert "write_table" in visible(site / "docs/reference/api/fits.html")
    # Linked to as a page, not as a file to take away.
    assert re.search(r'href="examples/notebook/first-fit.html"><span[^>]*>notebook</span>', listed)
    for page in site.rglob("*.html"):  # nothing is loaded from elsewhere
        text = page.read_text()
        loaded = re.findall(r'<(?:script|img|link|iframe)[^>]*(?:src|href)="([^"]+)"', text)
        assert not [address for address in loaded if re.match(r"(https?:)?//", address)], page
    with browser(tmp_path / "home") as opened:  # as a file, without a server
        opened.call("Page.navigate", url=(site / "search.html").as_uri() + "?q=crosshead")
        end = time.monotonic() + 30
        links = "[...document.querySelectorAll('#search-results li a')].map(String)"
        while not (found := opened.run(links)) and time.monotonic() < end:
            time.sleep(0.1)
    assert found and opened.complaints == []
    places = [Path(unquote(urlsplit(address).path)) for address in found]
    assert all(place.is_file() and "rosshead" in visible(place) for place in places)


def test_dead_link_is_an_error(tmp_path):
    links = ("how-to/none.md", "../README.md#nowhere", "pictures/none.png")
    (tmp_path / "root" / "docs").mkdir(parents=True)
    (tmp_path / "root" / "README.md").write_text("# One\n\n[two](docs/README.md)\n")
    (tmp_path / "root" / "docs/start.md").write_text("# Start\n")
    text = "# Two\n\n" + " ".join(f"[x]({link})" for link in links)
    (tmp_path / "root" / "docs/README.md").write_text(text)
    done = SITE.build(tmp_path / "site", tmp_path / "root")
    assert done.returncode != 0
    for link in links:
        assert link.removeprefix("../README.md#") in done.stderr


def test_navigation_has_groups_of_the_index_and_pages_below_their_folder(tmp_path):
    source, root = tmp_path / "source", tmp_path / "root"
    names = ("index", "LAST", "docs/index", "docs/how-to/a", "docs/how-to/b", "docs/reference/d",
             "docs/reference/api/index", "docs/reference/api/e")  # fmt: skip
    for name in names:
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / f"{name}.md").write_text(f"# {name}\n")
    (root / "docs").mkdir(parents=True)
    (root / "docs/README.md").write_text(
        "## How to\n- [B](how-to/b.md), then [A](how-to/a.md#anchor)\n"
        "## Reference\n- [Python](reference/api/README.md)\n- [D](reference/d.md)\n"
    )
    assert SITE.navigation(source, root) == {
        "docs/reference/api/index.md": {"": ["e.md"]},
        "index.md": {
            "": ["All documents <docs/index.md>"],
            "How to": ["B <docs/how-to/b.md>", "A <docs/how-to/a.md>"],
            "Reference": ["Python <docs/reference/api/index.md>", "D <docs/reference/d.md>"],
            "About": ["LAST.md"],
        },
    }


def test_pages_are_shown_on_the_terminal(tmp_path):
    said = in_process("docs", cwd=tmp_path).stdout.splitlines()
    assert len(said) == len(pages()) == len({line.split()[0] for line in said})
    assert "how-to/terminal" in pages() and "changelog" in pages()
    assert set((ROOT / "docs").rglob("*.md")) <= set(pages().values())
    (line,) = (line for line in said if line.startswith("reference/law "))
    assert line.split(maxsplit=1)[1] == title_of(ROOT / "docs/reference/law.md")
    page = ROOT / "docs/how-to/marc.md"
    for topic in ("marc", "how-to/marc", "docs/how-to/marc.md"):
        assert in_process("docs", topic, cwd=tmp_path).stdout == page.read_text()
        assert in_process("docs", topic, "--path", cwd=tmp_path).stdout == f"{page}\n"
    done = in_process("docs", "bending", "--path", cwd=tmp_path)
    assert done.stdout == f"{ROOT}/docs/how-to/bending.md\n"
    assert "validation/bending" in done.stderr
    assert find_document("validation/bending", pages()) == ("validation/bending", [])
    done = in_process("docs", "projet-file", cwd=tmp_path, code=2)
    one_line(done, "projet-file", "pages like it: reference/project-file")
    assert "like it" not in complaint(find_document, "zzzzzz", pages())


def test_messages_name_pages_that_are_shipped():
    pointed = 0
    for place, text in messages():
        for topic in re.findall(r"bubblefit docs ([\w/-]+)", text):
            pointed += 1
            assert find_document(topic, pages()), place
        for name in re.findall(r"docs/[\w/-]+\.md", text):
            assert (ROOT / name).is_file(), (place, name)
            assert place.startswith("templates/"), f"{place}: say `bubblefit docs` for {name}"
    assert pointed > 5


MAKER = load_script("docs/make_api.py")


def test_interface_is_on_the_pages_of_the_index():
    index = (ROOT / "docs/reference/api/README.md").read_text()
    pages = MAKER.pages()
    for name in pages:
        assert f"`reference/api/{name.removesuffix('.md')}`" in index
    text = "".join(pages.values())
    for name in bubblefit.__all__:
        assert f"## `bubblefit.{name}`\n" in text
    assert "breaks: ArrayLike" in text and "_SupportsArray" not in text
    # Shapes and units of the arrays that a test is made of.
    bubble = text.partition("## `bubblefit.Bubble`\n")[2].partition("\n## ")[0]
    assert "**Parameters**\n\n- `points`, *(m, 3) array, (frames, m, 3) array" in bubble
    assert "- `pressures`, *(frames,) array, MPa*: " in bubble and "**Raises**" in bubble


def test_text_for_a_package_index_has_absolute_links_to_existing_documents(
    tmp_path,
):
    """Links of the README are dead on an index; `bubblefit docs` prints what they lead to."""
    code = "import setuptools.build_meta as m, sys; m.prepare_metadata_for_build_wheel(sys.argv[1])"
    command = [sys.executable, "-c", code, str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (path,) = tmp_path.glob("*.dist-info/METADATA")
    head, _, text = path.read_text(encoding="utf-8").partition("\n\n")
    assert "Description-Content-Type: text/markdown" in head
    assert not re.findall(r"\]\((?!https://)", text) and "# bubblefit" in text
    topics = re.findall(r"`bubblefit docs ([^`]+)`", text)
    assert len(topics) > 10 and all(find_document(topic, pages()) for topic in topics)


def test_every_command_and_every_exit_code_is_in_its_document():
    listed = (ROOT / "docs/reference/commands.md").read_text(encoding="utf-8")
    assert [name for name in COMMANDS if f"`{name}" not in listed] == []
    help_text = " ".join(in_process("--help", cwd=ROOT).stdout.split())
    codes = re.findall(r"(\d+) \w", help_text.partition("Exit codes: ")[2].partition(". ")[0])
    failures = (ROOT / "docs/reference/failures.md").read_text(encoding="utf-8")
    table = failures.partition("## Exit codes")[2].partition("\n## ")[0]
    assert re.findall(r"^\| (\d+) \|", table, re.M) == codes
