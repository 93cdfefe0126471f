"""The documents that come with bubblefit: pages by name, so that messages can point to them."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import Path

from .errors import InputError

ROOT = Path(__file__).resolve().parent
DOCS = ROOT / "docs"
#: Folders of pages; of two pages with one name the first is meant.
FOLDERS = ("how-to", "reference", "", "validation", "reference/api")


def pages() -> dict[str, Path]:
    """Every page by its name below docs/, without .md: "how-to/marc"; "changelog" and the like."""
    found = {}
    for folder in FOLDERS:
        for path in sorted((DOCS / folder).glob("*.md")):
            found[path.relative_to(DOCS).with_suffix("").as_posix()] = path
    for path in sorted(ROOT.glob("*.md")):
        found[path.stem.lower()] = path
    return found


def find_document(topic: str, known: Mapping[str, Path]) -> tuple[str, list[str]]:
    """The page that is meant, and others of the same name.

    Parameters
    ----------
    topic : "marc", "how-to/marc" or "docs/how-to/marc.md". known : as `pages` gives them.

    Raises
    ------
    InputError : there is none.
    """
    wanted = topic.removeprefix("docs/").removesuffix(".md")
    if wanted in known:
        return wanted, []
    named = [name for name in known if name.rpartition("/")[2] == wanted.lower()]
    if named:
        return named[0], named[1:]
    names = [*known, *(name.rpartition("/")[2] for name in known)]
    near = difflib.get_close_matches(wanted.lower(), names, n=1, cutoff=0.5)
    meant = f"; did you mean {near[0]!r}?" if near else ""
    raise InputError(None, topic, f"no such page{meant} (`bubblefit docs` lists every page)")


def title_of(page: Path) -> str:
    """The first heading."""
    for line in page.read_text(encoding="utf-8").splitlines():
        if line.startswith("# "):
            return line.removeprefix("# ")
    return page.stem
