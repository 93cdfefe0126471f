"""[bubble.sheet]: how the fabric lay when the reference picture was taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ...meshes.disk_modes import doubly_symmetric
from ...sections import Positive, Section
from ..base import Place

Direction = Literal["dx", "dy", "dz"]
DIRECTIONS: tuple[Direction, ...] = ("dx", "dy", "dz")
FULL = "a sheet that is not doubly symmetric needs symmetry = 'full'"


class SheetSection(Section):
    """Flat and taut unless something is said."""

    surface: Literal["flat", "measured"] = "flat"
    degree: Annotated[int, Field(ge=2, le=14)] = 8
    modes: Annotated[int, Field(ge=0, le=45)] = 0
    prior: Positive | None = None
    slack: bool = False
    slack_prior: Positive = 0.3
    misfit: Positive | None = None
    rim: Literal["fixed", "measured"] = "fixed"
    constant_field: list[Direction] = Field(default_factory=list)
    from_pressure: Positive | None = None


@dataclass(frozen=True)
class Sheet:
    """How the sheet lay, and what of it is looked for.

    measured : whether the measured z is the reference surface. degree : of the polynomial through
    measured heights, and through the measured motion of the rim. modes : how many shapes of the
    surface are unknowns; prior : mm, one standard deviation of each. slack : whether it is an
    unknown in both directions; slack_prior : %, one standard deviation. misfit : mm RMS by which a
    good model is off, against which priors are weighed. moving_rim : whether the
    rim follows the measurement. constant : directions (0 to 2) of which a field that is the same
    at all pressures is projected out. since : number of the frame from which displacements are
    counted, None for the reference picture.
    """

    measured: bool = False
    degree: int = 8
    modes: int = 0
    prior: float = 3.0
    slack: bool = False
    slack_prior: float = 0.3
    misfit: float = 0.5
    moving_rim: bool = False
    constant: tuple[int, ...] = ()
    since: int | None = None

    @property
    def known(self) -> bool:
        """Whether anything makes up for a sheet that is not flat."""
        return bool(self.measured or self.modes or self.constant or self.since is not None)


def sheet_of(
    section: SheetSection,
    place: Place,
    pressures: Sequence[float],
    symmetry: str,
    of_files: bool,
    offset: bool,
) -> Sheet:
    """The section in mm; pressures are in MPa.

    of_files : whether the data are measured points. offset : whether a displacement offset is an
    unknown.

    Raises
    ------
    InputError : what does not go together.
    """
    given = section.model_fields_set
    if not of_files:
        for key in ("surface", "rim"):
            if getattr(section, key) == "measured":
                raise place.error(f"sheet.{key}", "nothing is measured here: no files are read")
    if symmetry == "quarter":
        if section.surface == "measured":
            raise place.error("sheet.surface", f"a measured surface: {FULL}")
        if not doubly_symmetric(section.modes):
            raise place.error("sheet.modes", f"{section.modes} modes: {FULL}")
    either = section.modes or section.slack
    for key, needs in (
        ("prior", section.modes),
        ("slack_prior", section.slack),
        ("misfit", either),
    ):
        if key in given and not needs:
            what = {"prior": "modes", "slack_prior": "slack", "misfit": "modes or slack"}[key]
            raise place.error(f"sheet.{key}", f"belongs to {what}, not asked for")
    since = _frame(section, place, pressures)
    if since is not None and section.surface == "measured":
        problem = "a surface measured under pressure is not without stress: use modes instead"
        raise place.error("sheet.from_pressure", problem)
    if offset and (since is not None or section.constant_field):
        problem = "takes up what from_pressure and constant_field take out; use one of them"
        raise place.error("nuisance.displacement_offset", problem)
    if since is not None and section.constant_field:
        problem = "takes out what from_pressure takes out already; use one of them"
        raise place.error("sheet.constant_field", problem)
    if section.constant_field and len(pressures) < 2:
        raise place.error("sheet.constant_field", "nothing is left of the data of one pressure")
    scale = place.scales.length
    return Sheet(
        measured=section.surface == "measured",
        degree=section.degree,
        modes=section.modes,
        prior=3.0 if section.prior is None else section.prior * scale,
        slack=section.slack,
        slack_prior=section.slack_prior,
        misfit=0.5 if section.misfit is None else section.misfit * scale,
        moving_rim=section.rim == "measured",
        constant=tuple(sorted({DIRECTIONS.index(d) for d in section.constant_field})),
        since=since,
    )


def _frame(section: SheetSection, place: Place, pressures: Sequence[float]) -> int | None:
    if section.from_pressure is None:
        return None
    near = np.isclose(pressures, section.from_pressure * place.scales.pressure, rtol=1e-6)
    if not near.any() or len(pressures) < 2:
        problem = f"expected one of several 'pressures', got {section.from_pressure:g}"
        raise place.error("sheet.from_pressure", problem)
    return int(np.argmax(near))
