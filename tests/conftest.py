"""What several test files share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from bubblefit.errors import BubblefitError
from bubblefit.solvers.calculix.executable import Executable, find_ccx


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of measured data beside the repository; tests that need it skip without."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no measured data: {folder} is not there")
    return folder


@pytest.fixture(scope="session")
def ccx() -> Executable:
    """A ccx that can load material libraries; without one tests skip, except in CI."""
    try:
        return find_ccx()
    except BubblefitError as error:
        if os.environ.get("CI"):
            pytest.fail(f"CI needs CalculiX: {error}")
        pytest.skip(str(error))
