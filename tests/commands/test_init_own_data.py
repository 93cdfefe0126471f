"""From files as a laboratory has them to a card: `bubblefit init --own --data FOLDER`."""

import re
import shutil
import tomllib

import numpy as np
import pytest
from bubblefit.cli import start
from bubblefit.cli.main import main
from bubblefit.errors import InputError
from bubblefit.materials.card import read_card
from bubblefit.project.data_folder import FRAMES
from bubblefit.project.project import read_project
from click.testing import CliRunner

from ..support.commands import in_process, one_line
from ..support.paths import EXAMPLES

DATA = EXAMPLES / "own-data" / "data"
#: The law of the example (MPa), by its README.
TRUTH = {
    "E1": lambda strain: 640.0 - 1800.0 * strain,
    "E2": lambda strain: 220.0 + 600.0 * strain,
    "G12": lambda strain: 18.0 - 20.0 * strain,
}


def part_of_data(place, *names):
    """Copy some files or folders of the example into place/data."""
    for name in names:
        source, target = DATA / name, place / "data" / name
        if source.is_dir():
            shutil.copytree(source, target)
        else:
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, target)
    return place / "data"


def table_of(place, name="fabric"):
    return tomllib.loads((place / name / "project.toml").read_text())


@pytest.fixture(scope="module")
def project_of_the_example(tmp_path_factory):
    """A folder with fabric/, the project of all files of the example, and what `init` printed."""
    folder = tmp_path_factory.mktemp("example")
    in_process("init", "mine", "--example", "own", cwd=folder)
    run = ("init", "fabric", "--own", "--data", "mine/data", "--thickness", 0.83)
    return folder, in_process(*run, cwd=folder).stdout


def test_from_the_example_to_a_card_with_four_commands(project_of_the_example):
    """Give the thickness alone: check finds nothing, and the card has the known moduli."""
    tmp_path, written = project_of_the_example
    assert "mine/data/bubble" not in written and f"{FRAMES}" in " ".join(written.split())
    checked = in_process("check", "fabric", cwd=tmp_path).stdout
    assert "bubble: fine: nothing doubtful" in checked and "strips: fine" in checked
    assert "error" not in checked
    fit = ("fit", "fabric", "--starts", 1, "--jobs", 1, "--quiet", "--out", "out")
    in_process(*fit, cwd=tmp_path)
    law = read_card(tmp_path / "out" / "material.toml").law
    for name, largest, tolerance in (("E1", 0.06, 0.03), ("E2", 0.09, 0.03), ("G12", 0.2, 0.04)):
        for strain in np.linspace(0.01, largest, 5):
            assert law.modulus(name, strain) == pytest.approx(TRUTH[name](strain), rel=tolerance)


def test_the_project_of_the_example_has_what_the_files_tell(project_of_the_example):
    table = table_of(project_of_the_example[0])
    bubble, strips = table["bubble"][0], table["strips"][0]
    points = bubble["data"]["points"]
    assert points["files"] == ["bubble/Bubble-*_*.csv"] and points["registration"] == {}
    assert points["pressure"]["log"] == {"file": "pressure.csv", "times": "camera.csv"}
    assert bubble["sheet"] == {"surface": "measured"}
    assert bubble["radius"] == pytest.approx(100.0, abs=0.2)
    assert strips["data"]["files"] == {
        "warp": ["strips/warp_*.csv"],
        "fill": ["strips/fill_*.csv"],
        "bias": ["strips/bias45_*.csv"],
    }
    assert (strips["width"], strips["grip_distance"]) == (50.0, 200.0)
    assert strips["warp"] == strips["bias"] == {"gauge_length": 100.0}
    for name, (least, largest) in table["law"]["bounds"].items():
        assert 0.08 * TRUTH[name](0.03) < least < TRUTH[name](0.1) / 1.5
        assert 1.5 * TRUTH[name](0.0) < largest < 12 * TRUTH[name](0.03)


