"""What the tests of strips share."""

from collections.abc import Iterator

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(autouse=True, scope="module")
def one_thread() -> Iterator[None]:
    """As in a study: BLAS threads on so small a band cost more than they bring."""
    with threadpool_limits(1):
        yield
