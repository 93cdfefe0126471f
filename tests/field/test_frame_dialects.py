"""Field: text tables of frames in the dialects of programs and people."""

from dataclasses import replace

import numpy as np
from bubblefit.readers.fields import PLAIN, read_fields
from bubblefit.readers.frames import BELOW_POINTS, FrameOptions, read_frames
from bubblefit.readers.quantities import LENGTHS
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ..support.refusals import complaint_with


def rows_of(*columns, form="{:.6f}", separator=","):
    text = [[c if isinstance(c, str) else form.format(c) for c in one] for one in columns]
    return [separator.join(row) for row in zip(*text, strict=True)]


def test_frame_has_neither_rows_of_means_nor_repeated_columns(tmp_path):
    """Rows of means are no points, and a column that comes twice with the same cells is one."""
    draw = np.random.default_rng(0).uniform(-9, 9, (20, 6)).round(4)
    means = ["mean,1,1,1,1,1,1,1", "std. dev.,2,2,2,2,2,2,2"]
    behind = ["99,1,1,1,1,1,1,1,Mittelwert", ",2,2,2,2,2,2,2,max"]
    third = ["µm", "µm,µm,µm,µm,µm,µm,µm,µm", "Cam 1,Cam 1,Cam 2,Cam 2,,,left,right"]
    for unit, below in (("mm", means), ("cm", behind), ('"', []), ("µm", third), ("in", [])):
        names = ",".join(["no", *(f"{q} [{unit}]" for q in ("x", "y", "z", "dx", "dy", "dz", "x"))])
        path = tmp_path / f"{len(unit)}{len(below)}.csv"
        if below == third:
            names, below = "\n".join([names.replace(" [µm]", ""), *third[1:]]), []
        body = rows_of(map(str, range(20)), *draw.T, draw[:, 0], form="{:.4f}")
        names, note = (f"{names},note", ",") if below == behind else (names, "")
        lines = ["# a lab's own", names, *(row + note for row in body), *below]
        path.write_text("\n".join(lines))
        (frame,) = read_frames([path], FrameOptions())
        found = np.column_stack([frame.points, frame.displacement])
        np.testing.assert_allclose(found, LENGTHS[unit] * draw, rtol=1e-12)
        assert frame.dropped == ({BELOW_POINTS: 2} if below else {})
    path.write_text(path.read_text().replace(f"{draw[3, 0]:.4f}\n", "0.5\n"))
    complaint_with(["x [in]", "appears twice"], read_frames, [path])


NAMES = {
    "x": ("x", "X", "x_mm", "X [mm]", "Koordinate X", "x0 mm".replace("0", "")),
    "y": ("y", "Y (mm)", "coor.Y [mm]", "y-coordinate"),
    "z": ("z", "Z_mm", "z undeformed [mm]"),
    "dx": ("dx", "u", "U [mm]", "displacement_x", "Verschiebung X [mm]", "x-displacement[mm]"),
    "dy": ("dy", "v", "uy", "disp y"),
    "dz": ("dz", "W", "uz [mm]", "Out-Of-Plane: W [mm]"),
}
lengths = st.floats(-1e4, 1e4, allow_subnormal=False).map(lambda v: v if abs(v) > 1e-9 else 0.5)


@settings(deadline=None, max_examples=80)
@example(
    rows=[(1.5, 2.5, 3.5, 4.5, 5.5, 6.5)] * 2,
    names=("X [mm]", "Y (mm)", "Z_mm", "U [mm]", "v", "W"), order=[5, 4, 3, 2, 1, 0],
    dialect="\t,", number="{!r}", encoding="utf-16", above=[], end="\r\n", quoted=False, flags=None,
)  # fmt: skip
@given(
    rows=st.lists(st.tuples(*[lengths] * 6), min_size=2, max_size=6),
    names=st.tuples(*[st.sampled_from(names) for names in NAMES.values()]),
    order=st.permutations(range(6)),
    dialect=st.sampled_from([",.", ";.", ";,", "\t.", "\t,", " ."]),
    number=st.sampled_from(["{!r}", "{:.17e}", "{:+.17g}", "{:.16E}"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    above=st.sampled_from([[], ["#", "", "# two, 2"], ["Sheet 3; flat", "second, of the day", ""]]),
    end=st.sampled_from(["\n", "\r\n", "\r", "\n\n"]),
    quoted=st.booleans(),
    flags=st.none() | st.lists(st.integers(0, 1), min_size=6, max_size=6),
)
def test_frame_of_any_dialect_reads_back(
    tmp_path_factory, rows, names, order, dialect, number, encoding, above, end, quoted, flags
):
    separator, decimal = dialect
    good = [True, *(not flag for flag in (flags or [0] * 6)[1 : len(rows)])]
    heads = [names[i] for i in order] + ["flag"] * (flags is not None)
    if quoted or separator == " ":
        heads = [f'"{name}"' for name in heads]
    body = [[number.format(row[i]).replace(".", decimal) for i in order] for row in rows]
    if flags is not None:
        body = [[*row, str(int(not kept))] for row, kept in zip(body, good, strict=True)]
    path = tmp_path_factory.getbasetemp() / "dialect.csv"
    lines = [*above, *(separator.join(row) for row in [heads, *body]), ""]
    path.write_bytes(end.join(lines).encode(encoding))
    options = replace(PLAIN, flag_column=None if flags is None else "flag")
    (field,) = read_fields([path], [0.1], options)
    read = np.column_stack([field.points, field.z, field.displacement])
    rounding = 0 if number == "{!r}" else 1e-15
    np.testing.assert_allclose(read, np.array(rows)[good], rtol=rounding)
    assert sum(field.dropped.values()) == len(rows) - sum(good)
