"""Specify that a mistaken command says what is wrong, and leaves the corrected one a free way."""

import json
import shlex

import pytest
from bubblefit.cli.start import find_document, pages
from bubblefit.errors import InputError, SolverFailure
from bubblefit.runs.folder import RESULT, RUN, Provenance
from bubblefit.runs.multistart import MultiStart

from ..support.commands import in_process, one_line
from ..support.paths import EXAMPLES

TWO_WARP_STRIPS = """
fabric = { thickness = 0.8 }
units = { modulus = "MPa", pressure = "kPa", length = "mm" }
fit = { jobs = 1, starts = 1 }

[law]
form = "quadratic"
bounds = { E1 = [20, 2000], E2 = [20, 1000], G12 = [1, 200] }

[[strips]]
name = "first"
width = 25.0
increments = 8
warp = { gauge_length = 20.0 }
data = { files = { warp = ["first.csv"] } }

[[strips]]
name = "second"
width = 25.0
increments = 8
warp = { gauge_length = 20.0 }
data = { files = { warp = ["second.csv"] } }
"""


@pytest.fixture
def place(tmp_path):
    """A project of two warp tests, whose law lacks the strain ranges of fill and shear."""
    (tmp_path / "project.toml").write_text(TWO_WARP_STRIPS)
    for name, factor in (("first", 1.0), ("second", 1.02)):
        rows = [f"{0.1 * k:.1f},{factor * 40.0 * k:.2f}" for k in range(16)]
        text = "\n".join(["elongation (mm),force (N)", *rows])
        (tmp_path / f"{name}.csv").write_text(text + "\n")
    return tmp_path


def correct(project):
    """Add the strain ranges."""
    text = project.read_text()
    project.write_text(text.replace("[law]", "[law]\nstrain_range = [0.1, 0.1, 0.1]"))


@pytest.mark.parametrize(
    "command",
    [
        ("fit",),
        ("validate", "--leave", "tests"),
        ("validate", "--weights", "first"),
    ],
    ids=" ".join,
)
def test_a_refused_command_leaves_nothing_in_the_way_of_the_corrected_one(place, command):
    name, *options = command
    run = (name, "project.toml", *options, "--starts", 1, "--jobs", 1, "--quiet", "--out", "out")
    one_line(in_process(*run, cwd=place, code=2), "law.strain_range", "no test tells how far")
    assert not list(place.rglob(RUN))
    correct(place / "project.toml")
    in_process(*run, cwd=place)
    assert (place / "out" / RESULT).is_file()


def test_direction_without_which_no_law_follows_is_refused_before_the_first_fit(tmp_path):
    """Without the warp strips no test tells how far the warp strain goes."""
    folder = EXAMPLES / "own-data" / "data" / "strips"
    in_process("init", "own", "--own", "--data", folder, "--thickness", 0.83, cwd=tmp_path)
    run = ("validate", "own", "--leave", "directions", "--starts", 1, "--out", "out", "--quiet")
    one_line(in_process(*run, cwd=tmp_path, code=2), "law.strain_range", "the warp strain")
    assert not list(tmp_path.rglob(RUN))


def test_a_fit_that_failed_at_every_start_leaves_its_page_and_nothing_in_the_way(
    place, monkeypatch
):
    correct(place / "project.toml")
    run = ("fit", "project.toml", "--starts", 1, "--jobs", 1, "--quiet", "--out", "out")
    with monkeypatch.context() as patch:
        patch.setattr(MultiStart, "run", _failing)
        in_process(*run, cwd=place, code=4)
    assert (place / "out" / "report.html").exists() and not (place / "out" / RUN).exists()
    in_process(*run, cwd=place)


def _failing(_):
    raise SolverFailure("no licence")


def test_finished_work_is_kept_after_a_failure(place, monkeypatch):
    """The fit to all tests is done when the next one fails, and --resume goes on with it."""
    correct(place / "project.toml")
    run = ("validate", "project.toml", "--starts", 1, "--jobs", 1, "--quiet", "--out", "out")
    runs = []

    def run_once(self):
        runs.append(1)
        return original(self) if len(runs) == 1 else _failing(self)

    original = MultiStart.run
    with monkeypatch.context() as patch:
        patch.setattr(MultiStart, "run", run_once)
        in_process(*run, cwd=place, code=4)
    assert (place / "out" / RUN).exists()
    one_line(in_process(*run, cwd=place, code=2), "already holds results", "--resume")
    in_process(*run, "--resume", cwd=place)


