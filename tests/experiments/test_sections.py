"""experiments/sections.py: what sections of tests have in common."""

from pathlib import Path

from bubblefit.experiments.sections import Fabric, Place, named_format

from ..support.refusals import complaint

PLACE = Place(Path("fabric.toml"), "bubble[0]", Fabric("Valmex", 0.8))


def test_unknown_format_is_refused_where_it_is_named():
    assert named_format(PLACE, "data.points.format", "frame", None) is None
    assert named_format(PLACE, "data.points.format", "frame", "csv") == "csv"
    said = complaint(named_format, PLACE, "data.points.format", "frame", "davis-9")
    assert said.startswith("fabric.toml: bubble[0].data.points.format: 'davis-9'")
