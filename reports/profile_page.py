"""The folder of profile likelihoods: profile.csv and .png, report.html, notes.csv, result.json."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..inference.likelihood import THRESHOLD
from ..inference.posterior import LEVEL
from ..runs.profile import METHOD
from ..runs.series import FILES, write_folder
from .charts import Charts
from .content import Report, Section, Table
from .studies import ProfilePanel, profile_charts
from .vega import save

if TYPE_CHECKING:
    from ..runs.profile import Profile, Profiles

TABLE, FIGURE = "profile.csv", "profile.png"
CAPTION = (
    "-2 log L of each modulus held at a value, everything else fitted anew (dots), and by the "
    "1 sigma of the fit, its bounds left aside (dashed); the horizontal line is the threshold "
    f"of {100 * LEVEL:.0f} %"
)


def write_profiles(found: Profiles, folder: Path) -> Path:
    """Write everything; raises OutputError. The page's path."""
    charts = profile_charts(_panels(found), THRESHOLD, CAPTION)
    figures = {FIGURE: lambda path: save(path, charts)}
    return write_folder(
        folder, {TABLE: found.table()}, figures, found.notes, _page(found, charts), found.result, 9
    )


def _panels(found: Profiles) -> list[ProfilePanel]:
    return [
        ProfilePanel(one.name, *one.curve, one.best, one.sigma, one.ends, one.band)
        for one in found.each
    ]


def _page(found: Profiles, charts: Charts) -> Report:
    first = found.each[0]
    return Report(
        title=f"{found.title}: profile likelihood",
        summary=f"{first.name}: {first.words}.",
        facts=[
            ("card", found.card),
            ("tests", ", ".join(found.tests)),
            ("analyses", found.analyses),
        ],
        warnings=[note.line for note in found.notes],
        sections=[
            Section(
                "The profiles",
                [charts, _ends(found)],
            )
        ],
        files=[
            (TABLE, "the curves"),
            (FIGURE, "picture of the profiles"),
            *FILES,
        ],
    )


def _ends(found: Profiles) -> Table:
    header = [
        "modulus", "MPa", f"{100 * LEVEL:.0f} % from, MPa", "to, MPa", "band of the fit from, MPa",
        "to, MPa", "upper over lower distance", "analyses",
    ]  # fmt: skip
    rows = [_row(one) for one in found.each]
    return Table("Between what each modulus lies", header, rows, METHOD)


def _row(one: Profile) -> list[object]:
    low, high = (
        end if end is not None else f"not closed: {side.why}"
        for end, side in zip(one.ends, (one.below, one.above), strict=True)
    )
    skew = "" if one.asymmetry is None else one.asymmetry
    return [one.name, one.best, low, high, *one.band, skew, one.analyses]
