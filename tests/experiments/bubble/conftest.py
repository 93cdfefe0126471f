"""Fixtures of the tests of bubbles."""

import re

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.bubble import KIND
from bubblefit.runs.law_setup import law_of
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.spatial.transform import Rotation

from ...builders.bubbles import DOUBTED_LAW, inflated_bubble
from ...builders.projects import known_bubble, known_bubble_in_camera_frames
from .cases import CAMERA


@pytest.fixture(scope="module")
def clean_bubble():
    return inflated_bubble(DOUBTED_LAW)


@pytest.fixture(scope="module")
def computed_bubble(tmp_path_factory):
    path = known_bubble(tmp_path_factory.mktemp("computed"), ("elements = 48", "elements = 108"))
    text = path.read_text().replace('symmetry = "quarter"', 'symmetry = "full"')
    path.write_text(text)
    project = bf.read_project(path)
    test = project.tests["bubble"]
    fields = KIND.prepare(test, law_of(project, [test.reach]), MembraneSolver).fields
    points = np.column_stack([fields[0].points, np.zeros(len(fields[0].points))])
    return text, [(points, field.displacement) for field in fields]


#: Warp turned by 12 degrees, the sheet tilted by 3, 600 mm away and 5 mm off the middle.
TURN = Rotation.from_euler("zx", [12.0, 3.0], degrees=True).as_matrix()
SHIFT = np.array([3.0, -4.0, 600.0])
#: kPa.
SHOWN = [22, 59, 97, 132, 186, 251, 300]
LAST = 'length_unit = "mm"\n'
LOG = "[bubble.data.points.pressure.log]\nfile = 'valve.csv'\nrate = 0.5\noffset = 5\n"
REGISTRATION = "[bubble.data.points.registration]\n"


@pytest.fixture(scope="module")
def camera_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("registered")
    text, known = known_bubble_in_camera_frames(
        folder, lambda x, u: (x @ TURN.T + SHIFT, u @ TURN.T)
    )
    log = np.column_stack([5.0 + 2.0 * np.arange(len(SHOWN)), SHOWN])
    np.savetxt(folder / "valve.csv", log, "%g", ",", header="time (s),p (kPa)", comments="")
    text = re.sub("files = .*", 'files = ["frame_*.csv"]', text)
    # The data are those of the fit's own mesh.
    text = text.replace("[fit]\n", '[fit]\nmesh_error = "told"\n')
    return folder, text.replace(LAST, LAST + LOG + CAMERA + REGISTRATION), known