def test_warp_strips_alone_are_fitted_with_a_law_of_theirs(tmp_path):
    """No bubble, no fill, no bias: no section of them, and no question for their strain range."""
    data = part_of_data(tmp_path, *(f"strips/warp_{n}.csv" for n in (1, 2, 3)))
    run = ("init", "fabric", "--own", "--data", data, "--thickness", 0.83)
    in_process(*run, cwd=tmp_path)
    table = table_of(tmp_path)
    assert "bubble" not in table and {"fill", "bias"}.isdisjoint(table["strips"][0])
    assert table["law"]["form"] == "quadratic" and len(table["law"]["strain_range"]) == 3
    assert "strips: fine" in in_process("check", "fabric", cwd=tmp_path).stdout


def test_a_bubble_alone_takes_pressures_from_names_and_marks_what_it_cannot_know(tmp_path):
    data = tmp_path / "data"
    data.mkdir()
    kpa = [0, 0, 12, 33, 58, 84, 109, 136, 161, 188, 214, 241, 266, 290, 90]
    for number, file in enumerate(sorted((DATA / "bubble").iterdir())):
        if kpa[number] > 90:
            shutil.copy(file, data / f"step_{number:02d}_{kpa[number]}.0kPa.csv")
    printed = in_process("init", "fabric", "--own", "--data", data, cwd=tmp_path).stdout
    assert "to be filled in there, or confirmed: thickness, radius" in " ".join(printed.split())
    text = (tmp_path / "fabric" / "project.toml").read_text()
    assert "# thickness = 0.8" in text and text.count("TODO") == 3  # radius is found, bounds
    refused = in_process("check", "fabric", cwd=tmp_path, code=2)
    one_line(refused, "fabric.thickness: this key is missing")
    filled = text.replace("# thickness = 0.8", "thickness = 0.83")
    (tmp_path / "fabric" / "project.toml").write_text(filled)
    table = table_of(tmp_path)
    assert table["bubble"][0]["data"]["points"]["pressure"] == {"from_name": True}
    assert "strips" not in table and len(table["law"]["strain_range"]) == 3
    assert "bubble: fine" in in_process("check", "fabric", cwd=tmp_path).stdout


def test_questions_are_asked_on_a_terminal(tmp_path, monkeypatch):
    monkeypatch.setattr(start, "on_a_terminal", lambda: True)
    data = part_of_data(tmp_path, *(f"strips/warp_{n}.csv" for n in (1, 2)))
    for file in (data / "strips").iterdir():  # a head that says nothing
        file.write_text(file.read_text().partition("\n\n")[2])
    run = ["init", str(tmp_path / "fabric"), "--own", "--data", str(data)]
    done = CliRunner().invoke(main, run, input="0.83\n50\n100\n")
    assert done.exit_code == 0, done.output
    for words in ("Thickness before the test", "Width of the strips", "Gauge length of the st"):
        assert words in done.output
    table = table_of(tmp_path)
    assert table["fabric"]["thickness"] == 0.83 and table["strips"][0]["width"] == 50.0
    assert table["strips"][0]["warp"] == {"gauge_length": 100.0}
    assert "TODO" not in (tmp_path / "fabric" / "project.toml").read_text()


@pytest.mark.parametrize("answer", [None, "y", "n"])
def test_directions_by_angles_are_asked_for_or_marked(tmp_path, monkeypatch, answer):
    """Laboratories differ in what 0 degrees is."""
    data = part_of_data(tmp_path, "strips/warp_1.csv", "strips/fill_1.csv")
    for name, angle in (("warp", 0), ("fill", 90)):
        (data / "strips" / f"{name}_1.csv").rename(data / "strips" / f"strip_{angle}deg.csv")
    monkeypatch.setattr(start, "on_a_terminal", lambda: answer is not None)
    run = ["init", str(tmp_path / "fabric"), "--own", "--data", str(data), "--thickness", "0.83"]
    run += ["--width", "50", "--gauge-length", "100"]
    done = CliRunner().invoke(main, run, input=f"{answer}\n")
    assert done.exit_code == 0, done.output
    files = table_of(tmp_path)["strips"][0]["data"]["files"]
    assert files[{"n": "fill"}.get(answer, "warp")] == ["strips/strip_0deg.csv"]
    assert ("pulled along the warp?" in done.output) == (answer is not None)
    text = (tmp_path / "fabric" / "project.toml").read_text()
    assert ("TODO: 0 degrees" in text) == (answer is None)


