"""Fits to strips of constant moduli, nearly all in closed form, and to a bubble of 48 quads."""

from types import SimpleNamespace

import bubblefit as bf
import pytest
from bubblefit.reports import vega

from ..builders.projects import constant_strips, known_bubble
from ..support.charts import check_charts


@pytest.fixture(scope="session")
def strips_project(tmp_path_factory):
    return bf.read_project(constant_strips(tmp_path_factory.mktemp("strips")))


@pytest.fixture(scope="session")
def together(strips_project):
    return bf.fit(strips_project, jobs=1)


@pytest.fixture(scope="session")
def alone(strips_project):
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
