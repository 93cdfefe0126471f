"""The project file of bending cases and cards, read and converted to mm, N, MPa."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ..errors import InputError
from ..experiments.bending import BendingCurve
from ..materials.card import MaterialCard
from ..models.bending import inflated_cylinder
from ..models.bodies import Collar, RigidSupports
from ..models.cylinder import CylinderModel
from ..models.gas import Gas
from .bend_cards import BendCard, read_cards
from .bend_cases import case_settings
from .bend_schema import BendFile
from .fit import parse, solver_options


@dataclass(frozen=True, eq=False, kw_only=True)
class BendCase:
    """One cylinder at one pressure. Lengths mm, pressure MPa (gauge).

    deflections : frames of the bending. measured : its repetitions, empty where there are none.
    """

    name: str
    diameter: float
    pressure: float
    length: float
    seam_width: float
    size: float
    symmetry: Literal["quarter", "full"]
    cap_warp: Literal["x", "y"]
    supports: RigidSupports
    collar: Collar
    deflections: tuple[float, ...]
    gas: Gas
    measured: tuple[BendingCurve, ...] = ()

    def model(self, thickness: float) -> CylinderModel:
        """The case with a fabric of this thickness, mm.

        Raises
        ------
        InputError : sizes that make no mesh or bodies that do not fit around it.
        """
        return inflated_cylinder(
            self.diameter,
            self.pressure,
            thickness,
            self.size,
            self.length,
            self.seam_width,
            self.supports,
            self.collar,
            self.deflections,
            self.symmetry,
            self.cap_warp,
            self.gas,
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class BendProject:
    """Cases and cards that are run with each other, and on what.

    cases, cards : in the order of the file, cards by name. jobs : None for all cores.
    solver_options : by name of a solver, what its constructor is given.
    """

    path: Path
    title: str
    cases: tuple[BendCase, ...]
    cards: Mapping[str, BendCard]
    solver: str = "membrane"
    solver_options: Mapping[str, Mapping[str, Any]]
    jobs: int | None = None

    def material(self, card: str) -> MaterialCard:
        """The card of this name."""
        return self.cards[card].card


def read_bend(path: Path, data_folder: Path | None = None, need_data: bool = True) -> BendProject:
    """Read a project file (TOML), its cards and its measured curves.

    Parameters
    ----------
    data_folder : where the measured files lie; replaces `measured.folder`.
    need_data : whether files that are listed must be there.

    Raises
    ------
    InputError : one line naming the file and the dotted key; of a card or a measured file, that
        file. Cases that make no model are found here, before anything runs.
    """
    path = Path(path)
    return bend_project(path, parse(path, {"bend": BendFile}), data_folder, need_data)


def bend_project(
    path: Path, file: BendFile, data_folder: Path | None = None, need_data: bool = True
) -> BendProject:
    """The project of a parsed file at `path`; see `read_bend`."""
    cards = read_cards(path, file)
    folder = data_folder if data_folder is not None else path.parent / file.measured.folder
    settings = case_settings(path, file, Path(folder), need_data)
    cases = []
    for i, setting in enumerate(settings):
        case = BendCase(**setting)
        try:
            case.model(next(iter(cards.values())).card.thickness)
        except InputError as error:
            raise InputError(path, f"cases[{i}], {error.field}", error.problem) from None
        cases.append(case)
    return BendProject(
        path=path,
        title=file.project.title or path.parent.resolve().name,
        cases=tuple(cases),
        cards=cards,
        solver=file.run.solver,
        solver_options=solver_options(path, file.solver),
        jobs=file.run.jobs,
    )