def check_of_tables(place, tables, *options):
    """Write tables by name, and a project for them; return its table after a check that passes."""
    for name, text in tables.items():
        (place / "data").mkdir(exist_ok=True)
        (place / "data" / name).write_text(text)
    run = ("init", "fabric", "--own", "--data", "data", "--thickness", 0.8, *options)
    in_process(*run, cwd=place)
    assert "fine: nothing doubtful" in in_process("check", "fabric", cwd=place).stdout
    return table_of(place)


def test_few_of_many_frames_under_pressure_are_all_taken(tmp_path):
    pressures = [0.0] * 8 + [0.1, 20, 60, 100, 150, 200, 280]
    files = sorted((part_of_data(tmp_path, "bubble") / "bubble").iterdir())
    for number, (file, pressure) in enumerate(zip(files, pressures, strict=True)):
        file.rename(file.with_name(f"step_{number:02d}_{pressure:g}kPa.csv"))
    in_process("init", "fabric", "--own", "--data", "data", "--thickness", 0.83, cwd=tmp_path)
    (bubble,) = table_of(tmp_path)["bubble"]
    assert bubble["pressures"] == pressures[9:]
    assert bubble["data"]["points"]["pressure"] == {"from_name": True}


def test_pressures_by_a_rate_that_is_assumed_are_not_written(tmp_path):
    part_of_data(tmp_path, "bubble", "pressure.csv")
    in_process("init", "fabric", "--own", "--data", "data", "--thickness", 0.83, cwd=tmp_path)
    (bubble,) = table_of(tmp_path)["bubble"]
    assert "pressures" not in bubble and bubble["data"]["points"]["pressure"]["frames"] == 12


APEX = (9.6, 12.1, 15.2, 18.3)
PRESSURES = (10, 20, 40, 70)


def test_a_spreadsheet_of_pressure_and_apex_height_is_a_balanced_sheet(tmp_path):
    rows = [f"{p};{h:.2f}".replace(".", ",") for p, h in zip(PRESSURES, APEX, strict=True)]
    text = "\n".join(["Druck (kPa);Stich (mm)", *rows])
    table = check_of_tables(tmp_path, {"test.csv": text}, "--radius", 100)
    assert table["law"]["symmetry"] == "balanced" and {*table["law"]["bounds"]} == {"E1", "G12"}
    assert table["bubble"][0]["data"]["heights"]["files"] == ["test.csv"]
    low, high = table["law"]["bounds"]["E1"]
    assert 3 * low < 450 < high / 3


@pytest.mark.parametrize(("unit", "power"), [("1/mm", 1), ("mm", -1)])
def test_a_table_of_the_apex_passes_the_check(tmp_path, unit, power):
    rows = [
        f"{p},{(2 * h / 100**2) ** power},{2 / 3 * (h / 100) ** 2}"
        for p, h in zip(PRESSURES, APEX, strict=True)
    ]
    text = "\n".join([f"p (kPa),curvature warp ({unit}),strain warp (mm/mm)", *rows])
    (bubble,) = check_of_tables(tmp_path, {"apex.csv": text}, "--radius", 100)["bubble"]
    assert bubble["data"]["apex"]["files"] == ["apex.csv"] and "sheet" not in bubble


