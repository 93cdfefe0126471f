"""Commands as a user runs them: files, interruption, mistyped words, help and its examples."""

import contextlib
import json
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import bubblefit as bf
import click
import pandas as pd
import pytest
from bubblefit.cli.main import main
from bubblefit.cli.terminal import HEAD, LOGGER
from bubblefit.materials.card import MaterialCard, read_card
from bubblefit.materials.law import HypoelasticLaw
from click.testing import CliRunner

from ..builders.projects import CONSTANT_BUBBLE, known_bubble, known_bubble_of_form
from ..support import needs
from ..support.commands import every_command, in_process, interrupted, one_line, result_in
from ..support.paths import ROOT
from ..support.refusals import refused


def run(*arguments):
    return CliRunner().invoke(main, arguments)


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("bubbel", "bubbel: no such command; did you mean 'bubble'? (bubblefit --help "),
        ("zzz", "zzz: no such command (bubblefit --help "),
        ("study mash", "mash: no such command; did you mean 'mesh'? (bubblefit study --help "),
        ("dic spheer", "spheer: no such command; did you mean 'sphere'? (bubblefit dic --help "),
        ("fit a.toml --strats 3", "--strats: no such option of bubblefit fit; did you mean"
         " '--starts'? (bubblefit fit --help "),
        ("--verbos", "--verbos: no such option of bubblefit; did you mean '--verbose'?"),
        ("fit a.toml --starts 0", "--starts: 0 is not in the range x>=1 (bubblefit fit --help "),
        ("fit a.toml --starts", "--starts: requires an argument"),
        ("fit", "PROJECT: is missing (bubblefit fit --help "),
        ("simulate bubble a.toml", "--card: is missing (bubblefit simulate bubble --help "),
        ("fit a.toml b.toml", "got unexpected extra argument (b.toml) (bubblefit fit --help "),
        ("simulate bend --diameter wide", "--diameter: 'wide' is not a valid float"),
        ("fit none.toml", "none.toml: "),
    ],
)  # fmt: skip
def test_what_was_mistyped_is_one_line_as_any_bad_input(typed, said):
    done = run(*typed.split())
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.startswith(f"bubblefit: {said}") and done.stderr.count("\n") == 1


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    place = tmp_path_factory.mktemp("desk")
    for name in ("known", "uniaxial", "biaxial", "bend"):
        in_process("init", name, "--example", name, cwd=place)
    MaterialCard(HypoelasticLaw.linear(700.0, 150.0, 20.0), 0.81).write(place / "card.toml")
    (place / "file").write_text("x")
    (place / "empty.csv").write_text("")
    (place / "bytes.toml").write_bytes(b"\x00\xff" * 9)
    (place / "folder").mkdir()
    return place


FIT, CARD, BEND = "fit known/project.toml", "--card card.toml", "simulate bend --diameter 150"


