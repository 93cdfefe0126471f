"""Results of a deck: tables, and values at nodes in the files of any finite element program.

A reading is what was measured: a quantity over another one, or fields of displacement. It knows
where something was measured, not what: runs are cached by readings.

Files of Exodus II, as MOOSE, Sierra and SfePy write them, are read here, as meshio reads the first
time step of such a file alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...readers.frames import frame_files
from ...readers.tables import read_table
from ...solvers.base import Array, History
from ...solvers.calculix.frd import FrdFile, PrintedFile
from ...solvers.calculix.library import MATERIAL, STATE_VARIABLES
from ...solvers.decks import JOB
from ...solvers.marc.t19 import T19File
from ...solvers.result_files import ResultFrame, ResultMesh

#: Names that programs give to the quantities of nodes.
FIELDS = {"displacement": "^disp|^u$", "reaction": "^reac|^forc|^rf$"}
#: Digits of numbers in result files, as text and as double precision.
TEXT_DIGITS = 6
DOUBLE_DIGITS = 15
#: How far a measured value may lie beyond the last result, as a share of the results' range.
BEYOND_END = 1e-6
#: State variables in .frd; of our material the first three are log strains eps1, eps2, gamma12.
STATE = "SDV"
#: How far a measured point may lie from the nodes of its set, as a share of the set's size.
BEYOND_SET = 0.1
_ABAQUS_SET = re.compile(r"\*(?:NSET|NODE) *,.*NSET *= *\"?([^,\s\"]+)", re.IGNORECASE)
_MARC_SET = re.compile(
    r"^define +node +set +(\S+)\n((?:.* c *\n)*.*)", re.IGNORECASE | re.MULTILINE
)


class MeshioFile:
    """Results that meshio reads: frames of a time series (XDMF), or a file for each frame.

    Frames of files have the times 1, 2, ...; node sets have the numbers of nodes from 1.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        import meshio

        self.sets: dict[str, Any] = {}
        self._frames: list[ResultFrame] = []
        if paths[0].suffix in (".xdmf", ".xmf"):
            with meshio.xdmf.TimeSeriesReader(paths[0]) as series:
                points, _ = series.read_points_cells()
                for number in range(series.num_steps):
                    time, fields, _ = series.read_data(number)
                    self._frames.append(ResultFrame(time, fields=fields))
        else:
            # `meshio.read` prints and ends the process at a file that it cannot read.
            file_type = meshio.extension_to_filetypes[paths[0].suffix][0]
            for number, path in enumerate(paths, start=1):
                mesh = getattr(meshio, file_type).read(path)
                points = mesh.points
                self.sets = {name.upper(): nodes + 1 for name, nodes in mesh.point_sets.items()}
                self._frames.append(ResultFrame(number, fields=mesh.point_data))
        self.mesh = ResultMesh.of_points(points)

    def frames(self) -> Iterator[ResultFrame]:
        """Yield the results of every frame."""
        return iter(self._frames)


