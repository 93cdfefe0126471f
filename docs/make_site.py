"""Build the documents, the notebooks and the Python interface as a site; dead links are errors.

python docs/make_site.py                # into out/site (make site)
python docs/make_site.py FOLDER

The generator is Sphinx with MyST and the theme Furo. The pages are opened as files: nothing is
loaded from elsewhere, and the search needs no server.
"""

from __future__ import annotations

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
import tempfile
import tomllib
from base64 import b64encode
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
#: Files of the repository that become pages, and those that pages show or link to.
PAGES = ("*.md", "docs/**/*.md", "examples/*/*.md", "examples/**/*.ipynb")
ASSETS = ("LICENSE", "docs/pictures/*", "examples/*/*")
#: The page that the site opens with, and the list of documents: its groups, titles and order are
#: those of the navigation.
START, INDEX = "docs/start.md", "docs/README.md"
#: Comment before the title of a generated page.
GENERATED = re.compile(r"\A<!--.*?-->\s*", re.DOTALL)
#: The target of a Markdown link or picture; a link with its text; a heading of a group.
LINK = re.compile(r"(?<=\]\()([^)\s]+)(?=\))")
ENTRY = re.compile(r"^## (.+)$|\[([^\]]+)\]\(([^)\s#]+)[^)]*\)", re.MULTILINE)
CODE = re.compile(r"(```.*?```|`[^`\n]+`)", re.DOTALL)
STYLE = """
body { --font-size--normal: 16px }
h1 { font-size: 2.1em }
h2 { font-size: 1.6em }
h3 { font-size: 1.25em }
.table-wrapper table.docutils { font-size: 0.9em; box-shadow: none }
table.docutils td, table.docutils th { padding: 0.35rem 0.6rem; vertical-align: top }
table.docutils { margin-left: 0; margin-right: auto }
table.docutils td code { white-space: normal; overflow-wrap: anywhere }
table.docutils td:has(code) { min-width: 7.2rem }
article table { border-collapse: collapse; font-size: 0.9em }
article table td, article table th { padding: 0.2rem 0.6rem; text-align: left }
article img { max-width: 100%; height: auto }
h1 code, h2 code, h3 code { overflow-wrap: anywhere }
"""


def place(page: str) -> str:
    """Return where a file of the repository stands in the site's sources."""
    path = PurePosixPath(page)
    if page == START:
        return "index.md"
    if path.name == "README.md" and path.parts[:-1]:
        return path.with_name("index.md").as_posix()
    return path.with_suffix(".md").as_posix() if path.suffix == ".ipynb" else page


