"""Reading of a project's tests: names, defaults, data folders, fits without data."""

import bubblefit as bf
import pytest
from bubblefit.project.project import read_project

from ..builders.measured_arrays import FABRIC
from ..support.paths import EXAMPLES, KNOWN
from ..support.refusals import complaint, refused


@pytest.mark.parametrize(
    ("test", "argument"),
    [
        (bf.Bubble(radius=100.0, pressures=[0.02, 0.05]), "points"),
        (bf.Strips(warp={"gauge_length": 20.0, "final_length": 22.0}), "curves"),
    ],
)
def test_fit_without_data_is_refused(test, argument):
    error = refused(bf.fit, test, bf.Law("constant"), fabric=FABRIC)
    assert (error.path, error.field) == (test.kind, argument)
    assert "simulated, not fitted" in error.problem


def test_data_folders_are_given_by_test(tmp_path):
    grid = tmp_path / "somewhere" / "grid"
    grid.mkdir(parents=True)
    for i in range(20):
        (grid / f"test1_{i:02d}.csv").touch()
    source = EXAMPLES / "bubble-valmex7318" / "test1-cubic.toml"
    project = read_project(source, {"bubble": tmp_path / "somewhere"})
    assert project.tests["bubble"].data.files[0] == grid / "test1_00.csv"
    assert "'bubbel'" in complaint(read_project, source, {"bubbel": tmp_path})
    for folder in (tmp_path, {"bubble": tmp_path}):  # computed data read none
        said = complaint(read_project, KNOWN, folder)
        assert "known_solution" in said and "--data" in said