@dataclass(eq=False)
class Results:
    """The results in the folder of a run.

    Attributes
    ----------
    folder : Path
    name : str
        File of the results, or pattern of files with a frame each.
    """

    folder: Path
    name: str

    @cached_property
    def paths(self) -> list[Path]:
        """Return the files; SolverFailure where the run did not write them."""
        paths, _ = frame_files([self.name], "result", self.folder)
        if not paths[0].is_file():
            raise SolverFailure(f"the run wrote no {self.name}")
        return paths

    @cached_property
    def file(self) -> Any:
        """Return the file of values at nodes, with `mesh` and `frames`."""
        readers = {".frd": FrdFile, ".dat": PrintedFile, ".t19": T19File}
        readers |= dict.fromkeys((".e", ".ex2", ".exo"), ExodusFile)
        reader = readers.get(self.paths[0].suffix)
        return reader(self.paths[0]) if reader else MeshioFile(self.paths)

    @cached_property
    def times(self) -> Array:
        """Return the times (frames,) of the results, and 0 before them."""
        return np.array([0.0, *(frame.time for frame in self._frames)])

    @cached_property
    def _frames(self) -> list[ResultFrame]:
        return list(self.file.frames())

    @property
    def points(self) -> Array:
        """Return the places (nodes, 3) of the nodes at rest, mm."""
        return np.asarray(self.file.mesh.points)

    def field(self, quantity: str, nodes: NDArray[np.intp]) -> tuple[Array, float]:
        """Return values (1 + frames, k, c), zero at first, and the size of the last digit.

        Parameters
        ----------
        quantity : str
            One of `FIELDS`, with c components.
        nodes : (k,) array of int
            Rows of the nodes.
        """
        rows = []
        is_binary = isinstance(self.file, MeshioFile | ExodusFile)
        digits = DOUBLE_DIGITS if is_binary else TEXT_DIGITS
        for frame in self._frames:
            names = [name for name in frame.fields if re.search(FIELDS[quantity], name, re.I)]
            if not names or not np.isfinite(frame.fields[names[0]][nodes]).all(axis=0).any():
                fields = ", ".join(frame.fields) or "none"
                problem = f"the results hold no {quantity} at these nodes, but the fields: {fields}"
                raise SolverFailure(f"{problem}; CalculiX writes it for *NODE FILE with U, RF")
            rows.append(frame.fields[names[0]][nodes])
            if rows[-1].dtype == np.float32:
                digits = TEXT_DIGITS
        values = np.array([np.zeros_like(rows[0]), *rows])
        return values, last_digit(float(np.nanmax(np.abs(values))), digits)

    def nodes(self, place: str | tuple[float, ...]) -> NDArray[np.intp]:
        """Return the rows (k,) of a set's nodes, or of that nearest to a place; SolverFailure."""
        mesh = self.file.mesh
        if not isinstance(place, str):
            if not np.isfinite(mesh.points).all():
                problem = f"{self.name} does not say where nodes are: name a node set"
                raise SolverFailure(f"{problem}, or take the results of a .frd file")
            return np.array([np.linalg.norm(mesh.points - np.array(place), axis=1).argmin()])
        nodes = np.flatnonzero(np.isin(mesh.numbers, self.sets.get(place.upper(), [])))
        if not len(nodes) and self.sets.get(place.upper()):
            problem = f"{self.name} holds no node of the set {place!r}"
            raise SolverFailure(f"{problem}: let the deck write results of them")
        if not len(nodes):
            names = ", ".join(self.sets) or "none"
            raise SolverFailure(f"there is no node set {place!r}; there are: {names}")
        return nodes

    @cached_property
    def sets(self) -> Mapping[str, Any]:
        """Return the numbers of the nodes of every set, by its name in capitals."""
        return {**deck_sets(self.folder), **getattr(self.file, "sets", {})}

    def strains(self) -> tuple[Array, Array]:
        """Return the extremes (3,) of our material's log strains, zeros where none are written."""
        none = np.zeros((1, 3))
        strains = [none]
        deck = self.folder / f"{JOB}.inp"
        if deck.is_file() and MATERIAL in deck.read_text(encoding="latin-1"):
            states = [frame.fields.get(STATE, none) for frame in self._frames]
            strains += [state[:, :3] for state in states if state.shape[1] <= STATE_VARIABLES]
        table = np.vstack(strains)
        return np.nanmin(table, axis=0), np.nanmax(table, axis=0)


def deck_sets(folder: Path) -> dict[str, list[int]]:
    """Return the nodes of every set in decks of CalculiX, Abaqus and Marc, by name in capitals."""
    texts = [
        re.sub(r"^\*\*.*\n", "", path.read_text(encoding="latin-1"), flags=re.MULTILINE)
        for path in sorted([*folder.glob("*.in[cp]"), *folder.glob("*.dat")])
    ]
    # Sets of sets may stand before the sets in them: these are known from the first pass.
    return _sets_of(texts, _sets_of(texts, {}))


def _sets_of(texts: Sequence[str], known: Mapping[str, list[int]]) -> dict[str, list[int]]:
    """Return the nodes of every set; a set that is defined in several blocks has those of all."""
    sets: dict[str, list[int]] = {}
    for text in texts:
        for block in text.split("\n*"):
            head, *lines = f"*{block.lstrip('*')}".splitlines()
            name = _ABAQUS_SET.match(head)
            if name:
                members = _members(head.upper(), lines, {**known, **sets})
                sets.setdefault(name[1].upper(), []).extend(members)
        for marc_name, listed in _MARC_SET.findall(text):
            sets[marc_name.upper()] = _marc_members(listed.upper(), {**known, **sets})
    return sets


def _members(head: str, lines: Sequence[str], sets: Mapping[str, Any]) -> list[int]:
    """Return the nodes of a set: a list with sets in it, ranges, or the first numbers of nodes."""
    members: list[int] = []
    for line in lines:
        words = line.replace(",", " ").upper().split()
        numbers = [int(word) for word in words if word.isdigit()]
        if head.startswith("*NODE"):
            numbers = numbers[:1]
        elif "GENERATE" in head:
            numbers = [*range(numbers[0], numbers[1] + 1, *numbers[2:3])]
        members += numbers
        members += [node for word in words for node in sets.get(word, [])]
    return members


