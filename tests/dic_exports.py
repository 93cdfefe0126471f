"""Frames of a bubble as the programs of image correlation export them, each with rejected points.

Layouts are those that the readers in `readers/formats` name their sources of. Frames are lists of
(points (n, 3), displacement (n, 3)) in mm; every writer gives the files, in order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

Frames = Sequence[tuple[np.ndarray, np.ndarray]]


def _lines(path: Path, lines: Sequence[str], encoding: str = "utf-8") -> Path:
    path.write_bytes("\r\n".join([*lines, ""]).encode(encoding))
    return path


def _row(values: Sequence[float], separator: str = ",", decimal: str = ".") -> str:
    return separator.join(repr(float(v)).replace(".", decimal) for v in values)


def plain(folder: Path, frames: Frames) -> list[Path]:
    files = []
    for k, (x, u) in enumerate(frames):
        rows = [_row(row) for row in np.hstack([x, u])]
        files.append(_lines(folder / f"plain_{k}.csv", ["x,y,z,dx,dy,dz", *rows]))
    return files


def german(folder: Path, frames: Frames) -> list[Path]:
    """Metres for the places, micrometres for the displacements, units in a row of their own."""
    files = []
    for k, (x, u) in enumerate(frames):
        rows = [_row(row, "\t", ",") for row in np.hstack([x * 1e-3, u * 1e3])]
        names = ["Punkt\tX\tY\tZ\tVerschiebung X\tVerschiebung Y\tVerschiebung Z"]
        units = ["\tm\tm\tm\tµm\tµm\tµm"]
        body = [f"{i}\t{row}" for i, row in enumerate(rows)]
        head = ["Prüfung 12", "Folie; 0,81 mm", ""]
        files.append(_lines(folder / f"de_{k}.txt", head + names + units + body, "utf-16"))
    return files


def davis(folder: Path, frames: Frames) -> list[Path]:
    names = [f"{a}[mm]" for a in "xyz"] + [f"{a}-displacement[mm]" for a in "xyz"]
    files = []
    for k, (x, u) in enumerate(frames):
        rows = [_row([*row, 0.5], ";") for row in np.hstack([x, u])]
        rows.insert(3, _row([0.0] * 7, ";"))
        head = ";".join([*names, "Maximum normal strain[µm/m]"])
        files.append(_lines(folder / f"B{k:05d}.csv", [head, *rows], "latin-1"))
    return files


def tecplot(folder: Path, frames: Frames) -> list[Path]:
    names = [f"{a}[mm]" for a in "xyz"] + [f"V{a}[mm]" for a in "xyz"] + ["isValid"]
    files = []
    for k, (x, u) in enumerate(frames):
        rows = [_row([*row, 1.0], " ") for row in np.hstack([x, u])]
        rows.append("1.0 2.0 3.0 4.0 5.0 6.0 0")
        head = [
            f'TITLE = "B{k:05d}"', "VARIABLES = " + " ".join(f'"{name}"' for name in names),
            f'ZONE T="Snapshot {k:04d}"', f"STRANDID=1, SOLUTIONTIME={k}",
            f"I={len(rows)}, J=1, K=1, ZONETYPE = Ordered", "DATAPACKING = POINT",
        ]  # fmt: skip
        files.append(_lines(folder / f"B{k:05d}.dat", head + rows, "latin-1"))
    return files


def vic3d(folder: Path, frames: Frames) -> list[Path]:
    names = [f"{a} [mm]" for a in "XYZUVW"] + [
        "exx [1]", "Sigma_X [mm]", "sigma [pixel]", "x [pixel]",
    ]  # fmt: skip
    files = []
    for k, (x, u) in enumerate(frames):
        rows = [_row([*row, 0.01, 0.002, 0.02, 512.0]) for row in np.hstack([x, u])]
        rows.insert(2, ",,,,,,,,-1,7")
        rows.append("9.5,0.0,0.0,0.0,0.0,0.0,0.0,0.0,-1.0,8")
        head = ", ".join(f'"{name}"' for name in names)
        files.append(_lines(folder / f"vic_{k}.csv", [head, *rows]))
    return files


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
    names = [f"{a} unverformt" for a in "XYZ"] + [f"Verschiebung {a}" for a in "XYZ"]
    files = []
    for k, (x, u) in enumerate(frames):
        rows = [f"{i};{_row(row, ';', ',')}" for i, row in enumerate(np.hstack([x, u]))]
        rows.insert(1, "9999;1,5;2,5;0,5;;;")
        head = [
            "ZEISS Correlate 2023", f"Stufe {k}; Flächenkomponente 1", "", ";".join(["ID", *names]),
        ]  # fmt: skip
        files.append(
            _lines(folder / f"stage_{k}.csv", [*head, ";mm;mm;mm;mm;mm;mm", *rows], "cp1252")
        )
    return files


def _turned(values: np.ndarray) -> np.ndarray:
    return values * (1.0, -1.0, -1.0)


def matchid_2024(folder: Path, frames: Frames) -> list[Path]:
    names = [f"Coordinates.Image {a} [Pixel]" for a in "XY"] + [f"coor.{a} [mm]" for a in "XYZ"]
    names += ["disp.Horizontal Displacement U [mm]", "disp.Vertical Displacement V [mm]"]
    names += ["disp.Out-Of-Plane: W [mm]", "strain.Strain-global frame: Exx [ ]"]
    files = []
    for k, (x, u) in enumerate(frames):
        table = np.hstack([np.ones((len(x), 2)), _turned(x), _turned(u), np.zeros((len(x), 1))])
        rows = [_row(row) for row in table]
        rows.append("1,1,2.0,3.0,NaN,NaN,NaN,NaN,NaN")
        files.append(_lines(folder / f"image_{k}.csv", [",".join(names), *rows]))
    return files


def matchid_2023(folder: Path, frames: Frames) -> list[Path]:
    files = []
    for k, (x, u) in enumerate(frames):
        table = np.hstack([np.ones((len(x), 2)), _turned(x), _turned(u), np.zeros((len(x), 3))])
        rows = [_row(row, ";", ",") for row in table]
        rows.append("1;1;2,0;3,0;n. def.;n. def.;n. def.;n. def.;0,0;0,0;0,0")
        head = "x_pic;y_pic;x;y;z;u;v;w;exx;eyy;exy"
        files.append(_lines(folder / f"image_{k}.csv", [head, *rows]))
    return files


def dice(folder: Path, frames: Frames) -> list[Path]:
    names = ["SUBSET_ID", "COORDINATE_X", "COORDINATE_Y", "DISPLACEMENT_X", "DISPLACEMENT_Y"]
    names += ["SIGMA", "STATUS_FLAG"]
    names += [f"MODEL_{kind}_{a}" for kind in ("COORDINATES", "DISPLACEMENT") for a in "XYZ"]
    head = ["***", "*** Digital Image Correlation Engine (DICe), Copyright 2014 Sandia Corporation"]
    head += ["***", "*** Reference image: ./ref.tif ", "***", ",".join(names)]
    files = []
    for k, (x, u) in enumerate(frames):
        table = np.hstack([_turned(x), _turned(u)])
        rows = [f"{i},10,20,0.5,0.5,0.004,4,{_row(row)}" for i, row in enumerate(table)]
        rows.insert(4, "7,10,20,0.5,0.5,-1.0,8," + _row([1.0] * 6))
        rows.append("8,10,20,0.5,0.5,0.1,11," + _row([1.0] * 6))
        files.append(_lines(folder / f"DICe_solution_{k}.txt", head + rows))
    return files


def istra4d(folder: Path, frames: Frames) -> list[Path]:
    import h5py

    files = []
    for k, (x, u) in enumerate(frames):
        files.append(folder / f"series_step_{k}.hdf5")
        with h5py.File(files[-1], "w") as file:
            mask = np.append(np.ones(len(x), dtype=bool), False)
            file["coordinates/mask"] = mask.reshape(1, -1)
            for i, axis in enumerate("xyz"):
                place = np.append(x[:, i] + u[:, i], 0.0).reshape(1, -1)
                file[f"coordinates/coordinate_{axis}"] = place
                file[f"displacements/displacement_{axis}"] = np.append(u[:, i], 0.0).reshape(1, -1)
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
    points = np.array([np.vstack([_turned(x + u), lost]) for x, u in rest])
    moved = np.array([np.vstack([_turned(u), lost]) for _, u in rest])
    path = folder / "run.npz"
    fields = {name: moved[:, :, i] for i, name in enumerate("UVW")}
    np.savez_compressed(path, strategy=np.asarray("hybrid"), points3D=points, **fields)
    return [path]


def pyaldic_csv(folder: Path, frames: Frames) -> list[Path]:
    files = []
    for k, (x, u) in enumerate(frames):
        table = np.hstack([np.ones((len(x), 2)), _turned(x + u), _turned(u)])
        table = np.vstack([table, [3.0, 4.0, *[np.nan] * 6]])
        files.append(folder / f"run_frame{k:03d}.csv")
        head = "x_px,y_px,X_mm,Y_mm,Z_mm,U,V,W"
        np.savetxt(files[-1], table, delimiter=",", header=head, comments="")
    return files


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
    content = {"data_dic_save": {"displacements": saved, "dispinfo": about}}
    savemat(folder / "ncorr.mat", content)
    return [folder / "ncorr.mat"]


#: Writers by the name of the format that is to be found, and of the case.
EXPORTS: dict[str, tuple[str, Callable[[Path, Frames], list[Path]]]] = {
    "plain": ("csv", plain), "german": ("csv", german), "davis": ("davis", davis),
    "tecplot": ("tecplot", tecplot), "vic3d": ("vic3d", vic3d),
    "vic3d-mat": ("vic3d-mat", vic3d_mat), "aramis": ("aramis", aramis),
    "matchid 2024": ("matchid", matchid_2024), "matchid 2023": ("matchid", matchid_2023),
    "dice": ("dice", dice), "istra4d": ("istra4d", istra4d), "multidic": ("multidic", multidic),
    "pyaldic": ("pyaldic", pyaldic), "pyaldic csv": ("pyaldic", pyaldic_csv),
}  # fmt: skip
