"""Text exports: ARAMIS, DaVis, MatchID and VIC-3D, read by their headings alone, and DICe.

GOM ARAMIS, GOM Correlate, ZEISS Correlate (lines of title, semicolons):

    # ARAMIS Professional
    id;x_undeformed [mm];y_undeformed [mm];z_undeformed [mm];ux [mm];uy [mm];uz [mm]

Source: the public readers of such files in crackpy (windows-1252, semicolons, places in the
reference state and displacements, NaN since 2020), aramis_cdt (undeformed coordinates and
displacements as exports of their own) and pypif (two lines of title, units in square brackets). The
German headings (`Verschiebung X`), the row of units and the decimal comma could not be confirmed
from a file. What is called "deformed" or "verformt" is taken for a place after the motion.

LaVision DaVis, StrainMaster (semicolons, Latin-1, units in the headings):

    x[mm];y[mm];z[mm];x-displacement[mm];y-displacement[mm];z-displacement[mm]

Source: public scripts that add the displacement to x, y, z for the deformed membrane, so that these
are places in the reference state. How DaVis marks lost correlation in CSV could not be confirmed:
rows of zeros throughout and empty cells are left out; zeros in the displacement alone are not.

MatchID Stereo, 2023 and 2024:

    x_pic,y_pic,x,y,z,u,v,w,exx,eyy,exy
    Coordinates.Image X [Pixel],Coordinates.Image Y [Pixel],coor.X [mm],coor.Y [mm],coor.Z [mm],
        disp.Horizontal Displacement U [mm],disp.Vertical Displacement V [mm],
        disp.Out-Of-Plane: W [mm],strain.Strain-global frame: Exx [ ]

Source: the public reader of the package mt2py (headings of both versions; y and z, V and W with the
other sign), and a reader of these headings for MultiDIC. Which places the coordinates are (before
the motion), and what a point without correlation looks like, could not be confirmed: "NaN", also as
German .NET writes it ("n. def."), is taken for one. Where the axes of the export were set by hand,
`camera_axes = false` leaves them as they are.

Correlated Solutions VIC-3D (quoted headings, a sigma, perhaps lines above):

    "X [mm]","Y [mm]","Z [mm]","U [mm]","V [mm]","W [mm]","sigma [pixel]"

Source: public scripts that write and read such files (with `,` and, from German systems, `;` and
decimal commas and a line above the names), in which sigma is below zero where correlation was lost,
X, Y, Z are added to U, V, W for the deformed state, and rejected points have empty cells. Files
without units are older ones; there "x" in small letters is a place in the picture and "X" one in
space.

Solution files of DICe: lines of `***`, a row of names, SIGMA and STATUS_FLAG.

    *** Digital Image Correlation Engine (DICe), Copyright 2014 Sandia Corporation
SUBSET_ID,COORDINATE_X,...,SIGMA,STATUS_FLAG,MODEL_COORDINATES_X,...,MODEL_DISPLACEMENT_X,...

Source: DICe's own (DICe_Schema.cpp; DICe.h numbers the states, of which those that failed are left
out; sigma is -1 where correlation failed) and public scripts that add MODEL_DISPLACEMENT to
MODEL_COORDINATES. COORDINATE_X is in pixels; y points down; that z points away from the camera
could not be confirmed (`camera_axes = false` leaves both). MODEL_ is in the calibration's unit.

Fields of muDIC, from its DataFrame (pixels; x, y are places after the motion):

    d,x,y,ux,uy,true_strain_xx,...

Source: its public package, which adds the displacement to the mesh before it writes.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from ...errors import InputError
from ..frames import Frame, FrameOptions
from ..registry import Format, register_format
from ..tables import read_lines
from ..text_frames import read_text

#: What the first letters of a file have in them, by its format: a title that names the maker or the
#: program; headings with their unit right behind; those of either version; quoted ones; a header,
#: or the row of names without one.
HEADINGS = {
    "aramis": (rb"(?i)\b(aramis|gom|zeiss)\b",),
    "davis": (rb"\bx\[\w+\].*\bx-displacement\[",),
    "matchid": (rb"(?i)coor\.x|x_pic", rb"(?i)coor\.y|y_pic"),
    "vic3d": (rb'"\s*X( \[\w+\])?\s*"', rb'"\s*(W|sigma)( \[\w+\])?\s*"'),
    "dice": (rb"(?s)\A(\*\*\*.*DICe|SUBSET_ID)",),
    "mudic": (rb"\bux\b", rb"\buy\b", rb"\btrue_strain_xx\b"),
}


def is_headed(format: str, path: Path, head: bytes) -> bool:
    """Return whether a file begins as those of a format do."""
    top = head[:4096].replace(b"\0", b"")
    return all(re.search(pattern, top) for pattern in HEADINGS[format])


#: The states of DICe.h in which a subset was found; all others are failures of some step.
SUCCESSFUL = (0, 1, 2, 3, 4, 6, 15, 18)
NAMES = {
    **{axis: f"MODEL_COORDINATES_{axis.upper()}" for axis in "xyz"},
    **{f"d{axis}": f"MODEL_DISPLACEMENT_{axis.upper()}" for axis in "xyz"},
}


def read_dice(path: Path, options: FrameOptions, format: str) -> Sequence[Frame]:
    """Read the one frame of a file; without a stereo model it is refused."""
    top = "\n".join(text for _, text in read_lines(path, "***", any_encoding=True)[:3])
    is_singular = "MODEL_COORDINATE_X" in top  # as some versions write it
    written = {
        key: name.replace("COORDINATES", "COORDINATE") if is_singular else name
        for key, name in NAMES.items()
    }
    names = {key: name for key, name in written.items() if name in top}
    if "x" not in names and not options.columns:
        problem = f"has no {NAMES['x']}: planar and in pixels; run DICe with a stereo calibration"
        raise InputError(path, "", problem)
    return read_text(
        path,
        options,
        format,
        comment="***",
        # Without a stereo model, of columns that the user names, the model's are not required.
        names=names,
        status=("STATUS_FLAG", SUCCESSFUL),
        camera_axes=True,
    )


def read_mudic(path: Path, options: FrameOptions, format: str) -> Sequence[Frame]:
    """Read the frame of a file whose columns the user names, as pixels cannot be told from mm."""
    if not {"dx", "dy"} <= {*(options.columns or ())}:
        problem = (
            "is of muDIC, which writes pixels, with x and y of the deformed picture: multiply x, "
            "y, ux and uy by the mm of a pixel, then name them with columns (x, y, dx, dy)"
        )
        raise InputError(path, "", problem)
    coordinates = options.coordinates or "deformed"
    return read_text(path, replace(options, coordinates=coordinates), format)


for name, title, read in (
    ("aramis", "text of ARAMIS or ZEISS Correlate", read_text),
    ("davis", "CSV of LaVision DaVis", read_text),
    ("matchid", "CSV of MatchID Stereo, 2023 or 2024", partial(read_text, camera_axes=True)),
    ("vic3d", "CSV of VIC-3D", partial(read_text, upper_is_length=True)),
    ("dice", "solution files of DICe", read_dice),
    ("mudic", "CSV of muDIC in mm (planar)", read_mudic),
):
    recognises = partial(is_headed, name)
    register_format(Format(name, "frame", title, partial(read, format=name), recognises))
