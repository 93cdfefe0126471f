"""Commands for a first project: `bubblefit init` writes one, `schema` and `docs` explain it."""

from __future__ import annotations

import difflib
import math
import os
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError, OutputError, Problems, SolverFailure, check_one_of
from ..lazy_modules import rich_console
from ..readers.units import LOAD_UNITS, PRESSURE_UNITS
from ..storage.templates import render
from ..storage.writing import ROOT, TEMPLATES, unwritable_reason, write_text
from ..version import __version__
from .options import numbers, with_options
from .terminal import FILE, FOLDER, command, wrapped

if TYPE_CHECKING:
    from ..experiments.bubble import BubbleTest
    from ..project.project import Project

DOCS = ROOT / "docs"
#: Folders of the documents; of pages with the same name, that in the first folder is meant.
FOLDERS = ("how-to", "reference", "", "validation", "reference/api")
EXAMPLES = ROOT / "examples"
#: Examples by name: folder, command to type next, and the project file in that command.
KINDS = {
    "known": ("bubble-known-solution", "bubblefit bubble {} --starts 4", "project.toml"),
    "own": ("own-data", "bubblefit init fabric --own --data {} --thickness 0.83", "data"),
    "measured": (
        "bubble-valmex7318",
        "bubblefit bubble {} --data DIR",
        "test1-linear.toml",
    ),
    "uniaxial": ("uniaxial-valmex7318", "bubblefit uniaxial {}", "project.toml"),
    "biaxial": ("biaxial-computed", "bubblefit biaxial {}", "project.toml"),
    "bend": ("bend-valmex7318", "bubblefit bend {}", "project.toml"),
    "joint": ("joint-valmex7318", "bubblefit fit {} --data bubble=DIR", "test1.toml"),
}
PROJECT = "project.toml"
#: The schema that is shipped, for the kinds of test and solvers that come with bubblefit.
SHIPPED = TEMPLATES / "project" / "project.schema.json"
#: Beginning of an example's first line, by which editors find the schema: in the repository, and in
#: a folder of the user.
SCHEMA_IN_PLACE = b"#:schema ../../templates/project/"
SCHEMA_BESIDE = b"#:schema "
#: Links and names of pages in an example, as a folder of the user can have them.
LINKS = (
    (rb"\[([^\]]+)\]\(\.\./\.\./docs/([\w/-]+)\.md[^)]*\)", rb"\1 (`bubblefit docs \2`)"),
    (rb"`docs/([\w/-]+)\.md`", rb"`bubblefit docs \1`"),
)
COUNT = click.IntRange(0, 99)
#: What measured files may not tell: as it is asked for, and with which value data are looked at.
SIZES: Mapping[str, tuple[str, Any]] = {
    "thickness": ("Thickness before the test, mm", 1.0),
    "radius": ("Radius of the clamped disk, mm", '"clamp"'),
    "pressures": ("Pressures of the frames, kPa, with commas between", None),
    "rate": ("Pictures a second", 1.0),
    "width": ("Width of the strips, mm", 25.0),
    "gauge_length": ("Gauge length of the strips (between the grips without a gauge), mm", 100.0),
    "grip_distance": ("Length of the bias strips between the grips, mm", 200.0),
    "diameter": ("Diameter of the cylinders, mm", 150.0),
    "pressure": ("Pressure in the cylinders, kPa", 100.0),
    "pressure_unit": ("Unit of the pressure log", "kPa"),
    "load_unit": ("Unit of the strips' loads", "N"),
}
#: Units that an answer may name, by their key in `SIZES`.
UNITS = {"pressure_unit": tuple(PRESSURE_UNITS), "load_unit": tuple(LOAD_UNITS)}
#: Kinds of test for which `init --own` writes a project, as it is asked for them and their sizes.
WRITABLE: Mapping[str, tuple[str, Sequence[str]]] = {
    "bubble": ("bubble inflation tests", ("radius", "pressures")),
    "strips": ("sets of strips", ()),
    "biaxial": ("biaxial tests", ()),
    "cylinder": ("cylinders to predict", ("diameter", "pressure")),
}
#: Default settings of a project of `init --own`: lengths in mm, pressures in kPa.
USUAL: Mapping[str, Any] = {
    "name": "My fabric",
    "thickness": 0.8,
    "form": "cubic",
    "radius": 100.0,
    "pressures": (20, 60, 100, 150, 200, 250, 300),
    "diameter": 150.0,
    "pressure": 100.0,
}


