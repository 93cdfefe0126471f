"""What reading data does not import before it is needed."""

from __future__ import annotations

import subprocess
import sys

import pytest


def test_the_library_loads_without_pandas_and_scipy_spatial():
    code = (
        "import sys, bubblefit.experiments.strips.gauge, bubblefit.experiments.strips.polynomials;"
        "assert not {'pandas', 'scipy.spatial'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_readers_are_where_the_package_says():
    from bubblefit import readers as data

    for name in data.__all__:
        assert callable(getattr(data, name)), name
    with pytest.raises(AttributeError, match="no attribute 'read_everything'"):
        _ = data.read_everything
