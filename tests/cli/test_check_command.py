"""`bubblefit init`, `check` with fits of doubtful data, and `study`."""

import csv
import json
import re
import tomllib

import bubblefit as bf
import jsonschema
import numpy as np
import pandas as pd
import pytest
from bubblefit.cli import start
from bubblefit.cli.start import KINDS
from bubblefit.experiments.registry import kinds
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.project.schema import SHIPPED, project_schema, read_content, validated
from bubblefit.reports.content import read_page_data
from bubblefit.runs.check import check
from click.testing import CliRunner

from ..builders.laws import TABLE_4_2
from ..builders.projects import EASY, known_bubble_in_camera_frames, project_file
from ..experiments.biaxial.test_biaxial_fit import TRAPS as BIAXIAL_TRAPS
from ..experiments.bubble.test_bubble_doubts import OF_OWN_TESTS as BUBBLE_TESTS
from ..experiments.bubble.test_bubble_doubts import TRAPS as BUBBLE_TRAPS
from ..experiments.strips.test_strip_doubts import TRAPS as STRIP_TRAPS
from ..support.charts import check_convergence, data
from ..support.commands import in_process, one_line, result_in
from ..support.paths import KNOWN, ROOT
from ..support.refusals import complaint


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Good data in project.toml; the same with y flipped in the places in flipped.toml."""
    place = tmp_path_factory.mktemp("check")
    text, _ = known_bubble_in_camera_frames(place, lambda x, u: (x, u))
    (place / "project.toml").write_text(text)
    (place / "flipped.toml").write_text(text.replace('y = "y"', 'y = "minus_y"'))
    (place / "exchanged.toml").write_text(
        text.replace('dx = "dx", dy = "dy"', 'dx = "dy", dy = "dx"')
    )
    for frame in place.glob("frame_*.csv"):
        table = np.loadtxt(frame, delimiter=",", skiprows=1)
        wide = np.column_stack([table, -table[:, 1]])
        names = "x,y,z,dx,dy,dz,minus_y"
        np.savetxt(frame, wide, delimiter=",", header=names, comments="", fmt="%.9g")
    return place


def test_good_data_are_said_to_be_fine(folder, golden):
    golden("check", in_process("check", "project.toml", cwd=folder).stdout, folder)
    out = folder / "out" / f"{folder.name}-check"
    page = (out / "report.html").read_text()
    assert "The data are fit to be fitted." in page and "Equilibrium of the apex" in page
    assert (out / "registration.png").is_file() and (out / "rises.png").is_file()
    said = complaint(check, bf.read_project(folder / "project.toml"), None, ["weather"])
    assert "fit.trust" in said and "weather" in said and "z-flipped" in said


def test_a_fit_of_exchanged_displacements_does_not_begin(folder):
    done = in_process("bubble", "exchanged.toml", "--starts", 1, "--out", "no", cwd=folder, code=2)
    one_line(done, "the centre is strained by", "calls for about", "take dy for dx and dx for dy")
    assert "[exchanged]" in done.stderr and not (folder / "no").exists()


def test_a_shape_out_of_equilibrium_is_a_warning_of_check(folder):
    """The shape of which y is flipped is no equilibrium of any law."""
    run = ("check", "flipped.toml", "--trust", "axis-flipped", "--out", "gap")
    said = " ".join(in_process(*run, cwd=folder).stdout.split())
    assert "bubble: warning: no law within the bounds keeps the measured shape in eq" in said
    assert "nothing doubtful" not in said
    page = (folder / "gap" / "report.html").read_text()
    assert "carry 2 of the doubts below" in page


LAB = f"""
[fabric]
name = "lab"
thickness = 0.8
[law]
form = "constant"
nu12 = 0.2
{EASY}
[[strips]]
width = 25.0
rate = 100.0
warp.gauge_length = 20.0
fill.gauge_length = 16.0
data.files = ["loads.csv"]
"""


def test_strips_have_a_table_after_en_iso_1421(tmp_path):
    """Warp: 1600 N (1 + 0.02 i) at 6 mm, a little less after it; fill: a single specimen."""
    rows, u = ["direction,specimen,elongation_mm,load_N"], np.linspace(0.0, 6.0, 25)
    for direction, i, most in (
        ("warp", 0, 1600),
        ("warp", 1, 1632),
        ("warp", 2, 1664),
        ("fill", 0, 400),
    ):
        own = [*zip(u, most * u / 6, strict=True), (6.2, 0.995 * most)]
        rows += [f"{direction},{direction}{i},{a},{b}" for a, b in own]
    (tmp_path / "loads.csv").write_text("\n".join(rows))
    (tmp_path / "lab.toml").write_text(LAB)
    in_process("check", "lab.toml", "--out", "out", cwd=tmp_path)
    table = pd.read_csv(tmp_path / "out" / "en-iso-1421.csv").set_index("specimen")
    one = table.loc["warp1"]
    assert one.iloc[1:5].tolist() == pytest.approx([1632, 3264, 65.28, 30.0])
    assert (one.width_mm, one.gauge_length_mm, one.rate_mm_per_min) == (25, 20, 100)
    assert table.conditioning.isna().all() and table.loc["fill0"].iloc[4] == pytest.approx(37.5)
    assert table.max_force_N["mean"] == pytest.approx(1632)
    assert table.max_force_N["standard deviation"] == pytest.approx(32)
    varied = table.loc["coefficient of variation, %"]
    assert varied.iloc[1:5].tolist() == pytest.approx([100 / 51] * 3 + [0], abs=1e-6)
    assert len(table) == 7
    page = read_page_data(tmp_path / "out")
    shown = next(p for p in page.parts if "1421" in getattr(p, "title", ""))
    assert len(shown.rows) == 7 and "100 mm/min" in shown.note


def test_a_fit_of_doubtful_data_does_not_begin(folder):
    done = in_process("bubble", "flipped.toml", "--starts", 1, "--out", "no", cwd=folder, code=2)
    one_line(done, "flipped.toml", "'bubble'", "y and dy have opposite senses", "[axis-flipped]")
    assert "--trust NAME" in done.stderr and not (folder / "no").exists()
    said = in_process("check", "flipped.toml", "--json", "--out", "c", cwd=folder, code=2)
    told = json.loads(said.stdout)
    (doubt,) = told["tests"]["bubble"]
    assert (doubt["name"], doubt["severity"], doubt["trusted"]) == ("axis-flipped", "error", False)
    assert not told["sound"]
    page = (folder / "c" / "report.html").read_text()
    assert "A fit would not begin." in page and "opposite senses" in page


def test_what_is_trusted_passes_and_is_kept(folder):
    run = ("bubble", "flipped.toml", "--starts", 1, "--jobs", 1, "--out", "t")
    in_process(*run, "--trust", "axis-flipped", cwd=folder)
    (note,) = [w for w in result_in(folder / "t")["notes"] if "opposite senses" in w["note"]]
    assert "(trusted: axis-flipped)" in note["note"]
    assert (note["of"], note["kind"]) == ("bubble", "doubtful data")
    assert "opposite senses" in (folder / "t" / "notes.csv").read_text()
    assert "(trusted: axis-flipped)" in (folder / "t" / "report.html").read_text()
    # Trust in the project file is the same, and resumes the same fit.
    text = (folder / "flipped.toml").read_text()
    (folder / "t.toml").write_text(text.replace("[fit]", '[fit]\ntrust = ["axis-flipped"]'))
    in_process("bubble", "t.toml", "--starts", 1, "--resume", "--out", "t", cwd=folder)


def test_the_document_lists_every_doubt_and_its_limits():
    text = (ROOT / "docs" / "reference" / "doubts.md").read_text()
    parts = re.split("## Strips|## Biaxial tests", text)
    row = re.compile(r"^\| `([\w-]+)` \| (.*?) \| (.*) \|$", re.M)
    told = [{name: rest for name, *rest in row.findall(part)} for part in parts]
    traps = (
        {name: sure for _, name, sure, _ in BUBBLE_TRAPS.values()} | BUBBLE_TESTS,
        {name: sure for _, _, (name, sure, _) in STRIP_TRAPS.values()},
        {name: sure for _, own in BIAXIAL_TRAPS.values() for name, (sure, _) in own.items()},
    )
    for kind, rows, own in zip(("bubble", "strips", "biaxial"), told, traps, strict=True):
        assert set(rows) == set(kinds()[kind].doubts)
        assert kind == "biaxial" or set(own) == set(rows)
        for name, sure in own.items():
            assert ("error" if sure else "warning") in rows[name][0], name


#: Seconds of a level, in the table on the terminal.
SECONDS = re.compile(r"(?m)^( +\d+ +\d+) +\d+\.\d+")


def study(*arguments, cwd, code=0, card="card.toml"):
    name, *options = arguments
    run = ("study", name, "project.toml", "--card", card, *options)
    return in_process(*run, cwd=cwd, code=code).output


@pytest.fixture
def bubble(tmp_path):
    project_file(tmp_path, KNOWN.read_text(), ("elements = 800", "elements = 80"))
    law = HypoelasticLaw(1000 * np.array(TABLE_4_2), strain_range=[0.13] * 3)
    write_card(MaterialCard(law, 0.81, "Table 4.2"), tmp_path / "card.toml")
    return tmp_path


def test_mesh_of_a_bubble(bubble, drawn, golden):
    run = ("mesh", "--levels", 3, "--coarser", 0, "--out", "out")
    done = study(*run, cwd=bubble)
    model = result_in(bubble / "out")["models"]["bubble"]
    counts = [level["elements"] for level in model["levels"]]
    assert counts[2] == 4 * counts[1]
    assert all(level["seconds"] > 0 and level["iterations"] > 0 for level in model["levels"])
    apex = model["quantities"]["apex at 300 kPa, mm"]
    assert apex["limit"] == pytest.approx(39.7838, abs=0.02)  # of 12800 quads on the quarter
    assert abs(apex["own_error"]) < 5e-3 and apex["own_error_against"] == "limit"
    assert len(model["quantities"]) == 8 and "rms_N" not in model
    table = pd.read_csv(bubble / "out/convergence.csv")
    assert len(table) == 3 * 8
    assert (table[table.elements == counts[-1]].off_finest == 0).all()
    coarse = table[(table.factor == 1) & (table.quantity == "apex at 300 kPa, mm")].iloc[0]
    assert coarse.value - coarse.off_finest == pytest.approx(apex["finest"])
    assert (bubble / "out/convergence.png").stat().st_size > 10_000
    check_convergence(drawn[-1], table, "elements")
    names = {s.name for s in drawn[-1].charts[0].series[:-2]}
    assert names == set(model["quantities"])
    golden("study-mesh", SECONDS.sub(r"\1  N", done), bubble, done)
    assert "--overwrite" in study(*run, cwd=bubble, code=2)


def test_nu12_of_a_bubble(bubble, golden):
    golden("study-nu12", study("nu12", "--out", "out", cwd=bubble), bubble)


def test_nothing_that_ends_well_is_exit_code_4(bubble):
    # Of a card without a valid range nothing says how far it holds: E1 falls below zero soon.
    card = MaterialCard(HypoelasticLaw(1000 * np.array([*TABLE_4_2[:11], 0.02])), 0.81)
    write_card(card, bubble / "bad.toml")
    for command in ("mesh", "nu12"):
        done = study(command, cwd=bubble, code=4, card="bad.toml")
        assert len(done.splitlines()) == 1 and not (bubble / "out").exists()


@pytest.fixture(scope="module")
def schema():
    content = json.loads(SHIPPED.read_text())
    jsonschema.Draft202012Validator.check_schema(content)
    return jsonschema.Draft202012Validator(content)


def test_the_command_writes_it(tmp_path):
    assert SHIPPED.is_relative_to(ROOT / "templates")
    printed = in_process("schema", cwd=tmp_path).stdout
    assert json.loads(printed) == project_schema()
    in_process("schema", "--out", "s.json", cwd=tmp_path)
    assert (tmp_path / "s.json").read_text() == printed


def test_every_example_brings_the_schema(tmp_path):
    for example in KINDS:
        folder = tmp_path / example
        in_process("init", example, "--example", example, cwd=tmp_path)
        for path in folder.glob("*.toml"):
            assert path.read_text().startswith("#:schema project.schema.json\n")
        assert (folder / SHIPPED.name).read_text() == SHIPPED.read_text()
    assert len(read_project(tmp_path / "bend" / "project.toml").tests) == 9


def own(*options, cwd, code=0):
    return in_process("init", "mine", "--own", *options, cwd=cwd, code=code)


@pytest.mark.parametrize(
    ("options", "tests"),
    [
        (["--bubble", 1], ["bubble"]),
        (["--strips", 1, "--form", "spline"], ["strips"]),
        (["--cylinder", 1], ["cylinder"]),
        (["--biaxial", 2], ["biaxial 1", "biaxial 2"]),
        (["--bubble", 2, "--strips", 2, "--cylinder", 2, "--form", "trilinear"],
         ["bubble 1", "bubble 2", "strips 1", "strips 2", "cylinder 1", "cylinder 2"]),
    ],
)  # fmt: skip
def test_own_tests(options, tests, tmp_path, schema):
    own(*options, "--name", 'A "blue" one', "--thickness", 0.6, cwd=tmp_path)
    path = tmp_path / "mine" / "project.toml"
    project = read_project(path, need_data=False)
    assert list(project.tests) == tests
    assert project.fabric.name == 'A "blue" one' and project.fabric.thickness == 0.6
    text = path.read_text()
    schema.validate(tomllib.loads(text))
    for test in project.tests.values():
        # The loads of a biaxial test are its data, which are not there yet.
        assert bool(test.models()) == (test.kind != "biaxial")
    # Moduli are bounded, not coefficients: that serves every form.
    assert ("E1 = [" in text) == any("cylinder" not in name for name in tests)
    longest = max(map(len, text.splitlines()))
    assert longest <= 120, longest


#: A key or a section that may be wanted: the rest of its line is TOML, too.
COMMENTED = re.compile(r"# (\[[\w.]+\]|\[\[\w+\]\]|\w+ = .*)")


def uncommented(lines, wanted):
    return "\n".join(
        line[2:] if COMMENTED.match(line) and number in wanted else line
        for number, line in enumerate(lines)
    )


def test_what_is_commented_may_be_wanted(tmp_path, schema):
    own("--bubble", 1, "--strips", 1, "--cylinder", 1, cwd=tmp_path)
    path = tmp_path / "mine" / "project.toml"
    lines = path.read_text().splitlines()
    numbers = [n for n, line in enumerate(lines) if COMMENTED.match(line)]
    keys = {lines[n][2:].split(" =")[0] for n in numbers}
    assert {"[bubble.data.points.registration]", "warp", "warp_points", "format"} <= keys
    assert {"[bubble.sheet]", "surface", "modes", "[bubble.data.points.pressure]"} <= keys
    headers = [n for n in numbers if lines[n][2] == "["]
    one_by_one = [{n, max((h for h in headers if h <= n), default=n)} for n in numbers]
    for wanted in [*one_by_one, set(numbers)]:
        path.write_text(uncommented(lines, wanted))
        validated(read_content(path), path)
        schema.validate(tomllib.loads(path.read_text()))


def test_questions_on_a_terminal(tmp_path, monkeypatch):
    monkeypatch.setattr(start, "on_a_terminal", lambda: True)
    answers = "Sail\n0.7\n1\n120\n10,20\n1\n0\n1\n150\n90\nspline\n"
    run = [str(tmp_path / "mine"), "--own"]
    done = CliRunner().invoke(start.init_command, run, input=answers)
    assert done.exit_code == 0, done.output
    project = read_project(tmp_path / "mine" / "project.toml", need_data=False)
    assert list(project.tests) == ["bubble", "strips", "cylinder"]
    assert (project.fabric.name, project.law.form) == ("Sail", "spline")


PROJECT = """
[fabric]
name = "made"
thickness = 0.8
[law]
strain_range = [0.14, 0.18, 0.1]
[law.bounds]
E1 = [0.02, 2.0]
E2 = [0.02, 1.0]
G12 = [0.005, 0.2]
[[strips]]
increments = 5
match = "points"
warp = { gauge_length = 20, final_length = 23 }
fill = { gauge_length = 20, final_length = 24 }
[strips.data]
files = ["points.csv"]
[fit]
seed = 3
"""


@pytest.fixture
def project(tmp_path):
    """Three specimens a direction of a fabric whose E1 is linear in strain and E2 constant."""
    random = np.random.default_rng(1)
    lines = ["direction,specimen,elongation (mm),load (N)"]
    for direction, end, e, slope in (("warp", 3.0, 300.0, 1500.0), ("fill", 4.0, 200.0, 0.0)):
        for specimen in "abc":
            u = np.linspace(0.2, end - 0.01, 12)
            strain = np.log1p(u / 20)
            # Cauchy stress times the width that nu12 = 0.24 leaves: near enough for a test.
            load = 20 * (e * strain + slope * strain**2 / 2) + random.normal(0, 2, len(u))
            lines += [
                f"{direction},{specimen},{a:.4f},{b:.3f}" for a, b in zip(u, load, strict=True)
            ]
    (tmp_path / "points.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "project.toml").write_text(PROJECT)
    return tmp_path / "project.toml"


def test_the_form_behind_the_data_is_found(project, tmp_path, drawn, golden):
    out = tmp_path / "out"
    forms = ["--form", "constant", "--form", "linear", "--form", "cubic"]
    arguments = ["compare", project, "--out", out, "--starts", 1, "--quiet", *forms]
    done = in_process(*arguments, "--json", cwd=tmp_path)
    result = result_in(out)
    assert json.loads(done.stdout) == result
    found = {f["form"]: f for f in result["forms"]}
    assert [f["coefficients"] for f in result["forms"]] == [3, 6, 12]
    # Nested forms: each fits at least as well; the noise of 2 N is all that is left.
    fitted = [f["fitted"] for f in result["forms"]]
    assert fitted[0] > fitted[1] > fitted[2] * 0.999
    assert found["constant"]["cross_validated"] > 2 * found["linear"]["cross_validated"]
    assert 3 < found["linear"]["cross_validated"] < 5
    assert result["simplest_as_good"] == "linear"
    assert len(found["linear"]["folds"]) == 3  # as many as specimens
    rows = list(csv.DictReader((out / "comparison.csv").open()))
    assert [r["moduli"] for r in rows] == ["constant", "linear", "cubic"]
    for name in ("laws.png", "loads.png", "report.html", "linear/material.toml"):
        assert (out / name).stat().st_size > 0
    words = "form of the moduli (number of coefficients)"
    (laws,) = (c.charts[0] for c in drawn if c.charts[0].x_label == words)
    assert list(laws.x_names) == ["constant (3)", "linear (6)", "cubic (12)"]
    assert laws.y_label == result["objective_is"]
    for key in ("fitted", "cross_validated"):
        wanted = [form[key] for form in result["forms"]]
        assert any(line[1] == pytest.approx(wanted, rel=1e-5) for line in data(laws)), key
    # A result is not written over; --resume takes every form as it is.
    in_process(*arguments, cwd=tmp_path, code=2)
    before = (out / "linear" / "starts.jsonl").read_text()
    (out / "result.json").unlink()
    golden("compare", in_process(*arguments, "--resume", cwd=tmp_path).stdout, tmp_path)
    assert (out / "linear" / "starts.jsonl").read_text() == before
    assert result_in(out) == result


def test_what_cannot_be_compared_is_refused(project, tmp_path):
    (tmp_path / "p.csv").write_text(
        "direction,gauge_length_mm,final_length_mm,c1\nwarp,20,23,300\nfill,20,24,200\n"
    )
    text = project.read_text()
    for old, new, says in (
        ('files = ["points.csv"]', 'polynomials = "p.csv"', "strips[0].match"),
        ("E1 = [0.02, 2.0]\nE2 = [0.02, 1.0]\nG12 = [0.005, 0.2]",
         "lower = [0.005, 0.02, 0.02]\nupper = [0.2, 1.0, 2.0]", "E1, E2, G12"),
        ('match = "points"', 'match = "polynomial"', 'match = "points"'),
        ('name = "made"', 'name = "made"\nwidth = 3', "fabric.width"),
    ):  # fmt: skip
        project_file(tmp_path, text, (old, new))
        run = ("compare", "project.toml", "--out", "o", "--form", "constant")
        one_line(in_process(*run, cwd=tmp_path, code=2), says)
        assert not (tmp_path / "o").exists()