@pytest.mark.parametrize(
    ("typed", "field"),
    [
        (f"{FIT} --method lmm", "fit.method"), (f"{FIT} --method ''", "method"),
        (f"{FIT} --out file", "--out"), (f"{FIT} --out file/below", "--out"),
        (f"{FIT} --resume --overwrite", "--overwrite"),
        (f"{FIT} --test nobody", "--test"), (f"{FIT} --trust weather", "fit.trust"),
        (f"{FIT} --data folder", "bubble[0].data"),
        (f"{FIT} --starts-from sofa", "sofa"), (f"{FIT} --solver sofa", "sofa"),
        (f"{FIT} --solver-option x=1", "x"), (f"{FIT} --fail-above nan", "--fail-above"),
        ("fit folder", "folder"), ("fit bytes.toml", "bytes.toml"), ("fit ''", "PROJECT"),
        ("bubble uniaxial/project.toml", "bubble"),
        ("check known/project.toml --out file", "--out"),
        ("biaxial biaxial/project.toml --out file", "--out"),
        ("compare uniaxial/project.toml --form septic", "septic"),
        (f"profile known/project.toml {CARD} --modulus E9", "E9"),
        (f"bootstrap known/project.toml {CARD} --samples 1", "--samples"),
        (f"plan known/project.toml {CARD} --noise bubble=-1", "--noise"),
        (f"study nu12 known/project.toml {CARD} --nu12 nan", "nu12"),
        (f"simulate bubble known/project.toml {CARD} {CARD}", "--card"),
        (f"simulate bubble known/project.toml {CARD} --out file", "--out"),
        ("simulate bubble known/project.toml --card empty.csv", "empty.csv"),
        (f"{BEND} --pressure -1 {CARD}", "--pressure"), ("report folder", "folder"),
        *((f"{BEND} --pressure 140 {CARD} {options}", field) for options, field in (
            ("--measured folder", "folder"), ("--diameter -1", "--diameter"),
            ("--diameter 300", "inner_diameter"), ("--span 2990", "--span"),
            ("--seam-width 500", "--seam-width"), ("--frames 0", "--frames"),
            ("--measured none.csv", "--measured"), ("--collar 140 100", "--collar"),
            ("--card none.toml", "none.toml"))),
        *((f"bend bend/project.toml {options}", field) for options, field in (
            ("--card nobody", "nobody"), ("--fail-above 0.1", "--fail-above"),
            ("--fail-above -1", "--fail-above"), ("--ccx x", "--ccx"))),
        *((f"export card.toml --format {options}", field) for options, field in (
            ("csv --out card.toml", "--out"), ("csv --out ./card.toml --force", "--out"),
            ("csv --out file/t.csv", "--out"), ("abaqus-umat --out law.inp", ".f"),
            ("calculix --points 50", "--points"), ("marc --measure true", "--measure"))),
        *((f"init new --own {options}", field) for options, field in (
            ("--bubble 1 --thickness -1", "thickness"), ("", "--own"),
            ("--bubble 1 --form quartic", "--form"), ("--bubble 1 --pressures 1,b", "--pressures"),
            ("--bubble 1 --pressures 60,20", "pressures"), ("--bubble 1 --radius -1", "radius"),
            ("--bubble 1 --example known", "--own"))),
        ("init ''", "FOLDER"), ("init other --radius 3", "--own"), ("init known --own", "known"),
        ("docs nowhere", "nowhere"),
        *((f"cache --folder folder {option} {value}", option) for option, value in (
            ("--prune", "much"), ("--prune", "-1GB"), ("--limit", "'2 K'"), ("--older", "30"))),
        ("gauge empty.csv --lower 0 0 --upper 0 9 --out g.csv", "empty.csv"),
        ("dic sphere folder", "folder"), ("schema --out folder", "folder"),
    ],
)  # fmt: skip
def test_a_run_that_cannot_begin_is_one_line_and_leaves_nothing(desk, typed, field):
    before = sorted(desk.rglob("*"))
    done = in_process(*shlex.split(typed), cwd=desk, code=2)
    one_line(done, field)
    assert done.stderr.startswith("bubblefit: ") and done.stdout == ""
    assert sorted(desk.rglob("*")) == before


