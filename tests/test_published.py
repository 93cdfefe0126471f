"""The tables of published numbers are those of the data folder, and each has its source."""

from __future__ import annotations

from .places import PUBLISHED


def test_every_table_has_a_source_and_says_its_units() -> None:
    described = (PUBLISHED / "README.md").read_text()
    tables = sorted(PUBLISHED.glob("*.csv"))
    assert len(tables) == 4
    for table in tables:
        assert f"| `{table.name}` |" in described
        assert table.read_text().startswith("# ")


def test_they_are_those_of_the_data_folder(shared_data) -> None:
    there = {path.name: path.read_bytes() for path in (shared_data / "benchmarks").glob("*.csv")}
    assert {path.name: path.read_bytes() for path in PUBLISHED.glob("*.csv")} == there
