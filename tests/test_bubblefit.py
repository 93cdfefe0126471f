"""The package as it is imported and installed: light start, one version, wheels."""

import os
import re
import sys
import tomllib

import bubblefit
import pytest
from bubblefit.runs import folder

from .builders.projects import known_bubble
from .support.commands import output_of
from .support.paths import ROOT

#: Put before a program, and before every interpreter that it starts. The code for this
#: system, platformdirs and numpy need some of these names: they are imported first. SIGKILL stays,
#: by which subprocess and psutil end a process on this system.
WITHOUT = """
import multiprocessing, numpy, os, platformdirs, psutil, signal, sys
for name in ("fcntl", "grp", "pwd", "resource", "termios"):
    sys.modules[name] = None
for name in (
    "chown", "fork", "forkpty", "fchmod", "getpgid", "getpgrp", "getuid", "geteuid", "killpg",
    "mkfifo", "register_at_fork", "sched_getaffinity", "setpgid", "setsid", "uname", "wait",
    "O_CLOEXEC", "O_NOFOLLOW", "O_NONBLOCK",
):
    if hasattr(os, name):
        delattr(os, name)
for name in ("alarm", "pthread_kill", "pthread_sigmask", "setitimer", "sigwait", "SIGALRM",
             "SIGCHLD", "SIGHUP", "SIGPIPE", "SIGQUIT", "SIGUSR1", "SIGUSR2"):
    if hasattr(signal, name):
        delattr(signal, name)
if multiprocessing.get_start_method(allow_none=True) is None:
    multiprocessing.set_start_method("spawn")
"""


FIT = """
import multiprocessing, sys
from pathlib import Path
import bubblefit as bf
from bubblefit.solvers import scratch
assert not hasattr(__import__("os"), "fork")
scratch.MEMORY = Path(sys.argv[2], "no such folder")
if __name__ == "__main__":
    project = bf.read_project(sys.argv[1])
    fit = bf.fit(project, starts=2, jobs=2, out=sys.argv[2])
    assert not multiprocessing.active_children()
    print(fit.objective, len(fit.starts()))
"""


PROGRAM = """
import sys
from pathlib import Path
from bubblefit.solvers import licences, process, scratch
folder = Path(sys.argv[1])
locks = licences.LicenceSettings(licences=1, licence_folder=str(folder / "locks"))
with scratch.run_folder("t", folder, False, "t", "log") as place:
    assert scratch.sweep([folder]) == [] and place.exists()
    program = "import time; print('begun', flush=True); time.sleep(60)"
    words = [sys.executable, "-I", "-S", "-c", program]
    ended = process.run_process(words, place, place / "log", timeout=2.0)
    assert ended.timed_out and ended.seconds < 30, ended
    assert process.log_tail(place / "log") == "begun"
assert not place.exists()
"""


