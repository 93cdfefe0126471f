"""experiments/deck/results.py: readings, and files of Exodus II as programs write them."""

import sys

import meshio
import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.deck.results import (
    DeckReader,
    ExodusFile,
    Probe,
    QuantityReading,
    Results,
    _vectors,
    deck_sets,
    last_digit,
)

from ...support import needs
from ...support.refusals import raised

DECK = """\
*NODE, NSET=ALL
1, 0., 0., 0.
2, 1., 0., 0.
*NSET, NSET=GRIP, GENERATE
3, 9, 3
** a comment
*NSET, NSET=BOTH
GRIP, 20
*ELEMENT, TYPE=C3D8
30, 31
*NODE PRINT, NSET=GRIP
RF
"""
MARC = """\
define              node                set                 edge
         1         5 to 7 c
         9
define              element             set                 all
         4
"""
X, Y = Probe("result", "x"), Probe("result", "y", scale=2.0)


def write(folder, rows):
    (folder / "curve.csv").write_text("x,y\n" + "".join(f"{x},{y}\n" for x, y in rows))


def read(folder, at, y=Y):
    return DeckReader((QuantityReading(X, y, np.array(at)),), "curve.csv").read(folder)


def test_sets_of_a_deck_are_read_by_name(tmp_path):
    (tmp_path / "job.inp").write_text(DECK)
    (tmp_path / "job.dat").write_text(MARC)
    sets = deck_sets(tmp_path)
    assert {*sets.pop("EDGE")} == {1, 5, 6, 7, 9}
    assert sets == {"ALL": [1, 2], "GRIP": [3, 6, 9], "BOTH": [20, 3, 6, 9]}


@pytest.mark.parametrize(
    ("listed", "members"),
    [
        ("1 to 9 by 2", [1, 3, 5, 7, 9]),
        ("1 to 8 except bottom", [5, 6, 7, 8]),
        ("1 to 8 except bottom and 2, 3", [2, 3, 5, 6, 7, 8]),
        ("bottom intersect 3 to 12 c\n and 20", [3, 4, 20]),
    ],
)
def test_lists_of_marc_have_steps_and_exceptions(tmp_path, listed, members):
    sets = f"define node set bottom\n 1 to 4\ndefine node set grip\n {listed}\n"
    (tmp_path / "job.dat").write_text(sets)
    assert deck_sets(tmp_path)["GRIP"] == members


def test_sets_in_several_blocks_and_of_later_sets_are_whole(tmp_path):
    (tmp_path / "a.inp").write_text("*NSET, NSET=BOTH\nLEFT, RIGHT\n")
    blocks = "*NSET, NSET=LEFT\n1, 2\n*NSET, NSET=RIGHT\n3\n*NSET, NSET=LEFT\n4\n"
    nodes = "*NODE, NSET=N1\n1, 0., 0., 0.\n*NODE, NSET=N1\n2, 1., 0., 0.\n"
    (tmp_path / "mesh.inp").write_text(blocks + nodes)
    sets = {"BOTH": [1, 2, 4, 3], "LEFT": [1, 2, 4], "RIGHT": [3], "N1": [1, 2]}
    assert deck_sets(tmp_path) == sets


def test_curve_is_read_where_it_was_measured(tmp_path):
    write(tmp_path, [(0, 0), (1, 3.25), (2, 4)])
    history = read(tmp_path, [1.0, 2.0])
    assert history.load.tolist() == [6.5, 8.0]
    assert history.load_rounding == pytest.approx(np.full(2, 1e-2))
    write(tmp_path, [(0, 0), (-0.5, 1.5), (-1, 3), (-2, 6)])
    assert read(tmp_path, [-0.75]).load.tolist() == [4.5]
    write(tmp_path, [(4, 0), (3, 1.5), (2, 3), (1, 4.5)])
    assert read(tmp_path, [2.5]).load.tolist() == [4.5]