@command(
    "init",
    "bubblefit init mine",
    "bubblefit init mine --example uniaxial",
    "bubblefit init mine --own --data measured --thickness 0.8",
    "bubblefit init mine --own --bubble 1 --strips 1 --thickness 0.8",
    "bubblefit init mine --deck frame.inp",
)
@click.argument("folder", type=FILE)
@click.option(
    "--example",
    type=click.Choice(list(KINDS)),
    help="A bubble from a known solution; files as a laboratory has them; a bubble from measured"
    " DIC files; strip tests; a biaxial test; bending; bubble and strips together. [known]",
)
@click.option(
    "--own",
    "is_own",
    is_flag=True,
    help="A project for your own tests, by the options below or, on a terminal, by questions.",
)
@click.option(
    "--data", type=FOLDER, help="Folder of measured files, for which --own writes a project."
)
@click.option(
    "--deck", type=FILE, help="Input deck (.inp), of whose constants a project finds some."
)
@click.option("--bubble", type=COUNT, metavar="N", help="Bubble inflation tests.")
@click.option("--strips", type=COUNT, metavar="N", help="Sets of warp, fill and bias strips.")
@click.option("--biaxial", type=COUNT, metavar="N", help="Biaxial tests of a cruciform.")
@click.option("--cylinder", type=COUNT, metavar="N", help="Inflated cylinders to predict.")
@click.option("--name", help="Of the fabric.")
@click.option("--thickness", type=float, metavar="MM", help="Of the fabric [0.8].")
@click.option("--form", metavar="NAME", help="Of the moduli: cubic, spline, ... [cubic].")
@click.option("--radius", type=float, metavar="MM", help="Of the bubbles [100].")
@click.option("--pressures", metavar="KPA,...", help="Of the bubbles [20,60,...,300].")
@with_options(
    *(
        click.option(f"--{name.replace('_', '-')}", type=float, help=f"{SIZES[name][0]}; --data.")
        for name in ("rate", "width", "gauge_length", "grip_distance")
    ),
    *(
        click.option(
            f"--{name.replace('_', '-')}",
            type=click.Choice(units),
            metavar="UNIT",
            help=f"{SIZES[name][0]}; --data.",
        )
        for name, units in UNITS.items()
    ),
)
@click.option("--diameter", type=float, metavar="MM", help="Of the cylinders [150].")
@click.option("--pressure", type=float, metavar="KPA", help="In the cylinders [100].")
def init_command(
    folder: Path,
    example: str | None,
    is_own: bool,
    deck: Path | None,
    **options: Any,
) -> None:
    """Write a commented project into FOLDER: an example, or one for your own tests (--own) or deck.

    Nothing there is written over.
    """
    settings = {key: value for key, value in options.items() if value is not None}
    _check_options(settings, example, is_own, deck)
    if "pressures" in settings:
        settings["pressures"] = numbers(settings["pressures"], "--pressures")
    if is_own and "data" in settings:
        _write_for_data(folder, settings.pop("data"), settings)
    elif is_own:
        _write_own(folder, settings)
    elif deck is not None:
        _write_for_deck(folder, deck)
    else:
        _write_example(folder, example or "known")


def _check_options(
    settings: Mapping[str, Any],
    example: str | None,
    is_own: bool,
    deck: Path | None,
) -> None:
    """Raise InputError for options that do not go together."""
    chosen = {"--example": example is not None, "--own": is_own, "--deck": deck is not None}
    if sum(chosen.values()) > 1:
        names = ", ".join(name for name, is_chosen in chosen.items() if is_chosen)
        raise InputError(None, names, "give one of them, not both")
    if settings and not is_own:
        option = next(iter(settings)).replace("_", "-")
        raise InputError(None, f"--{option}", "means nothing without --own")