def _marc_members(listed: str, sets: Mapping[str, list[int]]) -> list[int]:
    """Return the nodes of a list of Marc in capitals: "1 TO 9 BY 2 AND EDGE EXCEPT 5"."""
    members: set[int] = set()
    combine = {"AND": members.update, "EXCEPT": members.difference_update}
    combine["INTERSECT"] = members.intersection_update
    operation, *parts = re.split(r"\b(AND|EXCEPT|INTERSECT)\b", f"AND {listed}")[1:]
    for part in parts:
        if part in combine:
            operation = part
            continue
        ranges = re.findall(r"(\d+)\s+TO\s+(\d+)(?:\s+BY\s+(\d+))?", part)
        nodes = [
            node
            for first, last, step in ranges
            for node in range(int(first), int(last) + 1, int(step or 1))
        ]
        single = re.sub(r"\d+\s+TO\s+\d+(\s+BY\s+\d+)?", " ", part).replace(",", " ").split()
        nodes += [int(word) for word in single if word.isdigit()]
        nodes += [node for word in single for node in sets.get(word, [])]
        combine[operation](nodes)
    return sorted(members)


class NodalResults(Protocol):
    """Give readings what they need of results, of a program or of a model of ours in its place.

    `Results` says what the members return.
    """

    @property
    def times(self) -> Array: ...

    @property
    def points(self) -> Array: ...

    def nodes(self, place: str | tuple[float, ...]) -> NDArray[np.intp]: ...

    def field(self, quantity: str, nodes: NDArray[np.intp]) -> tuple[Array, float]: ...


@dataclass(frozen=True)
class Probe:
    """A number of a deck's results over time.

    Attributes
    ----------
    quantity : str
        "displacement" (the mean of a set), "reaction" (its sum), "time", or "result" (a column).
    place : str or tuple of 3 floats
        Node set, place (mm) whose nearest node is taken, or name of the column.
    component : int
        Axis of a displacement or a reaction, from 0.
    scale : float
        Factor of the number, as 4 of the force on a quarter model.
    """

    quantity: str
    place: str | tuple[float, ...] = ""
    component: int = 0
    scale: float = 1.0

    def series(self, results: NodalResults) -> tuple[Array, Array, float]:
        """Return times and numbers (1 + frames,), zero first, and the size of the last digit."""
        if self.quantity == "time":
            return results.times, self.scale * results.times, 0.0
        if isinstance(results, Results) and self.quantity == "result":
            return self._column(results)
        nodes = results.nodes(self.place)
        field, digit = results.field(self.quantity, nodes)
        values = _along(self.component, field, self.quantity)
        if self.quantity == "displacement":
            return results.times, self.scale * values.mean(axis=1), abs(self.scale) * digit
        # Equal forces of a set err alike.
        digit *= abs(self.scale) * len(nodes)
        return results.times, self.scale * values.sum(axis=1), digit

    def _column(self, results: Results) -> tuple[Array, Array, float]:
        """Return the index of each row in place of a time, the values of a column, and a digit.

        The arrays are (rows,); the digit is the size of the last one that is written. Two columns
        of a table are paired by row.
        """
        table = read_table(results.paths[0])
        values = self.scale * table.numbers(str(self.place))
        cells = table.text(str(self.place))
        digits = max(len(re.sub(r"[eE].*|\D|^[-0.]+", "", cell)) for cell in cells)
        rounding = last_digit(float(np.abs(values).max()), min(digits, DOUBLE_DIGITS))
        return np.arange(len(values), dtype=float), values, rounding


@dataclass(frozen=True, eq=False)
class QuantityReading:
    """A quantity over another one, at measured values (n,) of that."""

    x: Probe
    y: Probe
    at: Array

    @property
    def blocks(self) -> tuple[Array, ...]:
        """Return the positions (n, d) of the values, in blocks whose neighbours may err alike."""
        return (self.at[:, None],)

    @property
    def columns(self) -> Mapping[str, Array]:
        """Return columns (values,) that say where each value was measured."""
        return {"x": self.at}

    def values(self, results: NodalResults) -> tuple[Array, float]:
        """Return the values (n,) and the size of their last digit; SolverFailure if one lacks."""
        times, y, rounding = self.y.series(results)
        x_times, x, _ = self.x.series(results)
        x = np.interp(times, x_times, x)
        rise = np.sign(x[-1] - x[0])
        if not rise or (np.diff(rise * x) < 0).any():
            raise SolverFailure(f"{self.x.quantity} {self.x.place} does not grow steadily")
        _check_span(x, self.at, f"{self.x.quantity} {self.x.place}")
        positions = np.clip(rise * self.at, *sorted(rise * x[[0, -1]]))
        return _smooth(rise * x, y)(positions), rounding


