"""`format =` in the data of a test."""

from __future__ import annotations

from pathlib import Path

import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.keys import named_format
from bubblefit.experiments.kinds import Fabric, Place

PLACE = Place(Path("fabric.toml"), "bubble[0]", Fabric("Valmex", 0.8))


def test_a_format_is_checked_where_it_is_named():
    assert named_format(PLACE, "data.points.format", "frame", None) is None
    assert named_format(PLACE, "data.points.format", "frame", "csv") == "csv"
    with pytest.raises(InputError) as caught:
        named_format(PLACE, "data.points.format", "frame", "davis-9")
    words = "fabric.toml: bubble[0].data.points.format: 'davis-9' is not one of: aramis, csv"
    assert str(caught.value).startswith(words)