def test_increments_of_a_program_do_not_show_in_a_curve(tmp_path):
    """Straight lines between them are off by more, and otherwise in the next run."""
    at = np.linspace(0.1, 1.4, 12)
    for count in (9, 11):
        x = np.linspace(0.0, 1.5, count)
        write(tmp_path, zip(x, np.round(np.sin(x), 9), strict=True))
        assert read(tmp_path, at).load == pytest.approx(2.0 * np.sin(at), abs=2e-3)
        assert np.abs(2.0 * np.interp(at, x, np.sin(x)) - 2.0 * np.sin(at)).max() > 4e-3


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([(0, 0), (1, 3)], "from 0 to 1, measured: 0.5 to 2 .result x.; is the unit"),
        ([(0, 0), (2, 3), (1, 4)], "result x does not grow steadily"),
        ([(0, 0), (2, "nan")], "no usable results in curve.csv: .*column 'y': expected a number"),
    ],
)
def test_results_that_lack_a_value_are_a_failure(tmp_path, rows, words):
    write(tmp_path, rows)
    raised(SolverFailure, words, read, tmp_path, [0.5, 2.0])


def test_results_that_are_not_there_are_a_failure(tmp_path):
    raised(SolverFailure, "the run wrote no curve.csv", read, tmp_path, [0.5])
    write(tmp_path, [(0, 0), (1, 3)])
    missing = Probe("reaction", "GRIP")
    raised(SolverFailure, "no usable results in curve.csv", read, tmp_path, [0.5], missing)


def test_last_digit_is_that_of_the_largest_value():
    assert last_digit(0.211193, 6) == pytest.approx(1e-6)
    assert last_digit(99.0, 2) == 1.0 and last_digit(0.0, 6) == 0.0


def test_time_series_of_xdmf_has_its_times_and_single_precision(tmp_path):
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    with meshio.xdmf.TimeSeriesWriter(tmp_path / "out.xdmf", data_format="XML") as writer:
        writer.write_points_cells(points, [("triangle", np.array([[0, 1, 2]]))])
        for time in (0.5, 2.0):
            field = np.outer([0.0, 0.0, time], [0.0, 3.0]).astype(np.float32)
            writer.write_data(time, point_data={"u": field})
    reading = QuantityReading(
        Probe("time", scale=10.0), Probe("displacement", (0.1, 0.9, 0.0), 1), np.array([5.0, 12.5])
    )
    history = DeckReader((reading,), "out.xdmf").read(tmp_path)
    assert history.load == pytest.approx([1.5, 3.75])
    assert history.load_rounding == pytest.approx([1e-5, 1e-5])


@pytest.mark.parametrize(
    ("package", "result"), [("netCDF4", "out.e"), ("netCDF4", "out.exo"), ("h5py", "out.xdmf")]
)
def test_missing_package_is_named(tmp_path, monkeypatch, package, result):
    mesh = meshio.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], {"triangle": [[0, 1, 2]]})
    (tmp_path / result).write_text("")
    monkeypatch.chdir(tmp_path)  # where meshio writes the numbers of an .xdmf file
    if package == "h5py":
        with meshio.xdmf.TimeSeriesWriter(tmp_path / result) as writer:
            writer.write_points_cells(mesh.points, mesh.cells)
            writer.write_data(1.0, point_data={"u": np.zeros((3, 3))})
    monkeypatch.setitem(sys.modules, package, None)
    reading = QuantityReading(Probe("time"), Probe("displacement", (0, 0, 0)), np.ones(1))
    words = f"reading {result} needs a package: pip install {package}"
    raised(SolverFailure, words, lambda: DeckReader((reading,), result).read(tmp_path))


netCDF4 = needs.library("netCDF4")

TIMES = np.array([0.0, 0.5, 1.0])
NAMES = ["disp_x", "disp_y", "flux", "reaction_x", "reaction_y"]
#: (steps, variables, nodes): node 3 moves along y, and nodes 1 and 2 hold it.
VALUES = np.zeros((3, 5, 3))
VALUES[:, 1, 2] = 4.0 * TIMES
VALUES[:, 4, :2] = -3.0 * TIMES[:, None]


def characters(dataset, key, names):
    table = dataset.createVariable(key, "S1", (f"num_{key}", "len_name"))
    table[:] = np.array([list(name.ljust(32, "\0")) for name in names], "S1")