@pytest.mark.parametrize(
    ("field", "call"),
    [
        ("starts", lambda p, c: bf.fit(p, starts=0)), ("jobs", lambda p, c: bf.fit(p, jobs=-1)),
        ("starts", lambda p, c: bf.fit(p, starts=2.5)), ("seed", lambda p, c: bf.fit(p, seed=-1)),
        ("project", lambda p, c: bf.fit("x.toml")), ("tests", lambda p, c: bf.fit(p, 3)),
        ("method", lambda p, c: bf.fit(p, method="lmm")), ("out", lambda p, c: bf.fit(p, out=3)),
        ("starts_from", lambda p, c: bf.fit(p, starts_from="x")),
        ("trust", lambda p, c: bf.fit(p, trust="preload")),
        ("resume", lambda p, c: bf.fit(p, resume=True)),
        ("overwrite", lambda p, c: bf.fit(p, out="o", resume=True, overwrite=True)),
        ("progress", lambda p, c: bf.fit(p, progress=3)),
        ("test", lambda p, c: bf.simulate("bubble", c)),
        ("card", lambda p, c: bf.simulate(p.tests["bubble"], "card.toml")),
        ("solver", lambda p, c: bf.simulate(p.tests["bubble"], c, solver=3)),
        ("cards", lambda p, c: bf.predict(p, cards={"a": "card.toml"})),
        ("jobs", lambda p, c: bf.predict(p, cards={"a": c}, jobs="2")),
        ("over", lambda p, c: bf.bootstrap(p, 3)), ("card", lambda p, c: bf.plan(p, 3)),
        ("strain", lambda p, c: bf.plan(p, c, strain=0.1)), ("path", lambda p, c: bf.read_card(3)),
        ("moduli", lambda p, c: bf.profile(p, {"E1": 0.1})),
        ("path", lambda p, c: bf.read_project(None)),
        ("data", lambda p, c: bf.read_project("p.toml", data=3)),
    ],
)  # fmt: skip
def test_arguments_that_cannot_be_are_named(desk, field, call):
    with contextlib.chdir(desk):
        before = sorted(desk.rglob("*"))
        project, card = bf.read_project("known/project.toml"), bf.read_card("card.toml")
        caught = refused(call, project, card)
    assert caught.field.split(".")[-1].split(", ")[-1] == field, caught
    assert sorted(desk.rglob("*")) == before


def test_umlauts_in_paths_where_the_locale_is_ascii(tmp_path):
    """Write the page although a part of the path is UTF-8 and another Latin-1."""
    names = ("Prüfung".encode(), "Prüfung".encode("latin-1"))
    (place := tmp_path.joinpath(*map(os.fsdecode, names))).mkdir(parents=True)
    (place / "project.toml").write_text(CONSTANT_BUBBLE)
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = subprocess.run(
        [sys.executable, "-m", "bubblefit", "fit", place / "project.toml", "--out",
         place / "out", "--starts", "1", "--jobs", "1"],
        capture_output=True, env={**os.environ, **plain}, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    told = json.loads((place / "out" / "provenance.json").read_text())["project"]["file"]
    file = str(place / "project.toml").encode(errors="surrogateescape")
    assert told == file.decode(errors="replace")
    assert (place / "out" / "report.html").is_file()


EVERY = {"": main, **{" ".join(path): command for path, command in every_command(main)}}
ALIASES = {"simulate strips": "simulate uniaxial"}


@pytest.mark.parametrize("name", EVERY)
def test_the_help_of_every_command_has_examples_that_can_be_typed(name):
    """Each is of this command, and click can parse it: options, choices, numbers, arguments."""
    shown = run(*name.split(), "--help").stdout
    typed = EVERY[name].epilog.partition(f"{HEAD}\n")[2]
    lines = [line.strip() for line in typed.splitlines() if line.strip()]
    assert lines and HEAD in shown
    for line in lines:
        assert f"    {line}\n" in shown, "click has wrapped it"
        assert line.startswith(f"bubblefit {ALIASES.get(name, name)}".rstrip()), line
        parse(line)


def parse(line):
    command = main
    ctx, words = None, shlex.split(line)[1:]
    while True:
        if words[-1:] == ["--help"]:
            return
        ctx = command.make_context(command.name, [*words], parent=ctx)
        if not isinstance(command, click.Group):
            return
        name, *words = [*ctx._protected_args, *ctx.args]
        found = command.get_command(ctx, name)
        assert found is not None, line
        command = found


def test_bash_completes():
    bash = needs.program("bash", package="bash")
    documented = 'eval "$(_BUBBLEFIT_COMPLETE=bash_source bubblefit)"'
    assert documented in (ROOT / "docs/how-to/terminal.md").read_text()
    script = f"""{documented}
COMP_WORDS=(bubblefit export a.toml --format gs); COMP_CWORD=4
_bubblefit_completion bubblefit; echo "${{COMPREPLY[@]}}"
"""
    own = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        [bash, "-c", script], capture_output=True, text=True, env={**os.environ, "PATH": own}
    )
    assert done.stdout.split() == ["gsa"], done.stderr


