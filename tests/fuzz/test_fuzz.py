"""Read valid files changed a little, a few by every reader, and those of the corpus.

    BUBBLEFIT_FUZZ=5000 pytest tests/fuzz -k changed_file
    BUBBLEFIT_FUZZ=5000 pytest tests/fuzz -k "changed_file and t19" --hypothesis-seed=7

tries so many of each reader. The smallest file that is a fault stays in out/fuzz/, from where it
goes into tests/corpus/ when it is mended.
"""

import os
import shutil
import time

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.readers.registry import format_of, formats
from hypothesis import given, settings
from hypothesis import strategies as st

from ..support.paths import ROOT
from .judging import Endless, fault, limits
from .mutations import CHANGES, mutated
from .targets import targets

HOSTILE = sorted((ROOT / "tests" / "corpus").glob("*/*"))


#: What costs a process of its own each time is tried less often, tables of text more often.
SLOW = ("frame istra4d", "frame pyaldic", "frame multidic", "frame ncorr", "frame vic3d-mat")


TABLES = ("machine", "surfaces", "polynomials", "frame plain", "frame german", "frame tecplot")


@pytest.mark.parametrize("name", targets())
def test_changed_file_is_read_or_refused_in_one_line(tmp_path_factory, name):
    target = targets()[name]
    path = tmp_path_factory.mktemp("fuzz") / f"hostile{target.suffix}"
    count = 3 if name in SLOW else 40 if name in TABLES else 10
    count = int(os.environ.get("BUBBLEFIT_FUZZ", count))

    @settings(max_examples=count, deadline=None, database=None)
    @given(st.sampled_from(target.seeds), CHANGES)
    def read(content, changes) -> None:
        path.write_bytes(mutated(content, changes))
        if wrong := fault(target.read, path):
            (ROOT / "out" / "fuzz").mkdir(parents=True, exist_ok=True)
            shutil.copy(path, ROOT / "out" / "fuzz" / f"{name}{target.suffix}")
        assert not wrong

    read()


@pytest.mark.parametrize("path", HOSTILE, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_file_of_corpus_stays_harmless(path):
    by_folder = {name.replace(" ", "-"): target for name, target in targets().items()}
    begun = time.monotonic()
    assert fault(by_folder[path.parent.name].read, path) == ""
    # Each took a minute or a gigabyte, or ended with a traceback, before it was mended.
    assert time.monotonic() - begun < 15


@pytest.mark.parametrize("name", targets())
def test_valid_files_are_read(tmp_path, name):
    target = targets()[name]
    path = tmp_path / f"valid{target.suffix}"
    for content in target.seeds:
        path.write_bytes(content)
        with limits():
            target.read(path)


def test_every_format_has_a_target(tmp_path):
    path, found = tmp_path / "file", set()
    for name, target in targets().items():
        path.write_bytes(target.seeds[0])
        if name.startswith("frame"):
            found.add(format_of("frame", path).name)
    # Of muDIC's files a user names the columns, as pixels cannot be told from mm.
    assert found | {"mudic"} == {one.name for one in formats("frame")}
    assert [one.name for one in formats("machine table")] == ["text", "xlsx"]


def raising(error: BaseException):
    def read(path) -> None:
        raise error

    return read


def endless(path) -> None:
    while True:
        pass


def test_faults_of_readers_are_noticed(tmp_path):
    path = tmp_path / "a"
    assert fault(lambda path: None, path) == fault(raising(InputError(path, "", "no")), path) == ""
    for error in (ValueError("x"), MemoryError(), RecursionError(), OSError(36, ""), KeyError(1)):
        assert type(error).__name__ in fault(raising(error), path)
    assert "no line" in fault(raising(InputError(path, "", "Unable to allocate 1 TiB")), path)
    assert "MemoryError" in fault(lambda path: bytearray(2**31), path)
    assert "MemoryError" in fault(lambda path: np.full(2**28, 1.0), path)
    assert bytearray(2**29 + 2**20)  # the limit is of the reading only
    with pytest.raises(Endless), limits(seconds=1):
        endless(path)
