"""Fixtures of several folders: data, programs, golden files, and two small fits."""

import os
import sys
from types import SimpleNamespace

import bubblefit as bf
import pytest
from bubblefit.reports import html, vega
from bubblefit.solvers.run_cache import OFF, VARIABLE
from hypothesis import settings
from threadpoolctl import threadpool_limits

from .builders.bars import BarSolver, known_bars
from .builders.projects import constant_strips, known_bubble
from .support import needs, rounding, shared_work
from .support.charts import check_charts
from .support.golden import Golden

# A test that runs another program means the run; those of the cache of runs name a folder for it.
os.environ[VARIABLE] = OFF
# The first call of a kernel compiles it, or reads it from the cache.
settings.register_profile("bubblefit", deadline=None)
settings.load_profile("bubblefit")


@pytest.fixture(autouse=True, scope="session")
def disturbed_data():
    """Disturb all data by the share that the environment names: `make test-rounding`."""
    with pytest.MonkeyPatch.context() as patch:
        if share := os.environ.get(rounding.VARIABLE):
            rounding.disturb_data(patch, float(share))
        yield


@pytest.fixture(autouse=True, scope="session")
def drawings(tmp_path_factory):
    """Draw each kind of chart once, except in tests/reports."""
    folder = shared_work.folder_of_run(tmp_path_factory) / "drawings"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(vega, "convert", shared_work.Drawings(vega.convert, folder))
        patch.setattr(html, "data_uri", shared_work.Pictures(html.data_uri))
        yield


@pytest.fixture(autouse=True, scope="session")
def unflushed():
    """Leave what tests write to the system: no test takes the power away."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda number: None)
        yield


@pytest.fixture(autouse=True, scope="session")
def one_thread():
    """As in a study: BLAS threads on so small a band cost more than they bring."""
    with threadpool_limits(1):
        yield


@pytest.fixture(scope="session")
def golden(request):
    """Compare the terminal output of a command with its file in tests/golden/."""
    return Golden(request.config.getoption("--rewrite-golden"))


@pytest.fixture(scope="session")
def shared_data():
    return needs.measured_data()


@pytest.fixture(scope="session")
def ccx():
    return needs.calculix()


@pytest.fixture
def drawn(monkeypatch):
    """Charts of every file saved by the test, in turn; each is still written, and checked."""
    found = []
    rendered = vega.rendered

    def keep(charts, suffix):
        found.append(charts)
        return rendered(charts, suffix)

    monkeypatch.setattr(vega, "rendered", keep)
    yield found
    for charts in found:
        check_charts(charts)


@pytest.fixture
def packages(tmp_path, monkeypatch):
    """A folder on sys.path for distributions of a test, see `plug_ins.install`."""
    folder = tmp_path / "packages"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    yield folder
    for name in [name for name in sys.modules if name.startswith("acme_")]:
        del sys.modules[name]


@pytest.fixture
def bars(monkeypatch):
    """A solver and a kind of test, both named bars; the solver is the one that runs."""
    return known_bars(monkeypatch, BarSolver())


@pytest.fixture(scope="session")
def strips_project(tmp_path_factory):
    return bf.read_project(constant_strips(tmp_path_factory.mktemp("strips")))


@pytest.fixture(scope="session")
def strips_fit(strips_project):
    return bf.fit(strips_project, jobs=1)


@pytest.fixture(scope="session")
def one_strip_fit(strips_project):
    return bf.fit(strips_project, tests=["two"], starts=1, jobs=1)


@pytest.fixture(scope="session")
def bubble(tmp_path_factory):
    folder, heard, drawn = tmp_path_factory.mktemp("bubble"), [], []
    project = bf.read_project(known_bubble(folder))
    fit = bf.fit(project, tests="bubble", starts=2, jobs=1, progress=heard.append)
    rendered = vega.rendered
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(vega, "rendered", lambda c, suffix: drawn.append(c) or rendered(c, suffix))
        page = fit.report(folder / "out").read_text()
    for charts in drawn:
        check_charts(charts)
    return SimpleNamespace(fit=fit, out=folder / "out", page=page, heard=heard, drawn=drawn)
