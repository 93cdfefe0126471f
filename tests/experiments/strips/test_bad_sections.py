"""What is wrong with a [[strips]], or its data, is said in one line: the file and the key."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.strips.test import StripsTest

from ...complaints import complaint, complaint_with
from ...projects import project_file
from .sections import CURVES, PUBLISHED, SMALL, read, rows, write_exports

OLD_FILES = 'files = { warp = ["w1.csv", "w2.csv"], fill = ["f.TXT"], bias = ["b.csv"] }'
TOP = "[warp]\n"


@pytest.fixture
def small(tmp_path: Path) -> Callable[..., StripsTest]:
    """Read the small section beside its exports after replacing some texts."""
    write_exports(tmp_path)

    def edited(*changes: tuple[str, str]) -> StripsTest:
        return read(project_file(tmp_path, SMALL, *changes))

    return edited


@pytest.mark.parametrize(
    "old, new, words",
    [
        (TOP, f"thikness = 0.81\n{TOP}", ["strips[0].thikness", "unknown key"]),
        (TOP, f"widht = 1\n{TOP}", ["strips[0].widht", "did you mean 'width'"]),
        (TOP, f"width = -1\n{TOP}", ["strips[0].width", "greater than 0"]),
        (TOP, f"bias_angle = 90\n{TOP}", ["strips[0].bias_angle", "90"]),
        (TOP, f"increments = 0\n{TOP}", ["strips[0].increments", "1"]),
        (TOP, f'match = "all"\n{TOP}', ["strips[0].match", "'points'"]),
        (TOP, f'objective = "e"\n{TOP}', ["strips[0].objective", "'N' or 'relative'"]),
        (TOP, f"weight = -1\n{TOP}", ["strips[0].weight", "0"]),
        (
            TOP,
            f"grip_distance = 19.0\n{TOP}",
            ["strips[0].bias.gauge_length", "distance of the grips, 19 mm"],
        ),
        ("gauge_length = 20.0", "", ["strips[0].warp.gauge_length", "missing"]),
        ("gauge_length = 20.0", "length = 20.0", ["strips[0].warp.length", "gauge_length"]),
        ("[warp]\ngauge_length = 20.0", "", ["strips[0].warp.gauge_length", "missing"]),
        (
            "gauge_length = 20.0",
            "gauge_length = 20.0\nfinal_length = 20.0",
            ["strips[0].warp.final_length", "more than the gauge length 20 mm"],
        ),
        (
            "gauge_length = 20.0",
            "gauge_length = 20.0\nfinal_length = 25.0",
            ["strips[0].warp.final_length", "the data end at an elongation of 4 mm", "24 mm"],
        ),
        (OLD_FILES, "", ["strips[0].data", "exactly one of 'polynomials' and 'files'"]),
        (OLD_FILES, f'polynomials = "c.csv"\n{OLD_FILES}', ["strips[0].data", "exactly one"]),
        (OLD_FILES, 'polynomials = "c.csv"', ["strips[0].data.polynomials", "there is no file"]),
        (OLD_FILES, "files = []", ["strips[0].data.files", "at least 1 items"]),
        (OLD_FILES, "files = {}", ["strips[0].data.files", "files of one direction at least"]),
        (OLD_FILES, "files = 3", ["strips[0].data.files", "list"]),
        (OLD_FILES, 'files = "w1.csv"', ["strips[0].data.files", "list", "'w1.csv'"]),
        (OLD_FILES, 'files = ["w1.csv", 2]', ["strips[0].data.files[1]", "string", "2"]),
        (OLD_FILES, 'files = ["w1.csv"]', ["w1.csv: line 4", "files = { warp = [...] }"]),
        ('warp = ["w1.csv", "w2.csv"]', "warp = []", ["strips[0].data.files.warp", "at least 1"]),
        ('warp = ["w1.csv", ', "warp = [1, ", ["strips[0].data.files.warp[0]", "string"]),
        ('warp = ["w1.csv", "w2.csv"]', 'warp = "w1.csv"', ["files.warp", "list", "'w1.csv'"]),
        ("fill = [", "weft = [", ["strips[0].data.files.weft", "allowed here: warp, fill, bias"]),
        ('"w2.csv"', '"./w1.csv"', ["strips[0].data.files.warp[1]", "listed twice"]),
        ('"f.TXT"', '"w1.csv"', ["strips[0].data.files.fill[0]", "is listed for warp too"]),
        ('"f.TXT"', '"x.csv"', ["strips[0].data.files.fill[0]", "there is no file", "--data DIR"]),
        (
            'fill = ["f.TXT"], ',
            "",
            ["strips[0].fill", "no fill test; leave this section out or add its data"],
        ),
        ("[data]", "[data]\norder = 0", ["strips[0].data.order", "1"]),
        (
            "[data]",
            "[data]\norder = 10\nthrough_origin = 1",
            ["strips[0].data.through_origin", "boolean"],
        ),
        (
            "[data]",
            '[data]\nload_unit = "lbf"',
            ["strips[0].data.load_unit", "'N', 'kN', 'kN/m' or 'N/mm'"],
        ),
        ("[data]", '[data]\nlength_unit = "in"', ["strips[0].data.length_unit", "'cm' or 'm'"]),
        ("[data]", '[data]\ndecimal = ";"', ["strips[0].data.decimal", "'.' or ','"]),
        (
            "[data]",
            '[data]\nload_unit = "N"',
            ["w1.csv: line 4", "the file says 'kN', load_unit says 'N'"],
        ),
        (
            "[data]",
            '[data]\ncolumns = { force = "F" }',
            ["strips[0].data.columns.force", "allowed here: elongation, load, specimen, direction"],
        ),
        (
            "[data]",
            '[data]\ncolumns = { load = "F" }',
            ["w1.csv", "no header row with the columns one of elongation and 'F'"],
        ),
        ("[data]", "[weights]\nwarp = -1\n[data]", ["strips[0].weights.warp", "0"]),
        (
            "[data]",
            "[weights]\nwarp = 0\nfill = 0\nbias = 0\n[data]",
            ["strips[0].weights", "nothing would be matched"],
        ),
    ],
)
def test_bad_input_names_file_and_field(small, tmp_path, old, new, words):
    assert complaint_with(words, small, (old, new)).startswith(str(tmp_path))


@pytest.mark.parametrize(
    "text, words",
    [
        ("Extension (mm),Load (N)\n1,2\n2,x\n", ["f.TXT: line 3, column 'Load (N)': expected a n"]),
        (
            "Extension (mm),Load (N)\n1,2\n2,3\n",
            ["project.toml: strips[0].data, order 4: no load curve through the fill points", "2"],
        ),
        (
            "Extension (mm),Load (N)\n-1,2\n-2,3\n",
            ["project.toml: strips[0].data, elongation: no load curve through the fill points"],
        ),
        ("Extension (mm),Load (N)\n1,0\n2,0\n", ["strips[0].data, load", "all 2 loads are 0 N"]),
        (
            "Direction,Extension (mm),Load (N)\nwarp,1,2\n",
            ["f.TXT: column 'Dir", "no fill; it has"],
        ),
        ("", ["f.TXT: no header row"]),
    ],
)
def test_bad_data_names_the_file_or_the_project(small, tmp_path, text, words):
    (tmp_path / "f.TXT").write_text(text)
    complaint_with(words, small)


def test_points_are_needed_where_they_are_to_be_matched(small, tmp_path):
    (tmp_path / "curves.csv").write_bytes((CURVES / "curves.csv").read_bytes())
    points = ('match = "polynomial"', 'match = "points"')
    message = complaint(read, project_file(tmp_path, PUBLISHED, points))
    assert "strips[0].match: 'points' needs measured points (data.files)" in message
    # The first points lie beyond the end of the model.
    text = "Extension (mm),Load (N)\n" + rows(",", np.arange(1.0, 9.0), np.arange(8.0))
    (tmp_path / "f.TXT").write_text(text)
    short = ("gauge_length = 22.0", "gauge_length = 22.0\nfinal_length = 22.5")
    message = complaint(small, short, (TOP, f'match = "points"\n{TOP}'))
    assert message.startswith(
        f"{tmp_path / 'project.toml'}: strips[0].fill.final_length: no measured"
    )
