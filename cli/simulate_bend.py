"""`bubblefit simulate bend`: one inflated cylinder in three-point bending, without a project."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from pydantic import ValidationError

from ..errors import InputError
from .examples import examples
from .predicting import prediction_options, run_predictions

if TYPE_CHECKING:
    from ..materials.card import MaterialCard
    from ..project.project import Project

#: Stands for the project's file: a project in the folder where the command runs.
HERE = Path("simulate bend")
SHAPE = (
    "length", "span", "support_diameter", "seam_width", "element_size", "symmetry", "deflection",
    "frames",
)  # fmt: skip


@click.command(
    "bend",
    epilog=examples(
        "bubblefit simulate bend --diameter 150 --pressure 140 --card material.toml",
        "bubblefit simulate bend --diameter 200 --pressure 70 --card material.toml --places 50,100",
    ),
)
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
    help="Inner diameter and length [240 145; above 200 mm of diameter 295 147].",
)  # fmt: skip
@click.option("--seam-width", type=float, metavar="MM", help="0 for none [40].")
@click.option("--element-size", type=float, metavar="MM", help="[25]")
@click.option(
    "--symmetry", type=click.Choice(["quarter", "full"]), help="What is meshed [quarter]."
)
@click.option("--deflection", type=float, metavar="MM", help="Of the collar [240].")
@click.option("--frames", type=int, metavar="N", help="Equal steps of it [60].")
@click.option(
    "--places", metavar="MM,MM,...", help="Where loads are listed [1/4, 1/2 and 1 diameter]."
)
@click.option(
    "--measured", type=click.Path(path_type=Path), multiple=True,
    help="Measured loads, columns deflection and load with their units; several.",
)  # fmt: skip
@prediction_options
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
    from .options import named_cards, numbers

    collar, places = options.pop("collar"), options.pop("places")
    given = {name: options.pop(name) for name in SHAPE}
    section: dict[str, Any] = {key: value for key, value in given.items() if value is not None}
    section |= {"diameter": diameter, "pressure": pressure}
    section["name"] = f"{diameter:g} mm, {pressure:g} kPa"
    if collar is not None:
        section["collar"] = {"inner_diameter": collar[0], "length": collar[1]}
    if places is not None:
        section["places"] = numbers(places, "--places")
    for path in measured:
        if not path.is_file():
            raise InputError(path, "--measured", "no such file")
    if measured:
        section["measured"] = {"files": [str(path) for path in measured]}
    named = named_cards(cards)
    project = _project(section, named)
    folder = options["out"] or Path("out") / f"bend-{diameter:g}mm-{pressure:g}kPa"
    run_predictions(project, folder, options, None, named)


def _project(section: dict[str, Any], cards: Mapping[str, MaterialCard]) -> Project:
    """A project of one cylinder; complaints name the option instead of a key."""
    from ..experiments.kinds import Fabric, Place, Scales
    from ..experiments.registry import kind_named
    from ..project.project import Project
    from ..project.schema import FitSection, LawSection
    from ..readers.sections import first_error
    from ..solvers.registry import solver_settings

    kind = kind_named("cylinder")
    fabric = Fabric("Inflated cylinder in bending", next(iter(cards.values())).thickness)
    place = Place(HERE, "", fabric, Scales(pressure_unit="kPa"))
    try:
        test = kind.read(kind.section.model_validate(section), place, section["name"])
    except ValidationError as errors:
        error = first_error(HERE, errors, kind.section)
    except InputError as found:
        error = found
    else:
        return Project(
            path=HERE,
            fabric=fabric,
            scales=place.scales,
            tests={test.name: test},
            law=LawSection(),
            fit=FitSection(),
            cards={},
            solver_options=solver_settings(HERE, {}),
        )
    if error.path != HERE:
        raise error
    field = error.field.lstrip(".")
    raise InputError(None, f"--{field.split('[')[0].replace('_', '-')}", error.problem)