@dataclass(frozen=True, eq=False)
class FieldReading:
    """Displacements along axes at points of a surface, sampled between the nodes of a set.

    Attributes
    ----------
    place : str
        Node set; nodes are joined to triangles in the plane in which the set is widest.
    frames : tuple of (time, axis, points)
        Time of the analysis, axis from 0, and points (n, 3), mm, at rest.
    """

    place: str
    frames: tuple[tuple[float, int, Array], ...]

    @property
    def blocks(self) -> tuple[Array, ...]:
        """Return the measured positions (n, 3) mm of each block."""
        return tuple(points for _, _, points in self.frames)

    @property
    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Return time, axis ("x", "y" or "z") and x, y, z (mm) of every value (n,), by name."""
        places = zip("xyz", np.concatenate(self.blocks).T, strict=True)
        counts = [len(points) for points in self.blocks]
        times, axes, _ = zip(*self.frames, strict=True)
        axis = np.repeat(np.array([*"xyz"])[list(axes)], counts)
        return {"time": np.repeat(times, counts), "axis": axis, **dict(places)}

    def values(self, results: NodalResults) -> tuple[Array, float]:
        """Return the displacements (mm) at all measured positions and times, and their rounding.

        Displacements of the nodes are interpolated in the plane that fits the set best.

        Raises
        ------
        SolverFailure
            Measured points lie too far off the set.
        """
        nodes = results.nodes(self.place)
        field, rounding = results.field("displacement", nodes)
        _check_span(results.times, np.array([time for time, _, _ in self.frames]), "time")
        nodal = {
            axis: _smooth(results.times, _along(axis, field, "displacement"))
            for axis in {axis for _, axis, _ in self.frames}
        }
        places = results.points[nodes]
        centre = places.mean(axis=0)
        axes = np.linalg.svd(places - centre, full_matrices=False)[2][:2]
        flat = (places - centre) @ axes.T
        triangles = scipy.spatial.Delaunay(flat)
        nearest = scipy.spatial.cKDTree(flat)
        room = BEYOND_SET * np.ptp(flat, axis=0).max()
        parts = []
        for time, axis, points in self.frames:
            position = (points - centre) @ axes.T
            distance, node = nearest.query(position)
            if distance.max() > room:
                problem = f"measured points lie up to {distance.max():.3g} mm off the set"
                raise SolverFailure(f"{problem} {self.place!r}: are both in the axes of the deck?")
            values = nodal[axis](time)
            sampled = scipy.interpolate.LinearNDInterpolator(triangles, values)(position)
            parts.append(np.where(np.isnan(sampled), values[node], sampled))
        return np.concatenate(parts), rounding


#: What of a deck's results is compared.
Reading: TypeAlias = QuantityReading | FieldReading


def _along(axis: int, field: Array, quantity: str) -> Array:
    """Return a component (1 + frames, k) of a field (1 + frames, k, c); SolverFailure without it.

    Components that the results do not hold are no numbers.
    """
    if axis >= field.shape[2] or not np.isfinite(field[:, :, axis]).all():
        raise SolverFailure(f"the results hold no {quantity} along {'xyz'[axis]} at these nodes")
    return field[:, :, axis]


def _check_span(results: Array, measured: Array, quantity: str) -> None:
    """Raise SolverFailure where measured values (n,) lie beyond those (frames,) of the results."""
    room = BEYOND_END * np.ptp(results)
    low = measured.min()
    high = measured.max()
    if high > results.max() + room or low < results.min() - room:
        span = f"{results[0]:.6g} to {results[-1]:.6g}"
        problem = f"the results go from {span}, measured: {low:.6g} to {high:.6g} ({quantity})"
        raise SolverFailure(f"{problem}; is the unit right, and does the analysis go as far?")


@dataclass(frozen=True, eq=False)
class DeckReader:
    """Reads all that is compared of a deck's results, one reading after the other.

    Attributes
    ----------
    result : str
        Name of the file, or pattern of the files, that the program writes.
    """

    readings: tuple[Reading, ...]
    result: str = ""

    @property
    def rows(self) -> list[slice]:
        """Return the place of the values of each reading among all."""
        counts = [sum(map(len, reading.blocks)) for reading in self.readings]
        ends = np.cumsum([0, *counts]).tolist()
        return [slice(*ends[k : k + 2]) for k in range(len(self.readings))]

    def read(self, folder: Path) -> History:
        """Return the values as loads, with the size of their last digits; SolverFailure."""
        results = Results(folder, self.result)
        try:
            parts = [reading.values(results) for reading in self.readings]
            lowest, highest = results.strains()
        except SolverFailure:
            raise
        except ModuleNotFoundError as error:  # meshio needs packages for some formats
            problem = f"reading {self.result} needs a package: pip install {error.name}"
            raise SolverFailure(problem) from None
        except Exception as error:  # whatever a reader says of another program's file
            problem = f"no usable results in {self.result}: {error or type(error).__name__}"
            raise SolverFailure(problem) from None
        load = np.concatenate([values for values, _ in parts])
        rounding = np.concatenate([np.full(len(values), digit) for values, digit in parts])
        return History(load, np.zeros((1, 1, 3)), lowest, highest, load_rounding=rounding)


def _smooth(positions: Array, values: Array) -> scipy.interpolate.PchipInterpolator:
    """Return a smooth curve through values (n, ...) at positions (n,) that do not fall.

    Straight lines would be off by what changes with the increments from run to run.
    """
    rising, rows = np.unique(positions, return_index=True)
    return scipy.interpolate.PchipInterpolator(rising, values[rows])


def last_digit(largest: float, digits: int) -> float:
    """Return the size of the last of so many digits of the largest value."""
    return float(10.0 ** (np.floor(np.log10(largest)) + 1 - digits)) if largest > 0 else 0.0


#: A component of a vector: "disp_x", "DISPLX".
_COMPONENT = re.compile(r"(.+?)_?([xyz])", re.IGNORECASE)


class ExodusFile:
    """The results of an Exodus file: places of the nodes, node sets, and all time steps.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    mesh : ResultMesh
        Nodes, numbered from 1, without elements.
    sets : dict of str to array of int
        Numbers of the nodes of every named set, by its name in capitals.

    Raises
    ------
    ModuleNotFoundError
        netCDF4 is not installed.
    """

    def __init__(self, path: Path) -> None:
        import netCDF4

        with netCDF4.Dataset(path) as dataset:
            dataset.set_auto_mask(False)
            variables = dataset.variables
            self.mesh = ResultMesh.of_points(_places(variables))
            set_names = _names(variables, "ns_names")
            self.sets = {
                name.upper(): variables[f"node_ns{number}"][:]
                for number, name in enumerate(set_names, start=1)
                if f"node_ns{number}" in variables
            }
            self._times = variables["time_whole"][:]
            self._fields = _vectors(_nodal_variables(variables))

    def frames(self) -> Iterator[ResultFrame]:
        """Yield the results of every time step."""
        for step, time in enumerate(self._times):
            fields = {name: values[step] for name, values in self._fields.items()}
            yield ResultFrame(float(time), fields=fields)


def _places(variables: Any) -> np.ndarray:
    """Return the places (nodes, axes) of the nodes along the axes that the file has."""
    if "coord" in variables:
        return np.transpose(variables["coord"][:])
    keys = [key for key in ("coordx", "coordy", "coordz") if key in variables]
    return np.column_stack([variables[key][:] for key in keys])


def _names(variables: Any, key: str) -> list[str]:
    """Return the names in a table of characters (names, length), none where there is no table."""
    if key not in variables:
        return []
    return [b"".join(row).split(b"\0")[0].decode().strip() for row in variables[key][:]]


def _nodal_variables(variables: Any) -> dict[str, np.ndarray]:
    """Return the values (steps, nodes) of every nodal variable: an array each, or one for all."""
    names = _names(variables, "name_nod_var")
    if "vals_nod_var" in variables:
        return dict(zip(names, np.moveaxis(variables["vals_nod_var"][:], 1, 0), strict=True))
    return {name: variables[f"vals_nod_var{k}"][:] for k, name in enumerate(names, start=1)}


def _vectors(scalars: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the fields (steps, nodes, c): components of a vector are one field.

    A component that is missing is no number.
    """
    components: dict[str, dict[int, str]] = {}
    for name in scalars:
        component = _COMPONENT.fullmatch(name)
        stem, axis = (component[1], "xyz".index(component[2].lower())) if component else (name, 0)
        components.setdefault(stem, {})[axis] = name
    fields = {}
    for stem, names in components.items():
        (first, *others) = names.values()
        if not others and not first.startswith(f"{stem}_"):
            fields[first] = scalars[first][..., None]
            continue
        values = scalars[first]
        fields[stem] = np.full((*values.shape, max(names) + 1), np.nan, values.dtype)
        for axis, name in names.items():
            fields[stem][..., axis] = scalars[name]
    return fields
