"""CSV exports of MatchID Stereo, with the headings of 2023 and those of 2024.

    x_pic,y_pic,x,y,z,u,v,w,exx,eyy,exy
    Coordinates.Image X [Pixel],Coordinates.Image Y [Pixel],coor.X [mm],coor.Y [mm],coor.Z [mm],
        disp.Horizontal Displacement U [mm],disp.Vertical Displacement V [mm],
        disp.Out-Of-Plane: W [mm],strain.Strain-global frame: Exx [ ]

Source: the public reader of the package mt2py (headings of both versions; y and z, V and W with the
other sign), and a reader of these headings for MultiDIC. Which places the coordinates are (before
the motion), and what a point without correlation looks like, could not be confirmed: "NaN", also as
German .NET writes it ("n. def."), is taken for one. Where the axes of the export were set by hand,
`camera_axes = false` leaves them as they are.
"""

from __future__ import annotations

from pathlib import Path

from ..registry import Format, register_format
from ..text_frames import text_reader


def recognises(path: Path, head: bytes) -> bool:
    """Return whether the headings are those of either version."""
    top = head[:4096].lower()
    return (b"coor.x" in top and b"coor.y" in top) or (b"x_pic" in top and b"y_pic" in top)


register_format(
    Format(
        "matchid",
        "frame",
        "CSV of MatchID Stereo, 2023 or 2024",
        text_reader("matchid", camera_axes=True),
        recognises,
    )
)
