"""Bad input, for the tests: one line that names the file and the field."""

from __future__ import annotations

from collections.abc import Iterable

import pytest
from bubblefit.errors import InputError


def complaint(call, *arguments, **options) -> str:
    """What `call` complains of; it has to, in one line."""
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def complaint_with(words: Iterable[str], call, *arguments, **options) -> str:
    """The same; it has to have every one of the words."""
    message = complaint(call, *arguments, **options)
    for word in words:
        assert word in message, message
    return message
