"""Writing of projects: data in memory goes to files of results only, with a checksum."""

import hashlib
import json
import tempfile

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.law import HypoelasticLaw

from ..builders.measured_arrays import FABRIC, project_of
from ..support.refusals import refused


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
