"""What the tests of this room share."""

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    """As in a study: BLAS threads on so small a band cost more than they bring."""
    with threadpool_limits(1):
        yield