def test_places_of_gauges_that_no_heading_tells_are_to_be_filled_in(tmp_path):
    (tmp_path / "data").mkdir()
    rows = [f"{p},{h},{0.76 * h:.2f}" for p, h in zip(PRESSURES, APEX, strict=True)]
    table = "\n".join(["p (kPa),Laser 1 (mm),Laser 2 (mm)", *rows])
    (tmp_path / "data" / "gauges.csv").write_text(table)
    sizes = ("--thickness", 0.8, "--radius", 100)
    in_process("init", "fabric", "--own", "--data", "data", *sizes, cwd=tmp_path)
    (bubble,) = table_of(tmp_path)["bubble"]
    assert "places" not in bubble["data"]["heights"] and {*table_of(tmp_path)["law"]["bounds"]}
    refused = in_process("check", "fabric", cwd=tmp_path, code=2)
    one_line(refused, "places gives [x, y] of each")


def test_gauges_and_profiles_are_one_bubble(tmp_path):
    rows = [f"{p},{h},{0.76 * h:.2f}" for p, h in zip(PRESSURES, APEX, strict=True)]
    heights = "\n".join(["p (kPa),apex (mm),warp 50 (mm)", *rows])
    scan = [(x, h * (1 - (x / 100) ** 2)) for h in APEX for x in (-60, -30, 0, 30, 60)]
    lines = [f"{x},{z:.2f},{PRESSURES[k // 5]}" for k, (x, z) in enumerate(scan)]
    profiles = "\n".join(["x (mm),z (mm),p (kPa)", *lines])
    tables = {"gauges.csv": heights, "scan.csv": profiles}
    table = check_of_tables(tmp_path, tables, "--radius", 100)
    (bubble,) = table["bubble"]
    assert bubble["data"]["heights"]["places"] == [[0.0, 0.0], [50.0, 0.0]]
    assert bubble["data"]["profiles"]["files"] == ["scan.csv"]
    assert "symmetry" not in table["law"]


def test_strips_at_any_angle_go_by_their_angle(tmp_path, monkeypatch):
    name = "nylon_{}_1.csv"
    stiffness = {0: 3000, 15: 2000, 45: 900, 90: 2500}
    (tmp_path / "data").mkdir()
    for angle, load in stiffness.items():
        rows = [f"{x:.1f},{load * x / 8:.1f}" for x in np.linspace(0, 8, 17)]
        text = "\n".join(["elongation (mm),force (N)", *rows])
        (tmp_path / "data" / name.format(angle)).write_text(text)
    sizes = ("--thickness", 0.8, "--width", 50, "--gauge-length", 100, "--grip-distance", 200)
    in_process("init", "fabric", "--own", "--data", "data", *sizes, cwd=tmp_path)
    project = read_project(tmp_path / "fabric" / "project.toml")
    assert [*project.tests["strips"].strips] == ["warp", "fill", "bias", "15 degrees"]
    directions = table_of(tmp_path)["strips"][0]["data"]["directions"]
    assert directions == {str(angle): [name.format(angle)] for angle in stiffness}
    assert "TODO: 0 degrees" in (tmp_path / "fabric" / "project.toml").read_text()
    monkeypatch.setattr(start, "on_a_terminal", lambda: True)
    run = ["init", str(tmp_path / "turned"), "--own", "--data", str(tmp_path / "data")]
    answers = "0.8\n50\n100\n200\nn\n"
    assert CliRunner().invoke(main, run, input=answers).exit_code == 0
    directions = table_of(tmp_path, "turned")["strips"][0]["data"]["directions"]
    assert directions["75"] == [name.format(15)] and directions["90"] == [name.format(0)]