def test_verbose_tells_every_analysis_start_and_time(tmp_path, monkeypatch):
    """After the command's name as before it; on stderr, so that stdout stays for results."""
    monkeypatch.setattr(LOGGER, "level", LOGGER.level)
    monkeypatch.setattr(LOGGER, "handlers", list(LOGGER.handlers))
    project = known_bubble_of_form(tmp_path, 'form = "constant"')
    arguments = ("fit", project, "--out", "out", "--starts", 1, "--jobs", 1, "--verbose")
    done = in_process(*arguments, cwd=tmp_path)
    rows = (tmp_path / "out/history.csv").read_text().splitlines()[1:]
    for number, row in enumerate(rows, 1):
        value = row.split(",")[4]
        said = f"objective {float(value):.6g}, ok" if value else "failed, no equilibrium at "
        assert f" start 0, analysis {number} by membrane: {said}" in done.stderr
    assert " start 0 ended: " in done.stderr and f"; {len(rows)} analyses in " in done.stderr
    for part in ("tests and their data", "all starts", "card, tables and figures in out"):
        assert f" {part}" in done.stderr
    assert "start 0, analysis" not in done.stdout
    # All notes, where there would be one and a count.
    assert done.stdout.count("note: ") >= 2 and "further note" not in done.stdout
    assert " analysis " not in in_process("doctor", cwd=tmp_path).stderr


def test_a_new_interpreter_says_what_this_one_says(tmp_path):
    """Exit code, stdout and stderr of `in_process` are those of the real command."""
    (tmp_path / "bad.toml").write_text("[fabric]\nthikness = 1\n")
    for arguments, code in ((("cache", "--folder", "runs"), 0), (("fit", "bad.toml"), 2)):
        module = "bubblefit" if code else "bubblefit.cli"
        done = subprocess.run(
            [sys.executable, "-m", module, *arguments], cwd=tmp_path, capture_output=True, text=True
        )
        same = in_process(*arguments, cwd=tmp_path, code=code)
        assert (done.returncode, done.stdout, done.stderr) == (code, same.stdout, same.stderr)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    done = in_process("bubble", known_bubble(folder), "--out", "out", "--starts", 4, cwd=folder)
    return folder, done.stdout


def test_a_study_writes_everything_it_promises(study, golden):
    folder, text = study
    golden("bubble", text, folder)
    out = folder / "out"
    result = result_in(out)
    for key in (
        "command", "solver", "method", "objective", "beta", "starts", "analyses",
        "external_runs", "strain_reached", "wall_s", "versions", "moduli_error",
    ):  # fmt: skip
        assert key in result, key
    assert result["beta"]["unit"] == "GPa" and len(result["beta"]["values"]) == 12
    assert len(result["starts"]) == 4
    assert all({"seed", "objective", "status", "analyses"} <= set(s) for s in result["starts"])
    assert result["objective"] < 1e-6
    assert max(result["moduli_error"].values()) < 1e-3
    assert result["analyses"] == sum(s["analyses"] for s in result["starts"])
    card = read_card(out / "material.toml")
    assert card.law.beta / 1e3 == pytest.approx(result["beta"]["values"], rel=1e-12)
    assert len(pd.read_csv(out / "history.csv")) == result["analyses"]
    surfaces = pd.read_csv(out / "surfaces.csv")
    assert len(surfaces) == 21 and surfaces["R2"].min() > 0.99
    for name in ("optima.png", "moduli.png", "profiles.png", "heights.png", "report.html"):
        assert (out / name).stat().st_size > 1000, name
    assert (out / "bubble.pvd").read_text().count("<DataSet") == 7
    assert not list(out.glob("*.part")) and not list(out.glob(".*"))


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_interrupted_and_resumed_ends_the_same(study, tmp_path, number):
    folder, _ = study
    arguments = ["bubble", str(folder / "project.toml"), "--out", "out", "--starts", "4"]
    starts = tmp_path / "out" / "starts.jsonl"

    def a_start_is_stored():
        return starts.exists() and "\n" in starts.read_text()

    ended = interrupted(*arguments, cwd=tmp_path, when=a_start_is_stored, number=number)
    assert ended.returncode == (130 if number == signal.SIGINT else -signal.SIGKILL)
    rows = (tmp_path / "out" / "history.csv").read_text().splitlines()
    assert rows[0].startswith("start,analysis,solver,mesh,objective,status") and len(rows) > 3
    assert not (tmp_path / "out" / "result.json").exists()
    in_process(*arguments, "--resume", cwd=tmp_path)
    assert (tmp_path / "out/history.csv").read_text() == (folder / "out/history.csv").read_text()
    ours, theirs = (result_in(where / "out") for where in (tmp_path, folder))
    for key in ("objective", "beta", "starts", "analyses", "strain_reached", "moduli_error"):
        assert ours[key] == theirs[key], key


