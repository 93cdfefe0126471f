"""project/sections.py: tests read from sections, with names, defaults and folders; and written."""

import hashlib
import json
import tempfile

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project

from ..builders.measured_arrays import FABRIC, project_of
from ..builders.projects import constant_strips
from ..support.paths import EXAMPLES, KNOWN
from ..support.refusals import complaint, refused


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """The temporary folder of this process, empty."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def test_arrays_are_written_to_no_temporary_file(arrays, temporary):
    how = {"radius": 100.0, "elements": 48, "symmetry": "quarter"}
    bubble = bf.Bubble(**arrays, **how)
    strain = np.linspace(0.0, 0.05, 10)
    strips = bf.Strips({"warp": [(20 * strain, 4e3 * strain)]}, gauge=20.0, increments=5)
    card = bf.MaterialCard(HypoelasticLaw.linear(300.0, 200.0, 10.0), 0.8, "known")
    project = project_of(bubble, strips, cards={"known": card}, starts=1, jobs=1)
    bf.check(project)
    bf.fit(project)
    odd = bubble.with_keys(sheet={"modes": 2})
    refused(project_of, odd)
    refused(project_of, bubble, bubble)
    assert list(temporary.iterdir()) == []


def test_provenance_has_checksum_of_arrays_and_of_their_files(arrays, tmp_path):
    bubble = bf.Bubble(**arrays, radius=100.0, elements=48, symmetry="quarter")
    bf.fit(bubble, bf.Law("constant"), fabric=FABRIC, starts=1, jobs=1, out=tmp_path / "out")
    content = json.loads((tmp_path / "out" / "provenance.json").read_text())
    rows = content["data"]
    assert len(rows) == 20
    for row, displacement in zip(rows, arrays["displacements"], strict=True):
        numbers = arrays["points"].astype("<f8").tobytes() + displacement.astype("<f8").tobytes()
        assert row["sha256"] == hashlib.sha256(numbers).hexdigest()
        assert row["format"] == "arrays" and row["units"]["dz"] == "mm"
        table = pd.read_csv(row["file"])
        np.testing.assert_array_equal(table.to_numpy()[:, 3:], displacement)


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


def test_tests_whose_files_would_have_the_same_names_are_refused(tmp_path):
    strips = constant_strips(tmp_path).read_text()
    assert 'name = "two"' in strips
    path = tmp_path / "alike.toml"
    path.write_text(strips.replace('"two"', '"strip 1"').replace('"one"', '"strip-1"'))
    said = complaint(read_project, path)
    assert "name: files of this test and of " in said and "begin alike, 'strip-1-'" in said
