"""experiments/bubble/point_files.py: files of measured points that are not there."""

import shutil

from bubblefit.project.project import read_project

from ...support.paths import EXAMPLES
from ...support.refusals import complaint
from .cases import bubble_of_project

VALMEX = EXAMPLES / "bubble-valmex7318"


def test_missing_data_is_refused_with_advice(tmp_path):
    project = VALMEX / "test1-linear.toml"
    for folder in (None, tmp_path / "nowhere", tmp_path):
        assert "--data DIR" in complaint(read_project, project, folder)
    assert (
        bubble_of_project(read_project(project, need_data=False)).data.files[0].name
        == "test1_00.csv"
    )
    # The folder of the data is relative to the project.
    shutil.copy(project, tmp_path)
    (tmp_path / "data" / "grid").mkdir(parents=True)
    for i in range(20):
        (tmp_path / "data" / "grid" / f"test1_{i:02d}.csv").touch()
    files = bubble_of_project(read_project(tmp_path / project.name)).data.files
    assert all(f.is_file() for f in files) and tmp_path in files[0].parents
