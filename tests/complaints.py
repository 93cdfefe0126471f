"""Bad input, for the tests: one line that names the file and the field."""

from __future__ import annotations

import pytest
from bubblefit.errors import InputError


def complaint(call, *arguments, **options) -> str:
    """What `call` complains of; it has to, in one line."""
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)
