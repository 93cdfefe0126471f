"""Reading of unknown files: regular ones up to a size, without waiting."""

import os
from pathlib import Path

import pytest
from bubblefit.materials.card import read_card
from bubblefit.project.project import read_project
from bubblefit.readers.frames import read_frames
from bubblefit.readers.tables import read_lines
from bubblefit.solvers.marc.settings import site_settings
from bubblefit.storage.reading import check_regular, read_bytes

from ..support.refusals import complaint, raised

READERS = [read_project, read_card, site_settings, read_lines, lambda path: read_frames([path])]


def test_file_is_read_whole_but_not_beyond_its_limit(tmp_path):
    path, link = tmp_path / "a", tmp_path / "link"
    path.write_bytes(b"x" * 2**20)
    link.symlink_to(path)
    assert read_bytes(path) == read_bytes(path, 2**20) == read_bytes(link) == b"x" * 2**20
    # A file of /proc says nothing of its size.
    assert read_bytes("/proc/self/status").startswith(b"Name:")
    for large, most in ((path, 2**20 - 1), ("/proc/self/status", 10)):
        assert f"{large}: has more than 0 MiB" in complaint(read_bytes, large, most)
    raised(FileNotFoundError, "", read_bytes, tmp_path / "b")


@pytest.mark.parametrize("read", READERS)
def test_endless_files_are_refused(tmp_path, read):
    pipe, link, large = tmp_path / "pipe", tmp_path / "link", tmp_path / "large"
    os.mkfifo(pipe)
    link.symlink_to("/dev/zero")
    for path in (pipe, link, Path("/dev/zero")):
        assert complaint(read, path).startswith(f"{path}: is no regular file")
    assert complaint(read, tmp_path / "a\0b").startswith(f"{tmp_path}/a\\0b: no file can have such")
    with large.open("wb") as file:
        file.truncate(2**40)
    assert "is it the right file?" in complaint(read, large)


def test_folder_is_left_to_its_reader(tmp_path):
    check_regular(tmp_path)
    assert complaint(read_card, tmp_path) == f"{tmp_path}: is a folder; name a file in it"
