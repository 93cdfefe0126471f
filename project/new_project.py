"""Write a commented project file for tests of one's own."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import InputError, check_one_of
from ..experiments.registry import kind_named, kinds
from ..files import TEMPLATES, __version__, render, write_text
from ..inference.methods import method_names
from ..materials.forms.base import form_names
from .project import read_project

#: What a test is like unless something else is said; mm and kPa.
USUAL: Mapping[str, Any] = {
    "radius": 100.0, "pressures": (20, 60, 100, 150, 200, 250, 300), "diameter": 150.0,
    "pressure": 100.0,
}  # fmt: skip


def writable_kinds() -> list[str]:
    """Return the kinds of test that a project file can be written for: those with a template."""
    folder = TEMPLATES / "project"
    return [name for name in kinds() if (folder / f"{name}.toml.j2").is_file()]


def write_project(
    path: Path, tests: Mapping[str, int], name: str = "My fabric", thickness: float = 0.8,
    form: str = "cubic", **said: Any,
) -> None:  # fmt: skip
    """Write a project file that can be read.
    tests : how many of each kind. name, thickness : of the fabric, mm. said : `USUAL` values that
    are otherwise; mm and kPa. InputError: what is said makes no project. OutputError."""
    values = {**USUAL, **{key: value for key, value in said.items() if value is not None}}
    values["deflection"] = 1.6 * values["diameter"]
    asked = [kind for kind, count in tests.items() if count]
    if not asked:
        known = ", ".join(f"--{kind}" for kind in writable_kinds())
        raise InputError(None, "--own", f"name at least one test: {known}")
    check_one_of(form, form_names(), "--form")
    fitted = [kind for kind in asked if kind_named(kind).fitted]
    parts = [
        render(f"project/{kind}.toml.j2", number=n, count=tests[kind], name=f"{kind}{n}", **values)
        for kind in asked
        for n in range(1, tests[kind] + 1)
    ]
    text = render(
        "project/project.toml.j2", name=_quoted(name), version=__version__, thickness=thickness,
        form=_quoted(form), fitted=bool(fitted), predicted=len(fitted) < len(asked), tests=parts,
        methods=", ".join(f'"{name}"' for name in method_names()),
        # The gauges of strips tell how far a fabric is strained; nothing else does beforehand.
        strain_range="strips" not in asked,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:  # so that a wrong one leaves no folder
        tried = Path(folder) / path.name
        tried.write_text(text, encoding="utf-8")
        try:
            read_project(tried, need_data=False)
        except InputError as error:
            raise InputError(None, error.field, error.problem) from None
    write_text(path, text)


def _quoted(text: str) -> str:
    """Return text as it may stand between TOML's quotation marks."""
    plain = "".join(c for c in text if c.isprintable())
    return plain.replace("\\", "\\\\").replace('"', '\\"')
