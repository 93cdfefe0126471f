"""Which files the frames of a test are."""

from __future__ import annotations

from bubblefit.readers.frames import frame_files

from ..complaints import complaint


def test_the_order_of_frames(tmp_path):
    for name in ("f10.csv", "f2.csv", "f1.csv", "g.csv"):
        (tmp_path / name).write_text("")
    (tmp_path / "f3.csv").mkdir()

    def order(*names: str) -> tuple[list[str], str | None]:
        files, note = frame_files([str(tmp_path / name) for name in names])
        return [file.name for file in files], note

    assert order("f*.csv") == (["f1.csv", "f2.csv", "f10.csv"], None)
    assert order("f2.csv", "f1.csv", "f10.csv") == (["f2.csv", "f1.csv", "f10.csv"], None)
    assert order("g.csv", "f?.csv") == (["g.csv", "f1.csv", "f2.csv"], None)
    # As a shell sorts an unquoted pattern.
    files, note = order("f1.csv", "f10.csv", "f2.csv")
    assert files == ["f1.csv", "f10.csv", "f2.csv"]
    assert note is not None and "f10.csv before f2.csv; quote the pattern" in note
    # Of quoted patterns the order is meant, whatever a shell would have made of it.
    assert order("f1*.csv", "f2.csv") == (["f1.csv", "f10.csv", "f2.csv"], None)
    # A name with a bracket in it is a file before it is a pattern.
    (tmp_path / "a[1].csv").write_text("")
    assert order("a[1].csv")[0] == ["a[1].csv"]


def test_files_in_a_folder_of_their_own(tmp_path):
    """The folder's name is no pattern, and complaints name what was asked for."""
    folder = tmp_path / "run[1]"
    folder.mkdir()
    for name in ("f10.csv", "f2.csv"):
        (folder / name).write_text("")
    assert frame_files(["f*.csv"], folder=folder) == ([folder / "f2.csv", folder / "f10.csv"], None)
    _, note = frame_files(["f10.csv", "f2.csv"], folder=folder)
    assert note == (
        "frames in the order given: f10.csv before f2.csv; quote the pattern to have them by number"
    )
    assert complaint(frame_files, ["g*"], "data.files", folder) == (
        f"data.files: no file matches '{folder}/g*'"
    )
    assert complaint(frame_files, ["f2.csv", "f*.csv"], "files", folder) == (
        f"{folder}/f2.csv: files: is given twice"
    )
    assert complaint(frame_files, [str(folder)]) == (
        f"{folder}: files: is a folder, expected files; quote a pattern such as '{folder}/*.csv'"
    )