def test_a_command_on_the_page_can_be_pasted(place):
    (place / "project.toml").rename(place / "a b.toml")
    correct(place / "a b.toml")
    run = ("fit", "a b.toml", "--starts", "1", "--jobs", "1", "--out", "two words")
    in_process(*run, cwd=place)
    record = Provenance.read(place / "two words")
    command = record.runs[0]["command_line"]
    pasted = shlex.join(command)
    assert pasted.endswith("fit 'a b.toml' --starts 1 --jobs 1 --out 'two words'")
    page = json.loads((place / "two words" / "page.json").read_text())
    assert pasted in json.dumps(page, ensure_ascii=False)


def test_a_folder_stands_for_its_project_file(place):
    in_process("check", ".", cwd=place, code=2)  # read as project.toml
    (place / "more").mkdir()
    refused = in_process("fit", "more", cwd=place, code=2)
    one_line(refused, "more is a folder without project.toml", "bubblefit init more")
    (place / "more" / "mine.toml").write_text("")
    refused = in_process("fit", "more", cwd=place, code=2)
    one_line(refused, "name one of its files: more/mine.toml")


def test_a_card_is_no_project(tmp_path):
    (tmp_path / "material.toml").write_text("format = 1\nbeta = [1.0, 2.0, 3.0]\n")
    for command in ("fit", "bend", "check"):
        refused = in_process(command, "material.toml", cwd=tmp_path, code=2)
        one_line(refused, "is a material card and no project", "--card material.toml")


@pytest.mark.parametrize(
    ("typed", "page"),
    [
        ("own-bubble", "how-to/own-bubble-test"),
        ("strips", "how-to/own-strip-tests"),
        ("mark", "how-to/marc"),
        ("howto/marcs", "how-to/marc"),
        ("cameras", "how-to/camera"),
        ("poisson", "how-to/studies"),
    ],
)
def test_pages_of_a_similar_name_or_title_are_named(typed, page):
    with pytest.raises(InputError, match="no such page; pages like it: ") as refused:
        find_document(typed, pages())
    assert page in refused.value.problem
    with pytest.raises(InputError, match=r"no such page \(`bubblefit docs` lists"):
        find_document("nosuchpage", pages())


def test_check_lists_the_problems_of_all_tests_each_in_a_line(place):
    text = (place / "project.toml").read_text()
    third = """
[[strips]]
name = "third"
width = 25.0
warp = { gauge_length = 20.0, final_length = 90.0 }
bias = { gauge_length = 20.0 }
data = { files = ["both.csv"] }
"""
    (place / "both.csv").write_text(
        "direction,elongation (mm),force (N)\n"
        + "".join(f"warp,{0.1 * k:.1f},{40 * k}\n" for k in range(16))
    )
    (place / "project.toml").write_text(text.replace("second.csv", "none.csv") + third)
    done = in_process("check", "project.toml", cwd=place, code=2)
    lines = done.stderr.splitlines()
    assert len(lines) == 3 and all(line.startswith("bubblefit: project.toml: ") for line in lines)
    for line, words in zip(
        lines,
        (
            "strips[1].data.files.warp[0]: there is no file none.csv; --data DIR names",
            "strips[2].warp.final_length: expected up to 21.5 mm (the data end at",
            "strips[2].bias: the data hold no bias test; leave this section out or add",
        ),
        strict=True,
    ):
        assert words in line
    # The test that can be read is checked, too; a fit names the first problem.
    fit = in_process("fit", "project.toml", cwd=place, code=2)
    one_line(fit, "none.csv; --data DIR names another folder (2 more)")
    wrong = (place / "project.toml").read_text().replace("width", "widht", 2)
    (place / "project.toml").write_text(wrong)
    done = in_process("check", "project.toml", cwd=place, code=2)
    assert done.stderr.count("unknown key; did you mean 'width'?") == 2
