"""A project as it is run, to be written down: everything that its file and the options say."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from ..reading import is_file
from ..sections import beside
from ..solvers.registry import solver_sections

if TYPE_CHECKING:
    from .project import Project

Settings = dict[str, Any]
HEAD = "# As it was run: what the project says, with the options of the command.\n"


@dataclass(frozen=True, eq=False)
class Written:
    """What a project file says, in its own units.

    text : the file's own. common : [fabric] and [units]. tests : the section of each test by its
    name, with the folder that its data were taken from; without what it leaves to defaults, which
    need not go with each other when they are said. whole : each with its defaults. kinds : of the
    tests, by name. cards : each [[card]], in the order of the file.
    """

    text: str
    common: Mapping[str, Any]
    tests: Mapping[str, Settings]
    whole: Mapping[str, Settings]
    kinds: Mapping[str, str]
    cards: Sequence[Settings] = ()


def section_as_run(
    said: Mapping[str, Any], name: str, folder_key: str | None, base: Path, folder: Path | None
) -> Settings:
    """A test's section with its name, and with the folder of its files in full.

    Parameters
    ----------
    folder_key : dotted key of the folder; None where the kind has none. base : the project's
        folder. folder : what the command says instead of the section.
    """
    whole = {**plain(said), "name": name}
    if folder_key is None:
        return whole
    *above, key = folder_key.split(".")
    table: Any = whole
    for part in above:
        table = table.get(part)
        if not isinstance(table, dict):
            return whole  # its data are of another sort
    given = base / os.path.expanduser(table.get(key, "")) if folder is None else folder
    table[key] = os.path.abspath(given)
    beside: Settings = _beside_project(whole, base, Path(table[key]))
    return beside


def _beside_project(value: Any, base: Path, folder: Path) -> Any:
    """With the full path of files that are not in the data's folder and lie beside the project."""
    if isinstance(value, dict):
        return {key: _beside_project(own, base, folder) for key, own in value.items()}
    if isinstance(value, list):
        return [_beside_project(own, base, folder) for own in value]
    if isinstance(value, str) and Path(value).suffix and not os.path.exists(folder / value):
        return os.path.abspath(base / value) if is_file(base / value) else value
    return value


def settings_of(project: Project, tests: Sequence[str]) -> Settings:
    """What a run of these tests is told, as a project file would say it: without cards.

    Options of the command that change the project are in it; the tests are in the project's order.
    """
    written = project.written
    assert written is not None
    solver = project.fit.solver
    settings: Settings = {
        **written.common,
        "law": plain(project.law.model_dump()),
        "fit": plain(project.fit.model_dump()),
    }
    if isinstance(folder := settings["fit"].get("cache"), str):
        settings["fit"]["cache"] = os.path.abspath(beside(project.path.parent, folder))
    options = _solver_options(project)
    if options:
        settings["solver"] = {solver: options}
    for name in tests:
        if name not in written.tests:  # made from Python, beside the file
            continue
        settings.setdefault(written.kinds[name], []).append(written.tests[name])
    return settings


def settings_of_predictions(
    project: Project, tests: Sequence[str], cards: Sequence[str | Path]
) -> Settings:
    """What a run of predictions is told, as a project file would say it, cards by their files.

    cards : names of the project's cards, and files.
    """
    written = project.written
    assert written is not None
    settings = settings_of(project, tests)
    del settings["law"]  # each card says its own
    own = dict(zip(project.cards, written.cards, strict=True))
    settings["card"] = []
    for card in cards:
        said = dict(own.get(str(card), {"file": os.path.abspath(card)}))
        if "file" in said and str(card) in own:
            said["file"] = os.path.abspath(project.path.parent / said["file"])
        settings["card"].append(said)
    return settings


def project_text(settings: Mapping[str, Any]) -> str:
    """Settings as a project file (TOML)."""
    return HEAD + "\n" + tomli_w.dumps(settings)


def _solver_options(project: Project) -> Settings:
    """Of the solver that runs, those that its table may hold; what is there with its full path."""
    name = project.fit.solver
    section = solver_sections().get(name)
    return {
        key: _in_full(value)
        for key, value in plain(project.solver_options.get(name, {})).items()
        if section is None or key in section.model_fields
    }


def _in_full(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _in_full(own) for key, own in value.items()}
    if isinstance(value, str) and os.sep in value and os.path.exists(value):
        return os.path.abspath(value)
    return value


def plain(value: Any) -> Any:
    """What TOML and JSON can say: without what is not said, tuples as lists, paths as text."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items() if v is not None}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return str(value) if isinstance(value, Path) else value