def _write_example(folder: Path, example: str) -> None:
    """Write the files of an example, or none of them, and print what to type next."""
    name, advice, project = KINDS[example]
    contents = _example_files(EXAMPLES / name)
    for file_name in contents:
        _check_free(folder / file_name)
    try:
        for file_name, content in contents.items():
            (folder / file_name).parent.mkdir(parents=True, exist_ok=True)
            (folder / file_name).write_bytes(content)
    except OSError as error:
        for file_name in contents:  # half an example would be in the way of the next attempt
            with suppress(OSError):
                (folder / file_name).unlink(missing_ok=True)
        raise OutputError(f"{folder}: {unwritable_reason(error)} another folder") from None
    names = sorted({file_name.partition("/")[0] for file_name in contents} - {SHIPPED.name})
    click.echo(wrapped(f"wrote {', '.join(names)} to {folder}"))
    if "DIR" in advice:
        click.echo("note: its data are no part of bubblefit: README.md says where they are")
    click.echo(f"next: {advice.format(folder / project)}")


def _example_files(source: Path) -> dict[str, bytes]:
    """Return the files of an example by their names, with the schema and links that lead on."""
    contents = {SHIPPED.name: SHIPPED.read_bytes()}
    for file in filter(Path.is_file, [*source.iterdir(), *(source / "data").rglob("*")]):
        content = file.read_bytes().replace(SCHEMA_IN_PLACE, SCHEMA_BESIDE, 1)
        for pattern, words in LINKS if file.suffix == ".md" else ():
            content = re.sub(pattern, words, content)
        contents[file.relative_to(source).as_posix()] = content
    return contents


def _write_own(folder: Path, settings: dict[str, Any]) -> None:
    """Write a project for the user's own tests, from options or from questions on a terminal."""
    path = folder / PROJECT
    _check_free(path)
    if not settings and on_a_terminal():
        settings = _ask()
    counts = {kind: settings.pop(kind, 0) for kind in WRITABLE}
    tests = [{"kind": kind} for kind, count in counts.items() for _ in range(count)]
    text = _project_text(tests, {**USUAL, **settings})
    problems = Problems()
    _read_draft(text, problems, need_data=False)
    for error in problems.errors:
        raise InputError(None, error.field, error.problem)
    _write_project(path, text)
    click.echo(f"wrote {path}: read it")
    if counts["bubble"]:
        advice = '[bubble.sheet] surface = "measured" takes the heights z of the files'
        note = f"note: a bubble's sheet is seldom flat: {advice}, modes where there are none"
        click.echo(wrapped(note))
    commands = f"check {path}, then bubblefit fit {path}"
    if not any(counts[kind] for kind in ("bubble", "strips", "biaxial")):
        commands = f"bend {path} --card CARD"
    next_step = f"next: put the measured files where it says, then bubblefit {commands}"
    click.echo(wrapped(next_step))


def _write_project(path: Path, text: str) -> None:
    """Write a project file, and beside it the schema by which editors check it."""
    write_text(path, text)
    write_text(path.parent / SHIPPED.name, SHIPPED.read_text(encoding="utf-8"))


