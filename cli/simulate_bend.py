"""`bubblefit simulate bend`: one inflated cylinder in three-point bending, without a project."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from pydantic import ValidationError

from ..errors import InputError
from ..projects.bend import BendProject, bend_project
from ..projects.bend_schema import BendFile
from ..projects.schema_errors import first_error
from .bend_runs import bend_options, run_bend_study
from .options import named_cards, with_solver

#: Stands for the project's file: a project in the folder where the command runs.
HERE = Path("simulate bend")


@click.command("bend")
@click.option("--diameter", type=float, required=True, metavar="MM", help="Before inflation.")
@click.option("--pressure", type=float, required=True, metavar="KPA", help="Gauge pressure.")
@click.option(
    "--card", "cards", type=click.Path(path_type=Path), multiple=True, required=True,
    help="A material card; several are drawn in one figure.",
)  # fmt: skip
@click.option("--length", type=float, metavar="MM", help="Before inflation [3000].")
@click.option("--span", type=float, metavar="MM", help="Between the supports [2000].")
@click.option("--support-diameter", type=float, metavar="MM", help="[100]")
@click.option(
    "--collar", type=(float, float), metavar="MM MM",
    help="Inner diameter and length [the thesis' by diameter].",
)  # fmt: skip
@click.option("--seam-width", type=float, metavar="MM", help="0 for none [40].")
@click.option("--element-size", type=float, metavar="MM", help="[25]")
@click.option(
    "--symmetry", type=click.Choice(["quarter", "full"]), help="What is meshed [quarter]."
)
@click.option("--deflection", type=float, metavar="MM", help="Of the collar [240].")
@click.option("--frames", type=int, metavar="N", help="Equal steps of it [60].")
@click.option(
    "--measured", type=click.Path(path_type=Path), multiple=True,
    help="Measured loads, columns deflection and load with their units; several.",
)  # fmt: skip
@bend_options
def simulate_bend(
    diameter: float,
    pressure: float,
    cards: tuple[Path, ...],
    measured: tuple[Path, ...],
    **options: Any,
) -> None:
    """Inflate a cylinder and bend it with the materials of one or several cards.

    Writes what `bubblefit bend` writes; a project file (`bubblefit init --example bend`) takes
    several cylinders and sensors in volts.
    """
    shape = {
        name: options.pop(name)
        for name in (
            "length", "span", "support_diameter", "seam_width", "element_size", "symmetry",
            "deflection", "frames",
        )
    }  # fmt: skip
    collar = options.pop("collar")
    case: dict[str, Any] = {k: v for k, v in shape.items() if v is not None}
    case |= {"diameter": diameter, "pressure": pressure}
    if collar is not None:
        case["collar"] = {"inner_diameter": collar[0], "length": collar[1]}
    for path in measured:
        if not path.is_file():
            raise InputError(path, "--measured", "no such file")
    if measured:
        case["measured"] = [str(path) for path in measured]
    project = with_solver(_project(case, cards), options["solver_given"])
    name = f"bend-{diameter:g}mm-{pressure:g}kPa"
    run_bend_study("simulate bend", project, options["out"] or Path("out") / name, options)


def _project(case: dict[str, Any], cards: tuple[Path, ...]) -> BendProject:
    """A project of one case; complaints name the option instead of a key."""
    content = {
        "project": {"kind": "bend", "title": "Inflated cylinder in bending"},
        "cases": [case],
        "cards": [
            {"file": str(path), "name": name}
            for path, name in zip(cards, named_cards(cards), strict=True)
        ],
    }
    try:
        file = BendFile.model_validate(content)
        return bend_project(HERE, file)
    except ValidationError as found:
        error = first_error(HERE, found, BendFile)
    except InputError as found:
        error = found
    if error.path != HERE:
        raise error
    field = error.field.removeprefix("cases[0]").lstrip("., ")
    if not field.startswith(("cards", "measured")):
        field = "--" + field.replace("supports.", "").replace("_", "-")
    raise InputError(None, field.split("[")[0], error.problem)
