"""`bubblefit init`, `schema` and `docs`: a first project, its schema, and the documents."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.markdown import Markdown

from ..errors import InputError, OutputError, check_one_of, did_you_mean
from ..experiments.registry import kind_named
from ..inference.methods import method_names
from ..materials.forms.base import form_names
from ..project.project import read_project
from ..project.schema import SHIPPED, schema_text
from ..storage.folders import ROOT
from ..storage.templates import render
from ..storage.writing import unwritable_reason, write_text
from ..version import __version__
from .options import numbers
from .terminal import FILE, command, wrapped

DOCS = ROOT / "docs"
#: Folders of pages; of two pages with one name the first is meant.
FOLDERS = ("how-to", "reference", "", "validation", "reference/api")
EXAMPLES = ROOT / "examples"
#: By name: the folder of the example, and what to type next (in the folder that was written).
KINDS = {
    "known": ("bubble-known-solution", "bubblefit bubble {} --starts 4", "project.toml"),
    "measured": ("bubble-valmex7318", "bubblefit bubble {} --data DIR", "test1-linear.toml"),
    "uniaxial": ("uniaxial-valmex7318", "bubblefit uniaxial {}", "project.toml"),
    "biaxial": ("biaxial-computed", "bubblefit biaxial {}", "project.toml"),
    "bend": ("bend-valmex7318", "bubblefit bend {}", "project.toml"),
    "joint": ("joint-valmex7318", "bubblefit fit {} --data DIR", "test1.toml"),
}
PROJECT = "project.toml"
#: First line of an example, where it lies and where it is copied to: editors find the schema by it.
FAR, NEAR = b"#:schema ../../templates/project/", b"#:schema "
COUNT = click.IntRange(0, 99)
#: Kinds of test that a project of one's own is written for.
WRITABLE = ("bubble", "strips", "biaxial", "cylinder")
#: What a project of one's own is like unless something else is said; mm and kPa.
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
    "bubblefit init mine --own --bubble 1 --strips 1 --thickness 0.8",
)
@click.argument("folder", type=FILE)
@click.option(
    "--example",
    type=click.Choice(list(KINDS)),
    help="A bubble from a known solution; from measured DIC files; strip tests; a biaxial"
    " test; bending; bubble and strips together. [known]",
)
@click.option(
    "--own",
    is_flag=True,
    help="A project for your own tests, by the options below or, on a terminal, by questions.",
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
@click.option("--diameter", type=float, metavar="MM", help="Of the cylinders [150].")
@click.option("--pressure", type=float, metavar="KPA", help="In the cylinders [100].")
def init_command(folder: Path, example: str | None, own: bool, **given: Any) -> None:
    """Write a commented project into FOLDER: an example, or (--own) one for your own tests.

    Nothing there is written over.
    """
    said = {key: value for key, value in given.items() if value is not None}
    if own and example is not None:
        raise InputError(None, "--example, --own", "give one of them, not both")
    if said and not own:
        option = next(iter(said))
        raise InputError(None, f"--{option}", "means nothing without --own")
    if own:
        _write_own(folder, said)
    else:
        name, advice, project = KINDS[example or "known"]
        files = sorted(f for f in (EXAMPLES / name).iterdir() if f.is_file())
        content = {f.name: f.read_bytes().replace(FAR, NEAR, 1) for f in (*files, SHIPPED)}
        for file in content:
            _free(folder / file)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for file, text in content.items():
                (folder / file).write_bytes(text)
        except OSError as error:
            for file in content:  # half an example would be in the way of the next attempt
                with suppress(OSError):
                    (folder / file).unlink(missing_ok=True)
            raise OutputError(f"{folder}: {unwritable_reason(error)} another folder") from None
        click.echo(wrapped(f"wrote {', '.join(f.name for f in files)} to {folder}"))
        click.echo(f"next: {advice.format(folder / project)}")


def _write_own(folder: Path, said: dict[str, Any]) -> None:
    path = folder / PROJECT
    _free(path)
    if not said and on_a_terminal():
        said = {
            "name": click.prompt("Name of the fabric", default="My fabric"),
            "thickness": click.prompt("Thickness before the test, mm", type=float),
            "bubble": click.prompt("How many bubble inflation tests", type=COUNT, default=1),
        }
        if said["bubble"]:
            said["radius"] = click.prompt(
                "Radius of the clamped disk, mm", type=float, default=100.0
            )
            said["pressures"] = click.prompt("Pressures of the pictures, kPa, with commas between")
        said["strips"] = click.prompt("How many sets of strips", type=COUNT, default=0)
        said["biaxial"] = click.prompt("How many biaxial tests", type=COUNT, default=0)
        said["cylinder"] = click.prompt("How many cylinders to predict", type=COUNT, default=0)
        if said["cylinder"]:
            said["diameter"] = click.prompt("Diameter of the cylinders, mm", type=float)
            said["pressure"] = click.prompt("Pressure in them, kPa", type=float)
        if said["bubble"] or said["strips"] or said["biaxial"]:
            said["form"] = click.prompt("Form of the moduli", default="cubic")
    tests = {kind: said.pop(kind, 0) for kind in WRITABLE}
    if "pressures" in said:
        said["pressures"] = numbers(said["pressures"], "--pressures")
    text = _project_text(tests, {**USUAL, **said})
    with tempfile.TemporaryDirectory() as place:  # so that a wrong one leaves no folder
        tried = Path(place) / PROJECT
        tried.write_text(text, encoding="utf-8")
        try:
            read_project(tried, need_data=False)
        except InputError as error:
            raise InputError(None, error.field, error.problem) from None
    write_text(path, text)
    write_text(folder / SHIPPED.name, SHIPPED.read_text(encoding="utf-8"))
    click.echo(f"wrote {path}: read it")
    if tests["bubble"]:
        words = '[bubble.sheet] surface = "measured" takes the heights z of the files'
        words = f"note: a bubble's sheet is seldom flat: {words}, modes where there are none"
        click.echo(wrapped(words))
    fitted = tests["bubble"] or tests["strips"] or tests["biaxial"]
    then = f"check {path}, then bubblefit fit {path}" if fitted else f"bend {path} --card CARD"
    click.echo(wrapped(f"next: put the measured files where it says, then bubblefit {then}"))


def _project_text(tests: Mapping[str, int], said: Mapping[str, Any]) -> str:
    """Return a commented project file; tests : how many of each kind. said : as `USUAL`."""
    asked = [kind for kind, count in tests.items() if count]
    if not asked:
        raise InputError(None, "--own", f"name at least one test: --{', --'.join(tests)}")
    check_one_of(said["form"], form_names(), "--form")
    fitted = [kind for kind in asked if kind_named(kind).fitted]
    values = {**said, "deflection": 1.6 * said["diameter"]}
    parts = [
        render(
            f"project/{kind}.toml.j2",
            **{**values, "name": f"{kind}{n}"},
            number=n,
            count=tests[kind],
        )
        for kind in asked
        for n in range(1, tests[kind] + 1)
    ]
    words = {key: _quoted(said[key]) for key in ("name", "form")}
    return render(
        "project/project.toml.j2",
        **{**values, **words},
        version=__version__,
        tests=parts,
        fitted=bool(fitted),
        predicted=len(fitted) < len(asked),
        methods=", ".join(f'"{name}"' for name in method_names()),
        # The gauges of strips tell how far a fabric is strained; nothing else does beforehand.
        strain_range="strips" not in asked,
    )


def _quoted(text: str) -> str:
    """Return text as it may stand between TOML's quotation marks."""
    plain = "".join(c for c in text if c.isprintable())
    return plain.replace("\\", "\\\\").replace('"', '\\"')