def _write_for_data(folder: Path, data: Path, settings: dict[str, Any]) -> None:
    """Write a project for the files of a folder; what they do not tell is asked for, or marked."""
    from ..project.data_folder import proposed_tests, recognised_groups

    for kind in WRITABLE:
        if settings.get(kind):
            raise InputError(None, f"--{kind}", "goes without --data, whose files tell the tests")
    path = folder / PROJECT
    _check_free(path)
    groups = recognised_groups(data)
    for group in groups:
        click.echo(wrapped(group.line))
    tests = proposed_tests(groups)
    if not tests:
        raise InputError(data, "", "no test is recognised; give --strips 1 or --bubble 1 instead")
    sizes = list(dict.fromkeys(["thickness", *(size for test in tests for size in test["sizes"])]))
    for test in tests:
        settings = {**test.get("in_heads", {}), **settings}
    for size in sizes if on_a_terminal() else ():
        settings[size] = settings[size] if size in settings else _answer(size)
    open_sizes = [size for size in sizes if size not in settings]
    _confirm_directions(tests)
    settings |= {"folder": Path(os.path.relpath(data, folder)).as_posix()}
    _write_project(path, _text_for_data(tests, settings, open_sizes, data))
    click.echo(wrapped(f"wrote {path}: read it, above all the lines with TODO"))
    if open_sizes:
        click.echo(wrapped(f"to be filled in there, or confirmed: {', '.join(open_sizes)}"))
    click.echo(f"next: bubblefit check {folder}\nthen: bubblefit fit {folder}")


def _write_for_deck(folder: Path, path: Path) -> None:
    """Write a template of a deck, with the files that it includes, and a project for it."""
    from ..experiments.deck.input_file import InputDeck

    deck = InputDeck(path)
    constants = deck.constants()
    if not constants:
        raise InputError(path, "", "holds no constants of *ELASTIC, *HYPERELASTIC, ... to be found")
    template = f"{path.name}.j2"
    files = {template: deck.template(constants), **deck.included}
    for name in (PROJECT, *files):
        _check_free(folder / name)
    for line in deck.summary():
        click.echo(wrapped(line))
    text = render(
        "project/deck.toml.j2",
        name=_quoted(path.stem),
        template=_quoted(template),
        constants=constants,
        version=__version__,
        **deck.loading(),
    )
    _write_project(folder / PROJECT, text)
    for name, content in files.items():
        write_text(folder / name, content)
    click.echo(wrapped(f"parameters: {', '.join(constant.name for constant in constants)}"))
    click.echo(
        wrapped(f"wrote {folder / template} and {folder / PROJECT}: read the lines with TODO")
    )
    click.echo(f"next: bubblefit check {folder}\nthen: bubblefit fit {folder}")


def _confirm_directions(tests: Sequence[dict[str, Any]]) -> None:
    """Ask on a terminal what angles in names mean; elsewhere a TODO of the project does."""
    from ..project.data_folder import angle_of, strips_by_direction
    from ..readers.curves import direction_named

    by_angle = [test for test in tests if test.get("by_angle") and on_a_terminal()]
    if not by_angle:
        return
    is_warp = click.confirm("Are strips at 0 degrees pulled along the warp?", default=True)
    for test in by_angle:
        test["by_angle"] = False
        if not is_warp:
            files = {direction_named(90.0 - angle_of(d)): f for d, f in test["files"].items()}
            test |= strips_by_direction(files)


def _text_for_data(
    tests: Sequence[dict[str, Any]],
    settings: Mapping[str, Any],
    open_sizes: Sequence[str],
    data: Path,
) -> str:
    """Return the text of a project; its draft, with usual open sizes, is read for what it lacks."""
    from ..experiments.bubble import BubbleTest

    without_cameras = all(test.get("template") == "gauges" for test in tests)
    usual = {**USUAL, "form": "constant"} if without_cameras else USUAL
    if len(tests) == 1 and tests[0].get("is_central"):
        usual = {**usual, "law_symmetry": "balanced"}  # warp and fill cannot be told apart
    draft = {**usual, **settings, **{size: SIZES[size][1] for size in open_sizes}}
    draft["bounds"] = {"E1": [1, 30000], "E2": [1, 30000], "G12": [0.1, 3000]}
    draft |= {"folder": data.resolve().as_posix(), "is_draft": True}
    bubbles = [test for test in tests if test["kind"] == "bubble"]
    project = _project_of_draft(tests, draft, bubbles)
    has_pressures = {"rate", "pressure_unit"}.isdisjoint(open_sizes)
    for number, values in enumerate(bubbles, start=1):
        # Without a name in the draft a test is named for its kind; one that is unreadable lacks.
        test = project.tests.get(f"bubble {number}" if len(bubbles) > 1 else "bubble")
        if isinstance(test, BubbleTest):
            values |= _read_values_of(test, has_pressures)
    sizes = dict.fromkeys(open_sizes)
    law = {} if without_cameras and "radius" in open_sizes else _law_for_data(project)
    if without_cameras:
        law["form"] = "constant"
    return _project_text(tests, {**usual, **law, **settings, **sizes})