def test_more_starts_by_resuming_json_and_fail_above(study, tmp_path):
    folder, _ = study
    run = ("bubble", folder / "project.toml", "--out", "out", "--jobs", 1, "--json", "--starts")
    done = in_process(*run, 2, "--fail-above", 1e-3, cwd=tmp_path)
    assert json.loads(done.stdout)["command"] == "bubble"
    done = in_process(*run, 4, "--resume", "--fail-above", 1e-30, cwd=tmp_path, code=1)
    assert "--fail-above" in done.stderr
    assert (tmp_path / "out/history.csv").read_text() == (folder / "out/history.csv").read_text()


def test_simulate_with_a_card(study, tmp_path, golden):
    folder, _ = study
    card = folder / "out" / "material.toml"
    run = ("simulate", "bubble", folder / "project.toml", "--card", card, "--out", "sim")
    golden("simulate-bubble", in_process(*run, cwd=tmp_path).stdout, tmp_path)
    result = result_in(tmp_path / "sim")
    assert result["apex_mm"] == sorted(result["apex_mm"])
    table = pd.read_csv(tmp_path / "sim/displacement.csv")
    assert table["dz_mm"].max() == pytest.approx(max(result["apex_mm"]), rel=1e-6)
    # A negative G12 is refused before any analysis.
    values = ", ".join(map(str, [0, 0, 0, -1e-3, 0, 0, 0, 0.1, 0, 0, 0, 0.1]))
    bad = re.sub(r"beta = \[.*?\]", f"beta = [{values}]", card.read_text(), flags=re.S)
    (tmp_path / "bad.toml").write_text(bad)
    done = in_process(*run[:4], tmp_path / "bad.toml", "--out", "none", cwd=tmp_path, code=2)
    one_line(done, "bad.toml", "G12 is -1 MPa")
    assert not (tmp_path / "none").exists()


def test_no_feasible_start_is_exit_code_3(tmp_path):
    # G12 between its bounds is negative at the end of the strain range whatever the draw.
    project = known_bubble(tmp_path, ("7.0e-3,     # G12", "7.0e-3,  # G12"), (
        "0.0,   1.0,   0.0, 7.0e-2", "0.0, 1e-9, -0.29, 7.1e-3"))  # fmt: skip
    run = ("bubble", project, "--out", "out", "--starts", 1)
    one_line(in_process(*run, cwd=tmp_path, code=3), "feasible")


@pytest.mark.slow
def test_the_example_recovers_the_known_solution_from_other_data(tmp_path):
    """Finer mesh and other increments: the fit cannot be exact, and says how far off it is.

    As the example's README and docs/validation/results.md say: e = 0.0065, moduli off by 0.6, 0.3
    and 5.1 % (the mesh error taken out).
    """
    project = known_bubble(
        tmp_path,
        ("# elements = 1800", "elements = 1800"),
        ("# increments = [4,", "increments = [4,"),
    )
    text = project.read_text().replace("elements = 48", "elements = 800", 1)
    project.write_text(text)
    in_process("bubble", project, "--out", "out", "--starts", 1, cwd=tmp_path)
    result = result_in(tmp_path / "out")
    assert result["objective"] == pytest.approx(0.0065, abs=5e-5)
    error = result["moduli_error"]
    assert error["E1"] == pytest.approx(0.0061, abs=5e-4)
    assert error["E2"] == pytest.approx(0.0030, abs=5e-4)
    assert error["G12"] == pytest.approx(0.051, abs=5e-3)
