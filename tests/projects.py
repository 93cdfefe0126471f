"""Small projects, for the tests that run whole fits."""

from __future__ import annotations

from pathlib import Path

from .places import KNOWN

#: The easy form of bounds, which serves every form of the moduli.
EASY = "[law.bounds]\nE1 = [0.02, 2.0]\nE2 = [0.02, 1.0]\nG12 = [0.001, 0.2]\n\n"


def small(folder: Path, *changes: tuple[str, str]) -> Path:
    """The known-solution example with 48 quads, changed further by replacing text."""
    text = KNOWN.read_text()
    for old, new in (("elements = 800", "elements = 48"), *changes):
        assert old in text, old
        text = text.replace(old, new, 1)
    path = folder / "project.toml"
    path.write_text(text)
    return path


def with_form(folder: Path, form: str) -> Path:
    """The same with bounds on the moduli and another `[law] form` (lines of TOML)."""
    text = small(folder).read_text()
    first, last = text.index("# Table 4.2. Order"), text.index("[[bubble]]")
    text = text[:first] + EASY + text[last:]
    margin = next(line for line in text.splitlines() if line.startswith("margin"))
    path = folder / "project.toml"
    path.write_text(text.replace(margin, "").replace('form = "cubic"', form))
    return path