def without(program, folder, *arguments):
    site = folder / "site"
    site.mkdir()
    (site / "sitecustomize.py").write_text(WITHOUT)
    (site / "program.py").write_text(program)
    paths = [str(site), *filter(None, sys.path)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    command = (sys.executable, site / "program.py", *arguments)
    return output_of(*command, cwd=folder, env=environment, timeout=300)


def test_bubble_is_fitted_by_two_spawned_processes(tmp_path):
    project = known_bubble(tmp_path)
    printed = without(FIT, tmp_path, project, tmp_path / "out").splitlines()[-1].split()
    assert float(printed[0]) >= 0.0 and int(printed[1]) == 2
    assert (tmp_path / "out" / "history.csv").stat().st_size > 0


def test_program_is_ended_in_time_and_its_folder_removed(tmp_path):
    without(PROGRAM, tmp_path, tmp_path)


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_build_requires_the_packages_of_runs_only():
    said = PROJECT["build-system"]["requires"], PROJECT["project"]["dependencies"]
    builds, runs = ({re.split("[>=]", one)[0] for one in names} for names in said)
    assert set(folder.PACKAGES) <= builds <= {*runs, "setuptools"}


def test_versions_agree():
    assert bubblefit.__version__ == PROJECT["project"]["version"]
    assert f"## {bubblefit.__version__}" in (ROOT / "CHANGELOG.md").read_text()


#: Libraries that take a tenth of a second or more to import, or are not there on every machine.
HEAVY = {"numba", "scipy.optimize", "scipy.stats", "matplotlib", "pandas", "pydantic"} | {
    "gmsh", "nlopt", "dask", "h5py", "jinja2"
}  # fmt: skip


#: Imported when first used: no help needs them.
FIRST_USED = {"pandas", "PIL.Image", "numba"} | {
    f"scipy.{part}" for part in ("integrate", "linalg", "optimize", "sparse", "spatial", "special")
}


KNOWN = "examples/bubble-known-solution/project.toml"
BEND = "examples/bend-valmex7318/project.toml"
STRIPS = "examples/uniaxial-valmex7318/project.toml"


@pytest.mark.parametrize(
    ("code", "absent"),
    [
        ("from bubblefit.cli.main import main; main(['--help'], standalone_mode=False)", HEAVY),
        ("import bubblefit.cli.fits", {"gmsh", "scipy.stats", "dask", "h5py"}),
        ("import bubblefit.project.project", HEAVY - {"numba", "nlopt", "pydantic", "jinja2"}),
        ("import bubblefit", {*HEAVY, "numpy", "scipy", "click"}),
        ("import bubblefit; [getattr(bubblefit, name) for name in bubblefit.__all__]",
         {"click", "bubblefit.cli"}),
        (f"import bubblefit as b; b.read_project(b.__path__[0] + '/{KNOWN}')",
         {"matplotlib", "gmsh", "click", "numba", "meshio", "h5py", "pandas", "scipy.sparse",
          "scipy.spatial", "scipy.linalg", "bubblefit.experiments.bubble.prepared",
          "bubblefit.materials.exports"}),
        (f"import bubblefit as b; b.read_project(b.__path__[0] + '/{BEND}')",
         {"scipy.sparse", "numba", "bubblefit.solvers.membrane.solver"}),
        (f"import bubblefit as b; b.read_project(b.__path__[0] + '/{STRIPS}')",
         {"pandas", "scipy.sparse", "numba"}),
        ("import bubblefit.cli.check", {"numpy", "pydantic", "rich", "bubblefit.project"}),
        ("import bubblefit.cli.export", {"rich", "bubblefit.solvers.registry"}),
        ("import bubblefit.cli.start", {"rich", "jinja2", "numpy", "pydantic"}),
        ("import bubblefit.cli.data", {"numpy"}),
        ("import bubblefit.cli.fits, bubblefit.cli.predict, bubblefit.cli.studies",
         {*FIRST_USED, "bubblefit.experiments.base", "bubblefit.project"}),
        ("import bubblefit.cli.tools",
         {*FIRST_USED, "bubblefit.reports", "bubblefit.experiments", "bubblefit.project"}),
        ("from bubblefit.cli.main import main; main(['verify', '-h'], standalone_mode=False)",
         {"numpy", "pydantic", "rich", "bubblefit.project"}),
        ("import bubblefit as b; from bubblefit.runs.check import check_trusted;"
         f" check_trusted(b.read_project(b.__path__[0] + '/{KNOWN}'))",
         {"bubblefit.experiments.strips", "bubblefit.experiments.cylinder"}),
    ],
)  # fmt: skip
def test_import_loads_no_heavy_library(code, absent):
    # gmsh needs X and GL libraries; the others make `bubblefit --help` slow.
    done = output_of(sys.executable, "-c", f"import sys; {code}; print(*sys.modules)")
    loaded = set(done.splitlines()[-1].split())
    assert not absent & loaded
    if code == "import bubblefit":
        assert len([name for name in loaded if name.split(".")[0] == "bubblefit"]) < 15


def test_quick_import_leaves_no_young_objects():
    """Otherwise the next search for garbage goes through all that was imported."""
    code = (
        "import bubblefit, gc; bubblefit.Project; old = gc.get_objects(generation=2);"
        " print(any(item is bubblefit.Project for item in old))"
    )
    assert output_of(sys.executable, "-c", code).strip() == "True"


def test_dir_shows_public_names_only():
    assert dir(bubblefit) == sorted([*bubblefit.__all__, "__version__"])