def _project_of_draft(
    tests: Sequence[dict[str, Any]],
    draft: Mapping[str, Any],
    bubbles: Sequence[dict[str, Any]],
) -> Project:
    """Return the project of a draft; bubbles with few frames under pressure take all of them."""
    problems = Problems()
    project = _read_draft(_project_text(tests, draft), problems)
    sparse = [e.field for e in problems.errors if e.field.endswith("points.pressure.frames")]
    if not sparse:
        return project
    for number, values in enumerate(bubbles):
        values["all_frames"] = any(field.startswith(f"bubble[{number}].") for field in sparse)
    return _read_draft(_project_text(tests, draft), Problems())


def _read_values_of(test: BubbleTest, has_pressures: bool) -> dict[str, Any]:
    """Return values of a bubble's section that its files tell."""
    values: dict[str, Any] = {}
    if has_pressures:
        values["recorded"] = _loaded_pressures(test.pressures)
    if test.of_clamp:
        values |= {"radius": round(test.outline.radius, 2), "radius_found": True}
    return values


def _loaded_pressures(pressures: Sequence[float], count: int = 12) -> list[float]:
    """Return recorded pressures (MPa) in kPa, at most `count`, without those of a sheet at rest.

    They are rounded to a thousandth of the largest or so, and equal ones are left out.
    """
    largest = 1e3 * max(pressures)
    digits = max(1, 2 - math.floor(math.log10(largest))) if largest > 0 else 1
    rounded = [round(1e3 * p, digits) for p in pressures if 1e3 * p > 0.03 * largest]
    loaded = list(dict.fromkeys(rounded))
    step = (len(loaded) - 1) / max(1, min(count, len(loaded)) - 1)
    return [loaded[round(step * number)] for number in range(min(count, len(loaded)))]


def _law_for_data(project: Project, margin: float = 5.0) -> dict[str, Any]:
    """Return bounds and strain range of the law for the data of a draft, by an estimate.

    Parameters
    ----------
    margin : float
        Factor between bounds and constant moduli that are estimated.
    """
    from ..experiments.bubble import BubbleTest
    from ..materials.forms.base import COMPONENTS
    from ..runs.estimate import estimate

    try:
        estimated = estimate(project.with_law("constant"))
    except (InputError, SolverFailure):
        return {}
    tests = project.tests.values()
    has_bubble = any(isinstance(test, BubbleTest) for test in tests)
    reached = estimated.best.reached
    strained = [
        name
        for name, component in COMPONENTS.items()
        if any(test.reach.strain[component] is not None for test in tests)
    ]
    # A bubble determines E1 and E2, but says little of G12.
    determined = dict.fromkeys([*strained, *["E1", "E2"] * has_bubble])
    moduli = {name: float(estimated.law.modulus(name, 0.0)) for name in determined}
    bounds = {name: _bounds_around(modulus, margin) for name, modulus in moduli.items()}
    if len(strained) == len(COMPONENTS):
        return {"bounds": bounds}
    # A strain that no test tells may be as large as half of the largest.
    ends = [float(f"{max(1.1 * strain, 0.5 * reached.max()):.2g}") for strain in reached]
    return {"bounds": bounds, "strain_range": ends, "form": "cubic" if has_bubble else "quadratic"}


def _bounds_around(modulus: float, margin: float) -> list[float]:
    """Return bounds (MPa) in two digits, a factor below and above a modulus."""
    return [float(f"{end:.2g}") for end in (modulus / margin, modulus * margin)]