def exodus(path, layout, precision="f8", file_format="NETCDF4"):
    """Write the file as MOOSE does ("separate": a variable each) or as old programs did."""
    with netCDF4.Dataset(path, "w", format=file_format) as dataset:
        sizes = {"time_step": None, "num_nodes": 3, "num_dim": 2, "len_name": 32}
        sizes |= {"num_name_nod_var": 5, "num_ns_names": 1, "num_nod_ns1": 2}
        for name, size in sizes.items():
            dataset.createDimension(name, size)
        places = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        characters(dataset, "name_nod_var", NAMES)
        characters(dataset, "ns_names", ["fixed"])
        dataset.createVariable("node_ns1", "i4", ("num_nod_ns1",))[:] = [1, 2]
        dataset.createVariable("time_whole", "f8", ("time_step",))[:] = TIMES
        if layout == "separate":
            for axis, values in zip("xy", places, strict=True):
                dataset.createVariable(f"coord{axis}", "f8", ("num_nodes",))[:] = values
            for k in range(5):
                shape = ("time_step", "num_nodes")
                values = dataset.createVariable(f"vals_nod_var{k + 1}", precision, shape)
                values[:] = VALUES[:, k]
        else:
            dataset.createVariable("coord", "f8", ("num_dim", "num_nodes"))[:] = places
            shape = ("time_step", "num_name_nod_var", "num_nodes")
            dataset.createVariable("vals_nod_var", precision, shape)[:] = VALUES


@pytest.mark.parametrize("layout", ["separate", "together"])
@pytest.mark.parametrize("file_format", ["NETCDF4", "NETCDF3_64BIT_OFFSET"])
def test_all_steps_vectors_and_sets_are_read(tmp_path, layout, file_format):
    exodus(tmp_path / "out.e", layout, file_format=file_format)
    file = ExodusFile(tmp_path / "out.e")
    assert file.mesh.points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert {name: nodes.tolist() for name, nodes in file.sets.items()} == {"FIXED": [1, 2]}
    frames = list(file.frames())
    assert [frame.time for frame in frames] == TIMES.tolist()
    assert sorted(frames[-1].fields) == ["disp", "flux", "reaction"]
    assert frames[-1].fields["disp"].tolist() == [[0, 0], [0, 0], [0, 4]]


def test_components_of_a_vector_keep_their_axes():
    scalars = {f"react_{axis}": np.full((2, 3), k) for axis, k in (("z", 3.0), ("y", 2.0))}
    react = _vectors(scalars)["react"]
    assert np.isnan(react[..., 0]).all()
    assert (react[..., 1] == 2.0).all() and (react[..., 2] == 3.0).all()
    assert _vectors({"react_y": np.ones((2, 3), np.float32)})["react"].dtype == np.float32
    assert _vectors({"flux": np.ones((2, 3))})["flux"].shape == (2, 3, 1)


def test_component_that_results_do_not_hold_is_named(tmp_path):
    exodus(tmp_path / "out.e", "separate")
    for probe in (Probe("displacement", "fixed", 2), Probe("reaction", (0, 0, 0), 2)):
        reading = QuantityReading(Probe("time"), probe, np.ones(1))
        words = f"the results hold no {probe.quantity} along z"
        raised(SolverFailure, words, DeckReader((reading,), "out.e").read, tmp_path)


def test_printed_results_have_no_places_of_nodes(tmp_path):
    (tmp_path / "job.inp").write_text("*NSET, NSET=SIDE\n3\n")
    (tmp_path / "job.dat").write_text(
        " displacements (vx,vy,vz) for set ALL and time  0.1000000E+01\n\n"
        "         1  0.000000E+00  0.000000E+00  0.000000E+00\n"
        "         2  5.000000E+00  0.000000E+00  0.000000E+00\n"
    )
    for place, words in (
        ((10.0, 0.0, 0.0), "job.dat does not say where nodes are: name a node set"),
        ("side", "job.dat holds no node of the set 'side'"),
        ("top", "there is no node set 'top'; there are: SIDE"),
    ):
        raised(SolverFailure, words, Results(tmp_path, "job.dat").nodes, place)


@pytest.mark.parametrize(("precision", "digit"), [("f8", 1e-14), ("f4", 1e-5)])
def test_curve_of_a_deck_goes_through_all_steps(tmp_path, precision, digit):
    exodus(tmp_path / "out.exo", "separate", precision)
    travel = Probe("displacement", (0.0, 1.0, 0.0), 1)
    force = Probe("reaction", "fixed", 1, scale=-1.0)
    reading = QuantityReading(travel, force, np.array([1.0, 3.0]))
    history = DeckReader((reading,), "out.exo").read(tmp_path)
    assert history.load == pytest.approx([1.5, 4.5])
    assert history.load_rounding == pytest.approx([2 * digit, 2 * digit])
