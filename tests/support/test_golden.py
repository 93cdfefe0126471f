"""What the comparison of terminal output lets pass, and what it does not."""

import pytest

from .golden import FOLDER, NUMBER, differences, is_alike_line

ROW = "E1, along warp      0 %     820.1      13 %       594.2 to 1026     664.2"
VALLEY = "G12, in shear       0 %        27     120 %      3.838 to 63.52     21.87"
PROFILE = "E1 at 0 % of strain: 370 MPa, 95 % from 275.4 to 464.6 (the fit's band 278.2 to 453.8)"
MISFIT = "misfit of strips: warp: 1.09 N RMS, 0.05 times the noise (21.7 N, specimens' scatter)"
STARTS = "4 of 4 starts ended with a fit; sum of the strips' RMS errors, N: best 8.951, median 9"


@pytest.mark.parametrize(
    ("line", "written", "instead"),
    [
        (ROW, "820.1", "820"),
        (ROW, "820.1", "820.2"),
        (ROW, "1026", "1027"),
        (ROW, "594.2", "590.1"),
        (ROW, "13 %", "14 %"),
        (VALLEY, "27 ", "27.4 "),
        (VALLEY, "21.87", "22.2"),
        (PROFILE, "278.2 to 453.8", "281.7 to 455.5"),
        (STARTS, "8.951", "8.952"),
    ],
)
def test_rounding_of_another_processor_passes(line, written, instead):
    assert written in line
    assert is_alike_line(line.replace(written, instead), line)


@pytest.mark.parametrize(
    ("line", "written", "instead"),
    [
        (ROW, "820.1", "820.3"),
        (ROW, "820.1", "8201"),
        (ROW, "820.1", "-820.1"),
        (ROW, "1026", "1050"),
        (ROW, "594.2 to 1026", "1026 to 594.2"),
        (ROW, "13 %", "15 %"),
        (ROW, "warp      0 %", "warp      1 %"),
        (ROW, "664.2", "66.42"),
        (ROW, "along warp", "along fill"),
        (VALLEY, "27 ", "28 "),
        (VALLEY, "120 %", "unknown"),
        (PROFILE, "370 MPa", "371 MPa"),
        (PROFILE, "370 MPa", "370 GPa"),
        (
            PROFILE,
            "275.4 to 464.6 (the fit's band 278.2 to 453.8)",
            "278.2 to 453.8 (the fit's band 275.4 to 464.6)",
        ),
        (PROFILE, " (the fit's band 278.2 to 453.8)", ""),
        (MISFIT, "1.09", "1.1"),
        (MISFIT, "0.05 times", "0.06 times"),
        (MISFIT, "1.09 N", "1.09 mm"),
        (MISFIT, "21.7", "21.8"),
        (STARTS, "4 of 4", "3 of 4"),
        (STARTS, "8.951", "8.953"),
        (STARTS, "best 8.951, median 9", "best 9, median 8.951"),
    ],
)
def test_wrong_number_unit_or_count_fails(line, written, instead):
    assert written in line
    assert not is_alike_line(line.replace(written, instead), line)


@pytest.mark.parametrize("path", sorted(FOLDER.iterdir()), ids=lambda path: path.stem)
def test_each_number_of_a_golden_file_is_held(path):
    """Another number in place of any of a file makes a difference, and so does a missing line."""
    text = path.read_text()
    assert differences(text, text) == []
    for number in NUMBER.finditer(text):
        wrong = f"{1.05 * float(number[0]) + 1:.4g}"
        assert differences(text[: number.start()] + wrong + text[number.end() :], text), number
    lines = text.splitlines(keepends=True)
    for k, line in enumerate(lines):
        assert differences("".join(lines[:k] + lines[k + 1 :]), text), line
