"""solvers/result_files.py: the last increment of a result file as a mesh of meshio."""

from types import SimpleNamespace

import meshio
import numpy as np
import pytest
from bubblefit.solvers.meshio_readers import register_with_meshio
from bubblefit.solvers.result_files import ResultFrame, ResultMesh, last_frame

from ..support.refusals import complaint

#: Types of elements: 7 is a quad in meshio's order, 9 one that is numbered the other way round.
TYPES = {7: ("quad", None), 9: ("quad", (0, 3, 2, 1)), 1: ("line", None)}
NUMBERS = np.array([2, 5, 7, 11, 20])
PLACES = np.arange(15.0).reshape(5, 3)
FRAMES = (
    ResultFrame(0.5, 1, 1, {"displacement": np.zeros((5, 3))}),
    ResultFrame(1.0, 2, 3, {"displacement": np.ones((5, 3))}),
)


def result_file(*elements, frames=FRAMES):
    mesh = ResultMesh(NUMBERS, PLACES, tuple((kind, np.array(nodes)) for kind, nodes in elements))
    return SimpleNamespace(path="job.frd", mesh=mesh, frames=lambda: iter(frames))


def test_nodes_are_found_by_their_numbers_in_the_order_of_meshio():
    mesh = last_frame(result_file((7, [2, 5, 7, 11]), (9, [5, 7, 11, 20]), (1, [2, 20])), TYPES)
    np.testing.assert_array_equal(mesh.points, PLACES)
    quads, lines = mesh.cells
    assert (quads.type, lines.type) == ("quad", "line")
    assert quads.data.tolist() == [[0, 1, 2, 3], [1, 4, 3, 2]]
    assert lines.data.tolist() == [[0, 4]]


def test_data_are_those_of_the_last_frame():
    mesh = last_frame(result_file((7, [2, 5, 7, 11])), TYPES)
    assert (mesh.point_data["displacement"] == 1.0).all()
    fields = {name: value.tolist() for name, value in mesh.field_data.items()}
    assert fields == {"time": [1.0], "step": [2], "increment": [3]}


def test_file_without_frames_has_its_mesh():
    mesh = last_frame(result_file((7, [2, 5, 7, 11]), frames=()), TYPES)
    assert len(mesh.cells) == 1 and mesh.point_data == {}


@pytest.mark.parametrize(
    ("element", "words"),
    [
        ((8, [2, 5, 7, 11]), "of type 8 are not known here"),
        ((7, [2, 5, 7, 12]), "refer to a node that is not there"),
        ((7, [2, 5, 7, 21]), "refer to a node that is not there"),
    ],
)
def test_unknown_elements_and_nodes_are_refused(element, words):
    message = complaint(last_frame, result_file(element), TYPES)
    assert message.startswith("job.frd: elements: ") and words in message


def test_meshio_reads_files_of_a_registered_suffix(tmp_path):
    path = tmp_path / "a.acmeresult"
    path.write_text("2")
    register_with_meshio("acmeresult", lambda p: meshio.Mesh(np.eye(3) * float(open(p).read()), []))
    np.testing.assert_array_equal(meshio.read(path).points, 2 * np.eye(3))
