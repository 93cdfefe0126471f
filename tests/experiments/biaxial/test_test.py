"""experiments/biaxial/test.py: [[biaxial]] of a project, and its fits."""

from bubblefit.experiments.biaxial.paths import find_cycles
from bubblefit.experiments.biaxial.tables import read_biaxial_table
from bubblefit.experiments.biaxial.test import BiaxialSection, TablesSection, read
from bubblefit.experiments.fabric import Fabric
from bubblefit.experiments.sections import Place

from ...builders.biaxial_tests import BENT_LAW, HEAD, biaxial_rows, write_biaxial_rows
from ...support.refusals import complaint_with


def test_file_listed_for_a_ratio_must_have_that_ratio(tmp_path):
    path = write_biaxial_rows(tmp_path / "x.csv", biaxial_rows(BENT_LAW, ["1:2"], cycles=2))
    table = read_biaxial_table(path)
    cycles = find_cycles(table.load, ["2:1"] * len(table.load))
    assert [c.ratio for c in cycles] == ["2:1", "2:1"]
    flat = write_biaxial_rows(
        tmp_path / "flat.csv", [("1:1", 2.0, 2.0, 0.1 * k, 0.2) for k in range(5)], HEAD
    )
    place = Place(tmp_path / "project.toml", "biaxial[0]", Fabric("fabric", 0.8))
    section = BiaxialSection(data=TablesSection(files=[flat.name]))
    complaint_with(["flat.csv", "no loading"], read, section, place, "flat")
