"""experiments/data_files.py: measured files with checksums, and names of written files."""

import hashlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.data_files import DataFile, Output, arrays_checksum, joined
from bubblefit.readers.frames import FrameSource

SOURCE = FrameSource("csv")


def test_checksum_of_arrays_is_that_of_their_numbers():
    array = np.array([[1.0, 2.0], [3.0, 4.5]])
    expected = hashlib.sha256(array.tobytes()).hexdigest()
    assert arrays_checksum([array]) == expected
    assert arrays_checksum([array[:1], array[1:]]) == expected
    assert arrays_checksum([array.T]) != expected
    assert arrays_checksum([np.asfortranarray(array)]) == expected


def test_checksum_of_a_data_file_is_that_of_file_or_arrays(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b"x,y\n1,2\n")
    file = DataFile(path, SOURCE, 1)
    assert file.sha256 == hashlib.sha256(b"x,y\n1,2\n").hexdigest()
    arrays = (np.ones(3),)
    assert DataFile(path, SOURCE, 1, arrays=arrays).sha256 == arrays_checksum(arrays)


def test_entries_of_a_file_are_joined_and_their_rows_added():
    a, b = Path("a.csv"), Path("b.csv")
    parts = [
        DataFile(a, SOURCE, 3, {"all zero": 1}),
        DataFile(b, SOURCE, None),
        DataFile(a, SOURCE, 4, {"all zero": 2, "flagged": 1}),
    ]
    first, second = joined(parts)
    assert (first.path, first.used_count, first.dropped) == (a, 7, {"all zero": 3, "flagged": 1})
    assert (second.path, second.used_count, second.dropped) == (b, None, {})


@pytest.mark.parametrize("name", ["bubble 1", "a/b", "a:b", "..", "strip é", 200 * "x"])
def test_names_of_files_begin_with_a_plain_name_of_the_test(tmp_path, name):
    output = Output.of(tmp_path, name, several=True)
    path = output.path("curve.csv")
    assert path.parent == tmp_path and len(path.name.encode()) < 100
    path.write_text("written")
    assert Output.of(tmp_path, name, several=False).name("curve.csv") == "curve.csv"


def test_tests_of_similar_names_have_different_files(tmp_path):
    names = ["a b", "a-b", "a/b", "a:b", "a\\b"]
    files = {Output.of(tmp_path, name, several=True).name("x.csv") for name in names}
    assert len(files) >= len(names) - 1  # a blank and a dash are both written as a dash


def test_table_is_written_with_nine_digits_or_all(tmp_path):
    table = pd.DataFrame({"load_N": [1 / 3]})
    output = Output(tmp_path, "a-")
    assert output.write("t.csv", table, "loads") == ("a-t.csv", "loads")
    assert (tmp_path / "a-t.csv").read_text() == "load_N\n0.333333333\n"
    output.write("t.csv", table, digits=None)
    assert pd.read_csv(tmp_path / "a-t.csv").load_N[0] == 1 / 3
