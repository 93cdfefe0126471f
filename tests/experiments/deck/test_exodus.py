"""experiments/deck/exodus.py: files of Exodus II in the layouts that programs write."""

import numpy as np
import pytest
from bubblefit.experiments.deck.exodus import ExodusFile
from bubblefit.experiments.deck.results import DeckReader, Probe, QuantityReading

from ...support import needs

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


@pytest.mark.parametrize(("precision", "digit"), [("f8", 1e-14), ("f4", 1e-5)])
def test_curve_of_a_deck_goes_through_all_steps(tmp_path, precision, digit):
    exodus(tmp_path / "out.exo", "separate", precision)
    travel = Probe("displacement", (0.0, 1.0, 0.0), 1)
    force = Probe("reaction", "fixed", 1, scale=-1.0)
    reading = QuantityReading(travel, force, np.array([1.0, 3.0]))
    history = DeckReader((reading,), "out.exo").read(tmp_path)
    assert history.load == pytest.approx([1.5, 4.5])
    assert history.load_rounding == pytest.approx([2 * digit, 2 * digit])