def _ask() -> dict[str, Any]:
    """Ask on the terminal which tests there are, and return the settings of the project."""
    answers: dict[str, Any] = {"name": click.prompt("Name of the fabric", default="My fabric")}
    answers["thickness"] = _answer("thickness")
    for kind, (question, sizes) in WRITABLE.items():
        answers[kind] = click.prompt(f"How many {question}", type=COUNT, default=0)
        answers |= {size: _answer(size) for size in sizes if answers[kind]}
    if answers["bubble"] or answers["strips"] or answers["biaxial"]:
        answers["form"] = click.prompt("Form of the moduli", default="cubic")
    return answers


def _answer(size: str) -> Any:
    """Return the number, numbers or unit that the user answers on the terminal."""
    if size in UNITS:
        return click.prompt(SIZES[size][0], type=click.Choice(UNITS[size]))
    values = numbers(click.prompt(SIZES[size][0]), size)
    return values if size == "pressures" else values[0]


def _read_draft(text: str, problems: Problems, need_data: bool = True) -> Project:
    """Read the text of a project file before it is written, as `read_readable_tests`."""
    from ..project.project import read_readable_tests

    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / PROJECT
        path.write_text(text, encoding="utf-8")
        try:
            return read_readable_tests(path, None, problems, need_data)
        except InputError as error:  # which names no file, as there is none yet
            raise InputError(None, error.field, error.problem) from None


def _project_text(tests: Sequence[Mapping[str, Any]], settings: Mapping[str, Any]) -> str:
    """Return the text of a commented project file.

    Parameters
    ----------
    tests : sequence of mapping
        "kind" and values of the template of each test.
    settings : mapping
        Values for all templates, with the keys of `USUAL`.
    """
    from ..experiments.registry import kind_named
    from ..inference.methods import method_names
    from ..materials.forms.base import form_names

    counts = Counter(test["kind"] for test in tests)
    if not counts:
        raise InputError(None, "--own", f"name at least one test: --{', --'.join(WRITABLE)}")
    check_one_of(settings["form"], form_names(), "--form")
    fitted = [kind for kind in counts if kind_named(kind).fitted]
    values = {**settings, "deflection": 1.6 * (settings["diameter"] or 0.0)}
    numbers_of_kinds = Counter[str]()
    parts = []
    for test in tests:
        kind = test["kind"]
        numbers_of_kinds[kind] += 1
        number = numbers_of_kinds[kind]
        of_test = {"name": f"{kind}{number}", "number": number, "count": counts[kind]}
        template = test.get("template", kind)
        parts.append(render(f"project/{template}.toml.j2", **{**values, **of_test, **test}))
    quoted = {key: _quoted(settings[key]) for key in ("name", "form")}
    return render(
        "project/project.toml.j2",
        **{"strain_range": "strips" not in counts, **values, **quoted},
        version=__version__,
        tests=parts,
        fitted=bool(fitted),
        strips="strips" in counts,
        predicted=len(fitted) < len(counts),
        methods=", ".join(f'"{name}"' for name in method_names()),
    )


def _quoted(text: str) -> str:
    """Return text as it may stand between TOML's quotation marks."""
    plain = "".join(c for c in text if c.isprintable())
    return plain.replace("\\", "\\\\").replace('"', '\\"')


def on_a_terminal() -> bool:
    """Return whether the user can answer questions on a terminal."""
    return sys.stdin.isatty()


def _check_free(path: Path) -> None:
    """Check that there is no file or folder at a path yet; raise InputError if there is."""
    if path.exists():
        raise InputError(path, "", "is already there; name another folder")


@command("schema", "bubblefit schema", "bubblefit schema --out project.schema.json")
@click.option("--out", type=FILE, help="File to write [print it].")
def schema_command(out: Path | None) -> None:
    """Print or write the JSON Schema of the project file, plug-ins' kinds of test included.

    Editors complete and check a project whose first line names it: #:schema project.schema.json
    """
    from ..project.schema import schema_text

    if out is None:
        click.echo(schema_text(), nl=False)
        return
    write_text(out, schema_text())
    click.echo(f"written to {out}")