def test_files_that_no_direction_or_reader_is_known_for_are_named(tmp_path):
    data = tmp_path / "data"
    data.mkdir()
    text = (DATA / "strips" / "warp_1.csv").read_text().replace("Kette", "")
    (data / "warp_1.csv").write_text(text)
    (data / "specimen A.csv").write_text(text)
    (data / "photo.png").write_bytes(b"\x89PNG\r\n")
    run = ("init", "fabric", "--own", "--data", data, "--thickness", 0.83)
    printed = " ".join(in_process(*run, cwd=tmp_path).stdout.split())
    assert "photo.png (1): not used: " in printed
    text = (tmp_path / "fabric" / "project.toml").read_text()
    assert "# TODO: specimen A.csv: is it warp, fill or bias?" in text
    (data / "warp_1.csv").unlink()
    refused = in_process("init", "new", "--own", "--data", data, cwd=tmp_path, code=2)
    assert refused.stderr.count("no test is recognised") == 1
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("unit", [None, "kN"])
def test_unit_of_loads_that_no_file_names_is_left_to_the_user(tmp_path, unit):
    data = part_of_data(tmp_path, "strips/warp_1.csv")
    file = data / "strips" / "warp_1.csv"
    file.write_text(file.read_text().replace("s;mm;N\n", "s;mm;\n"))
    run = ["init", "fabric", "--own", "--data", data, "--thickness", 0.83]
    done = in_process(*run, *(["--load-unit", unit] if unit else []), cwd=tmp_path)
    text = (tmp_path / "fabric" / "project.toml").read_text()
    if unit:
        assert table_of(tmp_path)["strips"][0]["data"]["load_unit"] == "kN"
        return
    assert "confirmed: load_unit" in " ".join(done.stdout.split())
    assert "# TODO: they are for loads in N: " in text
    refused = in_process("check", "fabric", cwd=tmp_path, code=2)
    one_line(refused, "load_unit")
    filled = re.sub(r'^# load_unit = "N" +# TODO.*$', 'load_unit = "N"', text, flags=re.MULTILINE)
    (tmp_path / "fabric" / "project.toml").write_text(filled)
    assert "strips: fine" in in_process("check", "fabric", cwd=tmp_path).stdout


def test_unit_of_a_pressure_log_that_names_none_is_left_to_the_user(tmp_path, monkeypatch):
    """A log in bar that is taken for kPa would make every modulus a hundred times too small."""
    shutil.copytree(DATA, tmp_path / "data")
    shutil.rmtree(tmp_path / "data" / "strips")
    log = tmp_path / "data" / "pressure.csv"
    log.write_text(log.read_text().replace("Druck [bar]", "Druck"))
    run = ["init", "fabric", "--own", "--data", "data"]
    run += ["--thickness", "0.83", "--radius", "100"]
    done = in_process(*run, cwd=tmp_path)
    assert "confirmed: pressure_unit" in " ".join(done.stdout.split())
    one_line(in_process("check", "fabric", cwd=tmp_path, code=2), "say the unit of the readings")
    text = (tmp_path / "fabric" / "project.toml").read_text()
    assert "multiply those of E1 and E2 by 100 for bar" in text
    shutil.rmtree(tmp_path / "fabric")
    monkeypatch.setattr(start, "on_a_terminal", lambda: True)
    monkeypatch.chdir(tmp_path)
    asked = CliRunner().invoke(main, run, input="bar\n")
    assert asked.exit_code == 0 and "Unit of the pressure log" in asked.output, asked.output
    table = table_of(tmp_path)
    log_of_project = table["bubble"][0]["data"]["points"]["pressure"]["log"]
    assert log_of_project["pressure"] == {"unit": "bar"}
    assert max(table["bubble"][0]["pressures"]) > 200.0
    low, high = table["law"]["bounds"]["E1"]
    assert low < 640.0 < high


def test_frames_that_name_their_pressure_need_no_log(tmp_path):
    """A log beside them, by a clock that nothing ties to the frames, is not taken."""
    data = tmp_path / "data"
    data.mkdir()
    x, y = (90.0 * c for c in np.meshgrid(*[np.linspace(-1.0, 1.0, 15)] * 2))
    flat = np.column_stack([x.ravel(), y.ravel()])[np.hypot(x, y).ravel() < 98.0]
    parabola = 1.0 - (flat**2).sum(axis=1, keepdims=True) / 1e4
    for number, mbar in enumerate((0, 500, 1000, 1500)):
        rise, strain = 0.02 * mbar, 0.06 * (mbar / 1500) ** 2
        heights = np.zeros((len(flat), 1))
        columns = [flat, heights, strain * parabola * flat, rise * parabola]
        rows = [";".join(f"{value:.4f}" for value in row) for row in np.hstack(columns)]
        head = [f"Druck [mbar];{mbar}", "X [mm];Y [mm];Z [mm];dX [mm];dY [mm];dZ [mm]"]
        (data / f"Probe1_{number:03d}.csv").write_text("\n".join([*head, *rows]))
    log = ["Zeit [s];Druck [mbar]", *(f"{t};{50 * t}" for t in range(40))]
    (data / "Druck1.csv").write_text("\n".join(log))
    run = ("init", "fabric", "--own", "--data", data, "--thickness", 0.8, "--radius", 100)
    in_process(*run, cwd=tmp_path)
    (bubble,) = table_of(tmp_path)["bubble"]
    assert bubble["pressures"] == [50.0, 100.0, 150.0]
    assert bubble["data"]["points"]["pressure"] == {"column": "Druck"}
    assert "Next: " in in_process("check", "fabric", cwd=tmp_path).stdout


