"""experiments/deck/measured.py: readings of several files, as they are compared."""

import numpy as np

from ...builders.decks import bar, write_curve


def test_readings_of_several_specimens_are_one_curve(tmp_path, monkeypatch):
    write_curve(tmp_path / "second.csv", noise=0.01)
    change = [('measured = "frame.csv"', 'measured = ["frame.csv", "second.csv"]')]
    (compared,) = bar(tmp_path, monkeypatch, change).tests["bar"].matched.values()
    assert compared.name == "force" and compared.unit == "N" and compared.section.noise == 0.002
    assert [file.used_count for file in compared.data] == [12, 12]
    assert not np.array_equal(compared.load[:12], compared.load[12:])
