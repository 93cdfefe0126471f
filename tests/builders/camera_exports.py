"""Frames of a bubble as the programs of image correlation export them, each with rejected points.

Layouts are those that the readers in `readers/formats` name their sources of. Frames are lists of
(points (n, 3), displacement (n, 3)) in mm; every writer gives the files, in order.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

Frames = Sequence[tuple[np.ndarray, np.ndarray]]
#: Of axes whose y points down and z away from the camera.
TURNED = np.array([1.0, -1.0, -1.0])


def _row(values, separator: str = ",", decimal: str = ".") -> str:
    return separator.join(repr(float(v)).replace(".", decimal) for v in values)


def _write(folder: Path, name: str, frames: Frames, lines, encoding: str = "utf-8") -> list[Path]:
    """Write a file a frame: its name by number, its lines by number, places and displacements."""
    files = [folder / name.format(k) for k in range(len(frames))]
    for k, (file, frame) in enumerate(zip(files, frames, strict=True)):
        file.write_bytes("\r\n".join([*lines(k, *frame), ""]).encode(encoding))
    return files


def plain(folder: Path, frames: Frames) -> list[Path]:
    def lines(k, x, u):
        return ["x,y,z,dx,dy,dz", *map(_row, np.hstack([x, u]))]

    return _write(folder, "plain_{}.csv", frames, lines)


def german(folder: Path, frames: Frames) -> list[Path]:
    """Metres for the places, micrometres for the displacements, units in a row of their own."""

    def lines(k, x, u):
        names = "Punkt\tX\tY\tZ\tVerschiebung X\tVerschiebung Y\tVerschiebung Z"
        rows = [_row(row, "\t", ",") for row in np.hstack([x * 1e-3, u * 1e3])]
        head = ["Prüfung 12", "Folie; 0,81 mm", "", names, "\tm\tm\tm\tµm\tµm\tµm"]
        return head + [f"{i}\t{row}" for i, row in enumerate(rows)]

    return _write(folder, "de_{}.txt", frames, lines, "utf-16")


def davis(folder: Path, frames: Frames) -> list[Path]:
    def lines(k, x, u):
        names = [f"{a}[mm]" for a in "xyz"] + [f"{a}-displacement[mm]" for a in "xyz"]
        rows = [_row([*row, 0.5], ";") for row in np.hstack([x, u])]
        rows.insert(3, _row([0.0] * 7, ";"))
        return [";".join([*names, "Maximum normal strain[µm/m]"]), *rows]

    return _write(folder, "B{:05d}.csv", frames, lines, "latin-1")


def tecplot(folder: Path, frames: Frames) -> list[Path]:
    def lines(k, x, u):
        names = [f"{a}[mm]" for a in "xyz"] + [f"V{a}[mm]" for a in "xyz"] + ["isValid"]
        rows = [_row([*row, 1.0], " ") for row in np.hstack([x, u])]
        rows.append("1.0 2.0 3.0 4.0 5.0 6.0 0")
        return [
            f'TITLE = "B{k:05d}"', "VARIABLES = " + " ".join(f'"{name}"' for name in names),
            f'ZONE T="Snapshot {k:04d}"', f"STRANDID=1, SOLUTIONTIME={k}",
            f"I={len(rows)}, J=1, K=1, ZONETYPE = Ordered", "DATAPACKING = POINT", *rows,
        ]  # fmt: skip

    return _write(folder, "B{:05d}.dat", frames, lines, "latin-1")


def tecplot_plain(folder: Path, frames: Frames) -> list[Path]:
    """Without units: the vectors are displacements, in the unit of the places."""

    def lines(k, x, u):
        rows = [_row(row, " ") for row in np.hstack([x, u])]
        return ['VARIABLES = "x", "y", "z", "Vx", "Vy", "Vz"', f"ZONE T={k}, F=POINT", *rows]

    return _write(folder, "B{:05d}.dat", frames, lines, "latin-1")


def long_table(folder: Path, frames: Frames) -> list[Path]:
    path, rows = folder / "all.csv", ["Frame,x,y,z,dx,dy,dz"]
    for k, (x, u) in enumerate(frames):
        rows += [f"{k + 1},{_row(row)}" for row in np.hstack([x, u])]
    path.write_text("\n".join(rows))
    return [path]


def vic3d(folder: Path, frames: Frames) -> list[Path]:
    def lines(k, x, u):
        names = [f"{a} [mm]" for a in "XYZUVW"]
        names += ["exx [1]", "Sigma_X [mm]", "sigma [pixel]", "x [pixel]"]
        rows = [_row([*row, 0.01, 0.002, 0.02, 512.0]) for row in np.hstack([x, u])]
        rows.insert(2, ",,,,,,,,-1,7")
        rows.append("9.5,0.0,0.0,0.0,0.0,0.0,0.0,0.0,-1.0,8")
        return [", ".join(f'"{name}"' for name in names), *rows]

    return _write(folder, "vic_{}.csv", frames, lines)


def vic3d_mat(folder: Path, frames: Frames) -> list[Path]:
    from scipy.io import savemat

    files = []
    for k, (x, u) in enumerate(frames):
        columns = {name: np.append(v, 0.0) for name, v in zip("XYZUVW", [*x.T, *u.T], strict=True)}
        columns["sigma"] = np.append(np.full(len(x), 0.01), -1.0)
        # The grid's shape and the places in the picture, which are no lengths.
        columns |= {name: np.arange(len(x) + 1.0) for name in "xyuv"}
        grid = {name: v.reshape(1, -1) for name, v in columns.items()}
        files.append(folder / f"vic_{k}.mat")
        savemat(files[-1], grid, do_compression=bool(k % 2))
    return files


def aramis(folder: Path, frames: Frames) -> list[Path]:
    def lines(k, x, u):
        names = [f"{a} unverformt" for a in "XYZ"] + [f"Verschiebung {a}" for a in "XYZ"]
        rows = [f"{i};{_row(row, ';', ',')}" for i, row in enumerate(np.hstack([x, u]))]
        rows.insert(1, "9999;1,5;2,5;0,5;;;")
        title = ["ZEISS Correlate 2023", f"Stufe {k}; Flächenkomponente 1", ""]
        return [*title, ";".join(["ID", *names]), ";mm;mm;mm;mm;mm;mm", *rows]

    return _write(folder, "stage_{}.csv", frames, lines, "cp1252")


def matchid_2024(folder: Path, frames: Frames) -> list[Path]:
    names = [f"Coordinates.Image {a} [Pixel]" for a in "XY"] + [f"coor.{a} [mm]" for a in "XYZ"]
    names += ["disp.Horizontal Displacement U [mm]", "disp.Vertical Displacement V [mm]"]
    names += ["disp.Out-Of-Plane: W [mm]", "strain.Strain-global frame: Exx [ ]"]

    def lines(k, x, u):
        table = np.hstack([np.ones((len(x), 2)), TURNED * x, TURNED * u, np.zeros((len(x), 1))])
        return [",".join(names), *map(_row, table), "1,1,2.0,3.0,NaN,NaN,NaN,NaN,NaN"]

    return _write(folder, "image_{}.csv", frames, lines)


def matchid_2023(folder: Path, frames: Frames) -> list[Path]:
    def lines(k, x, u):
        table = np.hstack([np.ones((len(x), 2)), TURNED * x, TURNED * u, np.zeros((len(x), 3))])
        rows = [_row(row, ";", ",") for row in table]
        rows.append("1;1;2,0;3,0;n. def.;n. def.;n. def.;n. def.;0,0;0,0;0,0")
        return ["x_pic;y_pic;x;y;z;u;v;w;exx;eyy;exy", *rows]

    return _write(folder, "image_{}.csv", frames, lines)


def dice(folder: Path, frames: Frames) -> list[Path]:
    names = "SUBSET_ID COORDINATE_X COORDINATE_Y DISPLACEMENT_X DISPLACEMENT_Y SIGMA STATUS_FLAG"
    names = names.split()
    names += [f"MODEL_{kind}_{a}" for kind in ("COORDINATES", "DISPLACEMENT") for a in "XYZ"]
    head = ["***", "*** Digital Image Correlation Engine (DICe), Copyright 2014 Sandia Corporation"]
    head += ["***", "*** Reference image: ./ref.tif ", "***", ",".join(names)]

    def lines(k, x, u):
        table = np.hstack([TURNED * x, TURNED * u])
        rows = [f"{i},10,20,0.5,0.5,0.004,4,{_row(row)}" for i, row in enumerate(table)]
        rows.insert(4, "7,10,20,0.5,0.5,-1.0,8," + _row([1.0] * 6))
        return [*head, *rows, "8,10,20,0.5,0.5,0.1,11," + _row([1.0] * 6)]

    return _write(folder, "DICe_solution_{}.txt", frames, lines)


def istra4d(folder: Path, frames: Frames) -> list[Path]:
    import h5py

    files = [folder / f"series_step_{k}.hdf5" for k in range(len(frames))]
    for path, (x, u) in zip(files, frames, strict=True):
        with h5py.File(path, "w") as file:
            file["coordinates/mask"] = np.append(np.ones(len(x), dtype=bool), False)[None]
            for i, axis in enumerate("xyz"):
                file[f"coordinates/coordinate_{axis}"] = np.append(x[:, i] + u[:, i], 0.0)[None]
                file[f"displacements/displacement_{axis}"] = np.append(u[:, i], 0.0)[None]
            file["add_data/analog_channels"] = np.zeros((1, 8))
    return files


def multidic(folder: Path, frames: Frames) -> list[Path]:
    from scipy.io import savemat

    rest = [(frames[0][0], np.zeros_like(frames[0][1])), *frames]
    cells = {name: np.empty((1, len(rest)), dtype=object) for name in ("places", "moves")}
    for k, (x, u) in enumerate(rest):
        cells["places"][0, k] = np.vstack([x + u, np.full(3, np.nan)])
        cells["moves"][0, k] = np.vstack([u, np.full(3, np.nan)])
    results = {"Points3D": cells["places"], "Disp": {"DispVec": cells["moves"]}}
    savemat(folder / "results.mat", {"DIC3DPPresults": results}, do_compression=True)
    return [folder / "results.mat"]


def pyaldic(folder: Path, frames: Frames) -> list[Path]:
    rest = [(frames[0][0], np.zeros_like(frames[0][1])), *frames]
    lost = np.full((1, 3), np.nan)
    points = np.array([np.vstack([TURNED * (x + u), lost]) for x, u in rest])
    moved = np.array([np.vstack([TURNED * u, lost]) for _, u in rest])
    fields = {name: moved[:, :, i] for i, name in enumerate("UVW")}
    path = folder / "run.npz"
    np.savez_compressed(path, strategy=np.asarray("hybrid"), points3D=points, **fields)
    return [path]


def pyaldic_csv(folder: Path, frames: Frames) -> list[Path]:
    def lines(k, x, u):
        table = np.hstack([np.ones((len(x), 2)), TURNED * (x + u), TURNED * u])
        return ["x_px,y_px,X_mm,Y_mm,Z_mm,U,V,W", *map(_row, table), "3,4" + 6 * ",nan"]

    return _write(folder, "run_frame{:03d}.csv", frames, lines)


def ncorr(folder: Path, frames: Frames) -> list[Path]:
    """In plane only, version 5: the points of a grid 0.5 mm wide, ten pixels a mm."""
    from scipy.io import savemat

    fields = ("plot_u_ref_formatted", "plot_v_ref_formatted", "plot_corrcoef_dic")
    saved = np.empty((1, len(frames)), dtype=[(name, object) for name in fields])
    for k, (x, u) in enumerate(frames):
        column, row = (np.rint(np.abs(x[:, i]) / 0.5).astype(int) for i in (0, 1))
        grids = np.zeros((3, row.max() + 3, column.max() + 3))
        grids[:, row, column] = [u[:, 0], -u[:, 1], np.full(len(x), 0.02)]
        for name, grid in zip(fields, grids, strict=True):
            saved[name][0, k] = grid
    about = {"spacing": 4.0, "pixtounits": 0.1, "units": "mm"}
    savemat(folder / "ncorr.mat", {"data_dic_save": {"displacements": saved, "dispinfo": about}})
    return [folder / "ncorr.mat"]


#: Writers by the name of the format that is to be found, and of the case.
EXPORTS = {
    "plain": ("csv", plain), "german": ("csv", german), "davis": ("davis", davis),
    "long table": ("csv", long_table), "tecplot plain": ("tecplot", tecplot_plain),
    "tecplot": ("tecplot", tecplot), "vic3d": ("vic3d", vic3d),
    "vic3d-mat": ("vic3d-mat", vic3d_mat), "aramis": ("aramis", aramis),
    "matchid 2024": ("matchid", matchid_2024), "matchid 2023": ("matchid", matchid_2023),
    "dice": ("dice", dice), "istra4d": ("istra4d", istra4d), "multidic": ("multidic", multidic),
    "pyaldic": ("pyaldic", pyaldic), "pyaldic csv": ("pyaldic", pyaldic_csv),
}  # fmt: skip
