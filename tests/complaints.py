"""Bad input, for the tests: one line that names the file and the field."""

import pytest
from bubblefit.errors import InputError


def complaint(call, *arguments, **options):
    """What `call` complains of; it has to, in one line."""
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def complaint_with(words, call, *arguments, **options):
    """The same; it has to have every one of the words."""
    message = complaint(call, *arguments, **options)
    for word in words:
        assert word in message, message
    return message