def test_each_of_two_bubbles_has_its_log_and_times(tmp_path, monkeypatch):
    monkeypatch.setattr(start, "_law_for_data", lambda project: {})
    data = tmp_path / "data"
    log = (DATA / "pressure.csv").read_text()
    for number in (1, 2):
        shutil.copytree(DATA / "bubble", data / f"bubble{number}")
        shutil.copy(DATA / "camera.csv", data / f"camera{number}.csv")
        unit = {1: "bar", 2: "psi"}[number]
        (data / f"Druck{number}.csv").write_text(log.replace("Druck [bar]", f"Druck [{unit}]"))
    run = ("init", "fabric", "--own", "--data", data, "--thickness", 0.83, "--radius", 100)
    in_process(*run, cwd=tmp_path)
    bubbles = table_of(tmp_path)["bubble"]
    for number, bubble in enumerate(bubbles, 1):
        points = bubble["data"]["points"]
        assert points["files"] == [f"bubble{number}/Bubble-*_*.csv"]
        names = {"file": f"Druck{number}.csv", "times": f"camera{number}.csv"}
        assert points["pressure"]["log"] == names
    first, second = (max(bubble["pressures"]) for bubble in bubbles)
    assert second / first == pytest.approx(0.0689476, rel=0.01)
    project = read_project(tmp_path / "fabric" / "project.toml")
    assert [1e3 * max(test.pressures) for test in project.tests.values()] == pytest.approx(
        [first, second], rel=1e-3
    )


def test_examples_of_init_have_no_broken_links(tmp_path):
    for example in start.KINDS:
        in_process("init", example, "--example", example, cwd=tmp_path)
        text = (tmp_path / example / "README.md").read_text()
        for target in re.findall(r"\]\(([^)]+)\)", text):
            assert target.startswith("https://"), (example, target)
        assert not re.search(r"\bdocs/(how-to|reference|validation)", text), example
        for page in re.findall(r"`bubblefit docs ([\w/-]+)`", text):
            assert page in start.pages(), (example, page)


@pytest.mark.parametrize("example", ["measured", "joint"])
def test_examples_without_their_data_say_so_first(tmp_path, example):
    printed = in_process("init", "mine", "--example", example, cwd=tmp_path).stdout
    assert "note: its data are no part of bubblefit: README.md says where they are" in printed
    paragraphs = (tmp_path / "mine" / "README.md").read_text().split("\n\n")
    assert "data are not part of bubblefit" in paragraphs[1]
    assert "https://github.com/cjekel/inv_bubble_opt" in paragraphs[1]


def test_the_data_of_the_example_are_small():
    assert sum(file.stat().st_size for file in DATA.rglob("*.csv")) < 1_500_000


def test_a_data_folder_needs_own(tmp_path):
    with pytest.raises(InputError, match="means nothing without --own"):
        start.init_command.callback(tmp_path, None, False, None, data=DATA)


def test_number_of_tests_is_refused_beside_files_that_tell_it(tmp_path):
    run = ("init", "mine", "--own", "--data", DATA, "--bubble", 3, "--thickness", 0.8)
    one_line(in_process(*run, cwd=tmp_path, code=2), "--bubble: goes without --data")
