"""Settings of a site's Marc: `[solver.marc]` of a project file, or a file of the site's own."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, ValidationError

from ...errors import InputError
from ...readers.sections import first_error
from ...storage.reading import is_file, read_toml
from ..settings import ExternalSettings, Override

VARIABLE = "BUBBLEFIT_MARC"
#: Blocks of the deck that a site's file can stand in for: the templates of these names.
BLOCKS = (
    "cavity",
    "cavity_parameter",
    "contact",
    "control",
    "fixed_disp",
    "geometry",
    "hypoelastic",
    "nlelast",
    "orientation",
    "post",
    "pressure",
    "stepping",
)

Seconds = Annotated[float, Field(gt=0, le=1e9)]
Count = Annotated[int, Field(ge=1, le=1024)]
#: One word: it ends up in a command or an environment.
Word = Annotated[str, Field(pattern=r"^[^\s\x00]+$")]


class MarcSettings(ExternalSettings):
    """Every setting of MSC Marc, with its default.

    Attributes
    ----------
    options : {"current", "older"}
        "current" (-j, -nte, -nts) or "older" (-jid, -nprocd) names.
    arguments : list of Word
        More, to the end of the command.
    modules : list of Word
        What `module load` is given before it.
    law : {"nlelast", "hypela2"}
        NLELAST with tables, or HYPOELASTIC with HYPELA2, whose source says what own_state and
        symmetric mean.
    element : {139, 75, 18}
        139 thin shell, 75 thick shell, 18 membrane.
    increments
        Least number; 0: the model's.
    pressure_type, pressure_sign
        Code of the pressure on shells, and the sign that inflates.
    include : mapping of str to str
        Files that stand in for blocks of the deck.
    templates : str or None
        Folder of whole decks.
    """

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        frozen=True,
    )

    paths = ("scratch", "templates", "licence_folder")
    # A bare name may also be in a folder that `modules` put on the PATH.
    programs = ("executable",)
    started = ("executable", "arguments", "environment", "modules")
    # What is included counts by content, in what the solver says of itself.
    uncounted = ("timeout", "keep", "include")
    overrides = (
        Override(
            "marc",
            "The Marc to run: run_marc, or a site's .toml.",
            metavar="PATH",
            look="The Marc (run_marc, or a site's .toml) to look at.",
        ),
        Override("templates", "Folder of your own input decks.", metavar="PATH", path=True),
        Override("element", "Shell element", "139, 75 or 18"),
    )

    executable: str = "run_marc"
    version: str = ""
    options: Literal["current", "older"] = "current"
    processors: Count = 1
    threads: Count = 1
    arguments: list[Word] = Field(default_factory=list)
    environment: dict[Word, str] = Field(default_factory=dict)
    modules: list[Word] = Field(default_factory=list)
    law: Literal["nlelast", "hypela2"] = "nlelast"
    own_state: bool = True
    symmetric: bool = True
    element: Literal[139, 75, 18] = 139
    increments: Annotated[int, Field(ge=0, le=1_000_000)] = 100
    pressure_type: Annotated[int, Field(ge=0, le=1000)] = 2
    pressure_sign: Literal[1, -1] = -1
    include: dict[str, str] = Field(default_factory=dict)
    templates: str | None = None
    timeout: Seconds = 3600.0
    scratch: str | None = None
    keep: bool = False

    def given(self, folder: Path) -> dict[str, Any]:
        """Return what was given, None for the rest; paths from `folder` (of the file it was in)."""
        values: dict[str, Any] = dict.fromkeys(type(self).model_fields)
        values |= self.model_dump(include=self.model_fields_set)
        for name in (*self.paths, *self.programs):
            if values[name] is not None and (name in self.paths or os.sep in values[name]):
                values[name] = str(_beside(folder, values[name]))
        if values["include"] is not None:
            values["include"] = {k: str(_beside(folder, v)) for k, v in values["include"].items()}
        # The file that --marc names is beneath all this.
        return {"marc": None, **values}


def marc_settings(command_options: Mapping[str, Any], named: str | None = None) -> MarcSettings:
    """Return the settings of the site's file (named or BUBBLEFIT_MARC), overridden by options."""
    values = _values_of_site(named or os.environ.get(VARIABLE, ""))
    overriding = _plain_options(command_options)
    if named is not None:
        overriding.pop("executable", None)
    options = {**values, **overriding}
    for name in ("include", "environment"):
        options[name] = {**(values.get(name) or {}), **(overriding.get(name) or {})}
    element = options.get("element")
    if isinstance(element, str) and element.isdigit():
        options["element"] = int(element)  # --element 75
    try:
        settings = MarcSettings.model_validate(options)
    except ValidationError as error:
        problem = first_error(Path(), error, MarcSettings)
        raise InputError(None, f"solver.marc.{problem.field}", problem.problem) from None
    _check_files(settings)
    return settings


def _values_of_site(site: str) -> dict[str, Any]:
    """Return the settings of a site's file, or the executable that is named in its place."""
    if site.endswith(".toml"):
        return site_settings(Path(os.path.expanduser(site)))
    if not site:
        return {}
    return {"executable": str(_beside(Path(), site)) if os.sep in site else site}


def _plain_options(command_options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that were given, paths as text: the command line gives them as such."""
    options: dict[str, Any] = {}
    for name, value in command_options.items():
        if value is not None:
            options[name] = str(value) if isinstance(value, Path) else value
    return options


def site_settings(path: Path) -> dict[str, Any]:
    """Return the keys of a site's file, its paths absolute; InputError: no file, not TOML."""
    content = read_toml(path, VARIABLE)
    try:
        settings = MarcSettings.model_validate(content)
    except ValidationError as error:
        raise first_error(path, error, MarcSettings) from None
    options = settings.given(path.absolute().parent)
    return {name: value for name, value in options.items() if value is not None}


def _check_files(settings: MarcSettings) -> None:
    """Raise InputError if an included file or the folder of templates is missing."""
    for name, file in settings.include.items():
        if name not in BLOCKS:
            problem = f"there is no block {name!r}; there are {', '.join(BLOCKS)}"
            raise InputError(None, "solver.marc.include", problem)
        if not is_file(Path(file)):
            raise InputError(Path(file), f"solver.marc.include.{name}", "there is no such file")
    if settings.templates is not None and not os.path.isdir(settings.templates):
        raise InputError(Path(settings.templates), "templates", "there is no such folder")


def _beside(folder: Path, path: str) -> Path:
    # Absolute: runs happen in a scratch folder.
    return (folder / os.path.expanduser(path)).absolute()
