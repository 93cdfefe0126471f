"""Files that are read with suspicion: devices, pipes, sizes, and what a message may hold."""

import os
import pickle
from pathlib import Path

import pytest
from bubblefit.errors import InputError, one_line
from bubblefit.files import check_regular, content_of
from bubblefit.materials.card import read_card
from bubblefit.project.project import read_project
from bubblefit.readers.frames import read_frames
from bubblefit.readers.tables import read_lines
from bubblefit.solvers.marc.settings import site_settings

from .complaints import complaint

READERS = [read_project, read_card, site_settings, read_lines, lambda path: read_frames([path])]


def test_a_file_whole_and_no_more_of_it_than_is_meant(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"x" * 2**20)
    assert content_of(path) == content_of(path, 2**20) == b"x" * 2**20
    said = complaint(content_of, path, 2**20 - 1)
    assert said == f"{path}: has more than 0 MiB; is it the right file?"
    with pytest.raises(FileNotFoundError):
        content_of(tmp_path / "b")
    link = tmp_path / "link"
    link.symlink_to(path)
    assert len(content_of(link)) == 2**20


def test_a_file_that_says_nothing_of_its_size():
    """As those of /proc: what is read decides."""
    assert content_of("/proc/self/status").startswith(b"Name:")
    assert "has more than" in complaint(content_of, "/proc/self/status", 10)


@pytest.mark.parametrize("read", READERS)
def test_what_may_never_end_is_not_read(tmp_path, read):
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to("/dev/zero")
    for path in (pipe, link, Path("/dev/zero")):
        said = complaint(read, path)
        assert said == f"{path}: is no regular file but a device or a pipe; copy it into a file"
    said = complaint(read, tmp_path / "a\0b")
    assert said == f"{tmp_path}/a\\0b: no file can have such a name"


@pytest.mark.parametrize("read", READERS)
def test_a_file_larger_than_any_is_refused_before_it_is_read(tmp_path, read):
    path = tmp_path / "large"
    with path.open("wb") as file:
        file.truncate(2**40)
    assert "is it the right file?" in complaint(read, path)


def test_a_folder_is_left_to_its_reader(tmp_path):
    check_regular(tmp_path)
    assert complaint(read_card, tmp_path) == f"{tmp_path}: cannot be read: Is a directory"


def test_a_message_stays_one_line_whatever_a_name_holds():
    error = InputError("a\nb\x1b[31m.csv", "line 1, column 'x\u202ey\u2028'", "ärger – 0,5 µm")
    text = "a\\nb\\x1b[31m.csv: line 1, column 'x\\u202ey\\u2028': ärger – 0,5 µm"
    assert str(error) == str(pickle.loads(pickle.dumps(error))) == text
    assert one_line("a\u00a0b") == "a\u00a0b" and one_line("\udcff") == "\\udcff"
