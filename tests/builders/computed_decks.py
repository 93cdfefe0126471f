"""Constants of a deck that computes its own readings: a project with bounds around the truth."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from bubblefit.experiments.deck.input_file import InputDeck
from bubblefit.experiments.deck.model import DeckModel
from bubblefit.experiments.deck.results import DeckReader, Probe, QuantityReading
from bubblefit.experiments.deck.solvers import ANY_LAW, DeckSolver
from bubblefit.project.project import Project, read_project
from bubblefit.solvers.calculix.solver import CalculixSolver

#: Times of the analysis at which displacements are compared.
TIMES = np.array([0.5, 1.0])

TIP = "LAST"
#: Constants, what is compared, and spread of some of CalculiX' test decks.
DECKS = {
    # Neo-Hooke, quadratic hexahedra, large strain.
    "beamnh": (("C10",), ((TIP, "z"),), 1.5),
    # An anisotropic material of 21 constants.
    "aniso": (
        ("D3333", "D1313", "D2323"),
        ((TIP, "z"), (TIP, "x"), (TIP, "y"), ((1, 1, 2), "x"), ((1, 1, 2), "y")),
        1.15,
    ),
    # Young's modulus and Poisson's ratio: tetrahedra, plane stress.
    "beam10p": (("E", "nu"), (("LOAD", "y"), ((1, 1, 2), "x"), ((1, 0, 1), "x")), 1.5),
    "planestress3": (("E", "nu"), (((10, 5, 0), "x"), ((10, 5, 0), "y")), 1.5),
}


@dataclass(frozen=True)
class ComputedDeck:
    """A deck of CalculiX, what is sought in it, and what is compared.

    constants : names as `bubblefit init --deck` gives them. places : node sets or positions, and
    axes of displacement. spread : factor between the truth and bounds on either side.
    """

    path: Path
    constants: tuple[str, ...]
    places: tuple[tuple[str | tuple[float, float, float], str], ...]
    spread: float = 1.5

    def truth(self):
        """Return the constants of the deck by name."""
        values = {constant.name: constant.value for constant in InputDeck(self.path).constants()}
        return {name: values[name] for name in self.constants}

    def project(self, folder: Path, fit: str = "starts = 1") -> Project:
        """Write a template, a project, and readings that the deck computes; return the project."""
        deck = InputDeck(self.path)
        constants = [c for c in deck.constants() if c.name in self.constants]
        (folder / "deck.inp.j2").write_text(deck.template(constants))
        text = '[fabric]\nname = "deck"\nthickness = 1.0\n\n[law]\nform = "none"\n\n'
        text += f'[fit]\n{fit}\n\n[[deck]]\nname = "deck"\ntemplate = "deck.inp.j2"\n\n'
        text += "[deck.parameters]\n"
        for constant in constants:
            ends = sorted((constant.value / self.spread, constant.value * self.spread))
            text += f"{constant.name} = {{ bounds = {ends} }}\n"
        for number, (values, (place, axis)) in enumerate(
            zip(self.displacements(folder), self.places, strict=True)
        ):
            rows = [f"{time},{value:.9g}" for time, value in zip(TIMES, values, strict=True)]
            measured = f"measured{number}.csv"
            (folder / measured).write_text("\n".join(["time,travel [mm]", *rows]) + "\n")
            key = f'set = "{place}"' if isinstance(place, str) else f"node = {list(place)}"
            text += (
                f'\n[[deck.compare]]\nname = "{number}"\nmeasured = "{measured}"\n'
                'x = { column = "time", time = 1.0 }\n'
                f'y = {{ column = "travel", {key}, displacement = "{axis}" }}\n'
            )
        (folder / "project.toml").write_text(text)
        return read_project(folder / "project.toml")

    def displacements(self, folder: Path):
        """Return what the deck itself computes: an array for each place."""
        axes = ["xyz".index(axis) for _, axis in self.places]
        probes = [
            Probe("displacement", place, axis)
            for (place, _), axis in zip(self.places, axes, strict=True)
        ]
        reader = DeckReader(
            tuple(QuantityReading(Probe("time"), p, TIMES) for p in probes), "job.frd"
        )
        model = DeckModel(folder, "deck.inp.j2", {}, {}, "", 1.0, reader)
        load = DeckSolver(CalculixSolver()).run(model, ANY_LAW).load
        return [load[rows] for rows in reader.rows]
