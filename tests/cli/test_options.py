"""Options that commands share: the live line of progress, and arguments that are refused."""

import contextlib
import shlex
import time

import bubblefit as bf
import pytest
from bubblefit import compilation
from bubblefit.cli.options import COMPILING, LiveLine
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.runs.starts import EvaluationRecord, StartRecord

from ..support.commands import in_process, one_line
from ..support.refusals import refused

ENDED = StartRecord(1, (1, 1), 0.25, "done", 1, (), (), 0.1)


def analysis(start, objective):
    return EvaluationRecord(start, 1, objective, "ok", (), ())


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])

    def pass_by(seconds):
        now[0] += seconds

    return pass_by


def test_live_line_shows_running_start_from_its_first_analysis(clock):
    shown = LiveLine("starts", True, 4)
    said = []
    records = [None, analysis(0, 2.98), analysis(1, 0.5), analysis(1, None), ENDED]
    for record in [*records, analysis(0, 0.125)]:
        shown(record)
        said.append(shown.note)
        clock(2.0)
    unknown = "time left not known yet"
    assert said == [
        unknown,
        f"start 0 at 2.98, 1 analysis, {unknown}",
        f"start 1 at 0.5, 2 analyses, {unknown}",
        f"start 1 at a failure, 3 analyses, {unknown}",
        "best 0.25, 3 analyses, 24 s left",
        "best 0.25, start 0 at 0.125, 4 analyses, 30 s left",
    ]


def test_progress_is_a_plain_line_per_minute_without_a_terminal(clock, capsys):
    shown = LiveLine("starts", False, 4)
    for _ in range(59):
        shown(analysis(0, 0.5))
        clock(1.0)
    assert capsys.readouterr().err == ""
    clock(1.0)
    shown(analysis(0, 0.25))
    line = "0 of 4 starts, start 0 at 0.25, 60 analyses, time left not known yet\n"
    assert capsys.readouterr() == ("", line)
    shown(analysis(0, 0.125))
    assert capsys.readouterr().err == ""


def test_compilation_is_announced_until_kernels_are_cached(tmp_path, monkeypatch, capsys):
    def said(quiet):
        with LiveLine("starts", quiet, 1):
            return capsys.readouterr().err

    monkeypatch.setattr(compilation, "kernel_folder", lambda: tmp_path)
    assert (said(False), said(True)) == (f"{COMPILING}\n", "")
    (tmp_path / "membrane").mkdir()
    (tmp_path / "membrane" / "kernel.assemble.1.nbc").touch()
    assert said(False) == ""
    monkeypatch.setattr(compilation, "kernel_folder", lambda: None)
    assert said(False) == f"{COMPILING}\n"


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
def test_run_that_cannot_begin_is_one_line_and_leaves_nothing(desk, typed, field):
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
def test_impossible_arguments_are_named(desk, field, call):
    with contextlib.chdir(desk):
        before = sorted(desk.rglob("*"))
        project, card = bf.read_project("known/project.toml"), bf.read_card("card.toml")
        caught = refused(call, project, card)
    assert caught.field.split(".")[-1].split(", ")[-1] == field, caught
    assert sorted(desk.rglob("*")) == before
