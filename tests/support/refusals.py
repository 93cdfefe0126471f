"""What a call refuses: bad input in one line that names the file and the field."""

import pytest
from bubblefit.errors import InputError


def refused(call, *arguments, **options):
    """Return the InputError of a call, which has to raise one that is one line."""
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    assert "\n" not in str(caught.value)
    return caught.value


def complaint(call, *arguments, **options):
    """Return the message of the InputError that a call has to raise."""
    return str(refused(call, *arguments, **options))


def complaint_with(words, call, *arguments, **options):
    message = complaint(call, *arguments, **options)
    for word in words:
        assert word in message, message
    return message


def raised(error, match, call, *arguments, **options):
    """Return the error of that kind, with words that match, which a call has to raise."""
    with pytest.raises(error, match=match or None) as caught:
        call(*arguments, **options)
    return caught.value