def pages() -> dict[str, Path]:
    """Return the file of every page of the documents by its name.

    The name is the path below docs/ without .md, such as "how-to/marc"; pages in the root of the
    package have the name of their file, such as "changelog".
    """
    documents = {}
    for folder in FOLDERS:
        for path in sorted((DOCS / folder).glob("*.md")):
            documents[path.relative_to(DOCS).with_suffix("").as_posix()] = path
    for path in sorted(ROOT.glob("*.md")):
        documents[path.stem.lower()] = path
    return documents


def find_document(topic: str, documents: Mapping[str, Path]) -> tuple[str, list[str]]:
    """Find a page of the documents by its name, with or without its folder.

    Parameters
    ----------
    topic : str
        Name such as "marc", "how-to/marc" or "docs/how-to/marc.md".
    documents : mapping of str to Path
        Pages by name, as `pages` returns them.

    Returns
    -------
    str, list of str
        Name of the page, and further pages of the same name in other folders.

    Raises
    ------
    InputError
        There is no such page.
    """
    name = topic.removeprefix("docs/").removesuffix(".md")
    if name in documents:
        return name, []
    namesakes = [page for page in documents if page.rpartition("/")[2] == name.lower()]
    if namesakes:
        return namesakes[0], namesakes[1:]
    similar = ", ".join(_similar_pages(name.lower(), documents))
    suggestion = f"; pages like it: {similar}" if similar else ""
    problem = f"no such page{suggestion} (`bubblefit docs` lists every page)"
    raise InputError(None, topic, problem)


def _similar_pages(name: str, documents: Mapping[str, Path], count: int = 4) -> list[str]:
    """Return the pages of a similar name, then those with a word of it in name or title."""
    words = [word.rstrip("s") for word in re.findall(r"[^\W_]{3,}", name)]
    titles = {page: f"{page} {title_of(file)}".lower() for page, file in documents.items()}
    pages_with_words = [page for page, title in titles.items() if any(w in title for w in words)]
    pages_by_name = {page.rpartition("/")[2]: page for page in documents}
    similar = [pages_by_name[n] for n in difflib.get_close_matches(name, pages_by_name)]
    return list(dict.fromkeys([*similar, *pages_with_words]))[:count]


def title_of(page: Path) -> str:
    """Return the title of a page of the documents."""
    lines = page.read_text(encoding="utf-8").splitlines()
    return next((line[2:] for line in lines if line.startswith("# ")), page.stem)


@command(
    "docs",
    "bubblefit docs",
    "bubblefit docs own-bubble-test",
    "bubblefit docs how-to/marc",
    "bubblefit docs project-file --path",
)
@click.argument("topic", required=False)
@click.option("--path", is_flag=True, help="Print where the page is, instead of the page.")
def docs_command(topic: str | None, path: bool) -> None:
    """Read a page of the documents, or list them all.

    TOPIC is the name of a page, with its folder where two have one name. On a terminal the page is
    laid out and paged; elsewhere the Markdown is printed.
    """
    documents = pages()
    if topic is None:
        width = max(map(len, documents)) + 2
        for name, page in documents.items():
            click.echo(f"{name:<{width}}{title_of(page)}")
        return
    name, namesakes = find_document(topic, documents)
    if namesakes:
        click.echo(f"note: there is also {', '.join(namesakes)}", err=True)
    if path:
        click.echo(str(documents[name]))
    elif sys.stdout.isatty():
        from rich.markdown import Markdown

        width = rich_console.Console().width
        console = rich_console.Console(file=StringIO(), width=width)
        with console.capture() as captured:
            console.print(Markdown(documents[name].read_text(encoding="utf-8"), hyperlinks=False))
        click.echo_via_pager(captured.get())
    else:
        click.echo(documents[name].read_text(encoding="utf-8"), nl=False)
