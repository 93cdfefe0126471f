"""Build the documents and the notebook as a site; dead links are errors.

python docs/make_site.py                # into out/site (make site)
python docs/make_site.py FOLDER
"""

from __future__ import annotations

import json
import re
import runpy
import shutil
import subprocess
import sys
import tempfile
from base64 import b64encode
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
#: Files of the site below the root.
PAGES = ("*.md", "docs/**/*.md", "examples/*/*.md", "examples/**/*.ipynb")
BESIDE = ("LICENSE", "docs/pictures/*", "examples/*/*")
#: Sections by the folder of their pages, in order; in each the pages as docs/README.md has them.
SECTIONS = {
    "How to": "docs/how-to",
    "Reference": "docs/reference",
    "Python": "docs/reference/api",
    "Validation": "docs/validation",
    "Examples": "examples",
}
#: Text in tables wraps, and pages may be wide.
STYLE, CSS = (
    "style.css",
    """.wy-table-responsive table td, .wy-table-responsive table th { white-space: normal }
.wy-nav-content { max-width: 1100px }
""",
)
#: A page that is opened as a file may neither start a worker nor read JSON: the search of mkdocs
#: (lunr, worker and main; the index as text) runs as one script.
SEARCH = """%s
window.Worker = function () {
  var self = this, onmessage
  var postMessage = data => setTimeout(() => self.onmessage({data: data}))
  var importScripts = () => {}
  var XMLHttpRequest = function () {
    this.addEventListener = (_, loaded) => { this.loaded = loaded }
    this.open = () => { this.responseText = %s }
    this.send = () => this.loaded()
  }
%s
  // The index is made on the page that searches only.
  this.postMessage = data =>
    document.getElementById("mkdocs-search-query") && onmessage({data: data})
}
%s"""
#: Comment before the title of a generated page.
WRITTEN = re.compile(r"\A<!--.*?-->\s*", re.DOTALL)


def settings(source: Path, out: Path) -> dict[str, Any]:
    """Return the settings of mkdocs: nothing is loaded from elsewhere, dead links are warnings."""
    return {
        "site_name": "bubblefit",
        "docs_dir": str(source),
        "site_dir": str(out),
        "theme": {
            "name": "readthedocs",
            "highlightjs": False,
            "include_homepage_in_sidebar": False,
        },
        "use_directory_urls": False,  # so that it can be read without a server
        "plugins": ["search"],
        "extra_css": [STYLE],
        "markdown_extensions": [{"toc": {"permalink": False}}, "tables", "fenced_code"],
        "validation": {
            "nav": {"omitted_files": "warn", "not_found": "warn"},
            "links": {"not_found": "warn", "anchors": "warn", "unrecognized_links": "warn"},
        },
        "nav": navigation(source),
    }


def stage(source: Path, root: Path = ROOT) -> None:
    """Copy the pages, make those of the Python interface, and turn notebooks into pages."""
    for pattern in (*PAGES, *BESIDE):
        for path in filter(Path.is_file, root.glob(pattern)):
            place = source / path.relative_to(root)
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, place)
            if path.suffix == ".ipynb":
                page = place.with_suffix(".md")
                page.write_text("\n".join(notebook(json.loads(path.read_text()))), encoding="utf-8")
    if root == ROOT:
        runpy.run_path(str(ROOT / "docs/make_api.py"))["write"](source / "docs/reference/api")
    # A page that stands for a notebook is linked to in its place.
    for page in source.rglob("*.md"):
        text = WRITTEN.sub("", page.read_text(encoding="utf-8"))
        page.write_text(text.replace(".ipynb)", ".md)"), encoding="utf-8")
    (source / STYLE).write_text(CSS, encoding="utf-8")


def notebook(content: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of a page from a notebook: text, code and outputs."""
    for cell in content["cells"]:
        text = "".join(cell["source"])
        yield text if cell["cell_type"] == "markdown" else f"\n```python\n{text}\n```\n"
        for output in cell.get("outputs", ()):
            data = {kind: "".join(own) for kind, own in output.get("data", {}).items()}
            if "image/png" in data:
                yield f"\n![drawn](data:image/png;base64,{data['image/png'].strip()})\n"
                continue
            if "image/svg+xml" in data:
                drawing = b64encode(data["image/svg+xml"].encode()).decode()
                yield f"\n![drawn](data:image/svg+xml;base64,{drawing})\n"
                continue
            if data.get("text/html", "").startswith("<table>"):  # of ours, in plain tags
                yield f"\n{data['text/html']}\n"
                continue
            said = "".join(output.get("text") or data.get("text/plain") or "").rstrip()
            if said:
                yield f"\n```text\n{said}\n```\n"


def navigation(source: Path) -> list[dict[str, Any]]:
    """Return every page once, those of a folder in the order of docs/README.md."""
    pages = [path.relative_to(source).as_posix() for path in source.rglob("*.md")]
    index = (source / "docs/README.md").read_text(encoding="utf-8")

    def place(page: str) -> tuple[int, str]:
        named = index.find(f"]({page.removeprefix('docs/')})")
        return (named if named >= 0 else len(index), page)

    listed = {
        name: [p for p in sorted(pages, key=place) if _section(p) == name] for name in SECTIONS
    }
    first = ["README.md", "docs/README.md"]
    rest = [p for p in sorted(pages) if p not in first and _section(p) is None]
    return [
        {"bubblefit": first[0]},
        {"Documents": first[1]},
        *({name: pages_of} for name, pages_of in listed.items() if pages_of),
        {"About": rest},
    ]


def _section(page: str) -> str | None:
    """Return the section with the deepest folder above a page."""
    held = [(len(folder), name) for name, folder in SECTIONS.items() if page.startswith(folder)]
    return max(held)[1] if held else None


def build(out: Path, root: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """Build the site and return the mkdocs process; dead links give a non-zero exit code."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "source"
        stage(source, root)
        config = Path(folder) / "mkdocs.yml"
        config.write_text(json.dumps(settings(source, out.resolve())), encoding="utf-8")  # is YAML
        command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--clean"]
        done = subprocess.run([*command, "-f", config], capture_output=True, text=True)
    if done.returncode == 0:
        names = ("lunr.js", "search_index.json", "worker.js", "main.js")
        lunr, index, *scripts = ((out / "search" / n).read_text(encoding="utf-8") for n in names)
        script = SEARCH % (lunr, json.dumps(index), *scripts)
        (out / "search" / "main.js").write_text(script, encoding="utf-8")
    return done


def main(arguments: Sequence[str]) -> int:
    """Build the site and print its place."""
    out = Path(arguments[0]) if arguments else ROOT / "out" / "site"
    done = build(out)
    message = f"wrote {out / 'index.html'}" if done.returncode == 0 else done.stderr
    print(message, file=sys.stderr)
    return done.returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