def on_a_terminal() -> bool:
    return sys.stdin.isatty()


def _free(path: Path) -> None:
    if path.exists():
        raise InputError(path, "", "is already there; name another folder")


@command("schema", "bubblefit schema", "bubblefit schema --out project.schema.json")
@click.option("--out", type=FILE, help="File to write [print it].")
def schema_command(out: Path | None) -> None:
    """Print or write the JSON Schema of the project file, plug-ins' kinds of test included.

    Editors complete and check a project whose first line names it: #:schema project.schema.json
    """
    if out is None:
        click.echo(schema_text(), nl=False)
        return
    write_text(out, schema_text())
    click.echo(f"written to {out}")


def pages() -> dict[str, Path]:
    """Return every page by its name below docs/ without .md ("how-to/marc"), or "changelog"."""
    found = {}
    for folder in FOLDERS:
        for path in sorted((DOCS / folder).glob("*.md")):
            found[path.relative_to(DOCS).with_suffix("").as_posix()] = path
    for path in sorted(ROOT.glob("*.md")):
        found[path.stem.lower()] = path
    return found


def find_document(topic: str, known: Mapping[str, Path]) -> tuple[str, list[str]]:
    """Return the name of the page that is meant, and others of the same name.
    topic : "marc", "how-to/marc" or "docs/how-to/marc.md". known : as `pages` gives them. Raises
    InputError where there is none."""
    wanted = topic.removeprefix("docs/").removesuffix(".md")
    if wanted in known:
        return wanted, []
    named = [name for name in known if name.rpartition("/")[2] == wanted.lower()]
    if named:
        return named[0], named[1:]
    names = [*known, *(name.rpartition("/")[2] for name in known)]
    meant = did_you_mean(wanted.lower(), names)
    raise InputError(None, topic, f"no such page{meant} (`bubblefit docs` lists every page)")


def title_of(page: Path) -> str:
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
    known = pages()
    if topic is None:
        wide = max(map(len, known)) + 2
        for name, page in known.items():
            click.echo(f"{name:<{wide}}{title_of(page)}")
        return
    name, others = find_document(topic, known)
    if others:
        click.echo(f"note: there is also {', '.join(others)}", err=True)
    if path:
        click.echo(str(known[name]))
    elif sys.stdout.isatty():
        console = Console(file=StringIO(), width=Console().width)
        with console.capture() as captured:
            console.print(Markdown(known[name].read_text(encoding="utf-8"), hyperlinks=False))
        click.echo_via_pager(captured.get())
    else:
        click.echo(known[name].read_text(encoding="utf-8"), nl=False)
