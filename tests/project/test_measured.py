"""Reading and registration of frames that two cameras export."""

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.readers.frames import QUANTITIES

from ..builders.measured_arrays import project_of
from ..builders.projects import fit_setup, write_two_camera_exports
from ..support.paths import EXAMPLES
from ..support.refusals import raised


def test_exports_of_two_cameras_are_read_and_registered(tmp_path):
    fields = write_two_camera_exports(tmp_path)
    loads = [field.pressure for field in fields]
    tables = bf.read(tmp_path / "vic_*.csv"), bf.read(tmp_path / "davis_*.txt")
    for table in tables:
        assert list(table.columns) == ["frame", *QUANTITIES] and table["frame"].max() == 2
        np.testing.assert_allclose(table, tables[0], atol=1e-6)
    found = bf.register(bf.Bubble.read(tmp_path / "vic_*.csv", loads, radius=100.0))
    same = bf.register(tables[0], None, loads, radius=100.0)
    assert str(found) == str(same) and found.numbers == same.numbers
    centre, _, _ = found.registration.placement.origin
    assert centre == pytest.approx(5.0, abs=0.1)
    assert abs(found.registration.warp_angle) == pytest.approx(20.0, abs=1.0)
    (test,) = fit_setup(project_of(found.bubble)).tests
    for mine, theirs in zip(test.fields, fields, strict=True):
        np.testing.assert_allclose(mine.points, theirs.points, atol=2.0)
    assert bf.register(found.bubble).registration.warp_angle == pytest.approx(0.0, abs=1.0)
    raised(InputError, r"as strips: .* as biaxial: ", bf.read, EXAMPLES / "batch" / "README.md")