def settings(root: Path) -> dict[str, Any]:
    """Return the settings of Sphinx."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        version = tomllib.load(file)["project"]["version"]
    return {
        "project": "bubblefit",
        "html_title": f"bubblefit {version}",
        "extensions": ["myst_parser"],
        "myst_heading_anchors": 6,
        "suppress_warnings": ["misc.highlighting_failure"],  # of samples that are shortened
        "highlight_language": "none",
        "html_theme": "furo",
        "html_static_path": ["_static"],
        "html_css_files": ["style.css"],
        "html_copy_source": False,
        "html_show_sphinx": False,
        "html_show_copyright": False,
        # Summaries are fetched from the pages, which a browser refuses for files.
        "html_show_search_summary": False,
    }


def stage(source: Path, root: Path = ROOT) -> None:
    """Copy the pages and make those of notebooks, of the Python interface and of the start."""
    for pattern in (*PAGES, *ASSETS):
        for path in filter(Path.is_file, root.glob(pattern)):
            page = path.relative_to(root).as_posix()
            target = source / place(page)
            target.parent.mkdir(parents=True, exist_ok=True)
            if path.suffix == ".ipynb":
                text = "\n".join(notebook_lines(json.loads(path.read_text(encoding="utf-8"))))
            elif path.suffix == ".md":
                text = path.read_text(encoding="utf-8")
            else:
                shutil.copy(path, target)
                continue
            target.write_text(relinked(GENERATED.sub("", text), page), encoding="utf-8")
    if root == ROOT:
        api = source / "docs/reference/api"
        runpy.run_path(str(ROOT / "docs/make_api.py"))["write"](api)
        for path in api.glob("*.md"):
            text = GENERATED.sub("", path.read_text(encoding="utf-8"))
            if path.name == "index.md":  # names pages that only the site has
                text = re.sub(r"`reference/api/(\w+)`", r"[\g<0>](\1.md)", text)
            page = path.relative_to(source).as_posix()
            path.write_text(relinked(text, page), encoding="utf-8")
    for page, groups in navigation(source, root).items():
        with (source / page).open("a", encoding="utf-8") as file:
            file.writelines(table_of_contents(*group) for group in groups.items())
    (source / "_static").mkdir()
    (source / "_static/style.css").write_text(STYLE, encoding="utf-8")
    lines = [f"{name} = {value!r}" for name, value in settings(root).items()]
    (source / "conf.py").write_text("\n".join(lines), encoding="utf-8")


def relinked(text: str, page: str) -> str:
    """Return the text of a page with its relative links leading to places in the site."""
    folder, site_folder = PurePosixPath(page).parent, PurePosixPath(place(page)).parent

    def link(match: re.Match[str]) -> str:
        target, mark, anchor = match[1].partition("#")
        if not target or ":" in target:
            return match[1]
        file = os.path.normpath(folder / target)
        return os.path.relpath(place(file), site_folder) + mark + anchor

    parts = CODE.split(text)
    parts[::2] = [LINK.sub(link, part) for part in parts[::2]]
    return "".join(parts)


def notebook_lines(content: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of a page from a notebook: text, code and outputs."""
    for cell in content["cells"]:
        text = "".join(cell["source"])
        yield text if cell["cell_type"] == "markdown" else f"\n```python\n{text}\n```\n"
        for output in cell.get("outputs", ()):
            data = {kind: "".join(lines) for kind, lines in output.get("data", {}).items()}
            if "image/png" in data:
                yield f"\n![drawn](data:image/png;base64,{data['image/png'].strip()})\n"
                continue
            if "image/svg+xml" in data:
                drawing = b64encode(data["image/svg+xml"].encode()).decode()
                # As HTML: Markdown refuses the address of a drawing.
                yield f'\n<img alt="drawn" src="data:image/svg+xml;base64,{drawing}">\n'
                continue
            if data.get("text/html", "").startswith("<table>"):  # of ours, in plain tags
                yield f"\n{data['text/html']}\n"
                continue
            printed = "".join(output.get("text") or data.get("text/plain") or "").rstrip()
            if printed:
                yield f"\n```text\n{printed}\n```\n"


def navigation(source: Path, root: Path = ROOT) -> dict[str, dict[str, list[str]]]:
    """Return tables of contents with every page once: page that holds them, caption, entries.

    The page that the site opens with has the groups of docs/README.md in their order. A page that
    these do not name is below the index of its folder, or else in the last group.
    """
    remaining = {path.relative_to(source).as_posix() for path in source.rglob("*.md")}
    remaining -= {"index.md", place(INDEX)}
    groups = {"": [f"All documents <{place(INDEX)}>"]}
    caption = ""
    for heading, title, target in ENTRY.findall((root / INDEX).read_text(encoding="utf-8")):
        page = place(os.path.normpath(PurePosixPath(INDEX).parent / target))
        caption = heading or caption
        if page in remaining:
            groups.setdefault(caption, []).append(f"{title} <{page}>")
            remaining.remove(page)
        elif page == "index.md":
            groups.setdefault(caption, []).append(f"{title} <self>")
    below: dict[str, list[str]] = {}
    for page in sorted(remaining):
        index = PurePosixPath(page).with_name("index.md").as_posix()
        if index != "index.md" and index not in remaining and (source / index).is_file():
            below.setdefault(index, []).append(PurePosixPath(page).name)
        else:
            groups.setdefault("About", []).append(page)
    return {index: {"": entries} for index, entries in below.items()} | {"index.md": groups}


def table_of_contents(caption: str, entries: list[str]) -> str:
    """Return a table of contents, of which only the navigation is seen."""
    options = [":hidden:", *([f":caption: {caption}"] if caption else [])]
    return "\n".join(["", "", "```{toctree}", *options, "", *entries, "```", ""])


def build(out: Path, root: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """Build the site and return the process; warnings, such as dead links, make it fail."""
    shutil.rmtree(out, ignore_errors=True)
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "source"
        stage(source, root)
        command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html"]
        command += ["-d", f"{folder}/cache", str(source), str(out)]
        return subprocess.run(command, capture_output=True, text=True)


def main(arguments: Sequence[str]) -> int:
    """Build the site and print its place."""
    out = Path(arguments[0]) if arguments else ROOT / "out" / "site"
    process = build(out)
    message = f"wrote {out / 'index.html'}" if process.returncode == 0 else process.stderr
    print(message, file=sys.stderr)
    return process.returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
