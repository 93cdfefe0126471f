"""The package as it is imported and installed: light start, one version, wheels."""

import os
import re
import shutil
import sys
import tomllib
import zipfile
from pathlib import Path

import bubblefit
import pytest
from bubblefit.runs import folder

from .builders.projects import known_bubble, write_two_camera_exports
from .support.commands import output_of
from .support.paths import NOT_THE_PRODUCT, ROOT, load_script

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
    words = [sys.executable, "-c", "import time; print('begun', flush=True); time.sleep(60)"]
    ended = process.run_process(words, place, place / "log", timeout=5.0)
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


#: Every folder that is a package, found without setuptools.
PACKAGES = {
    ".".join(("bubblefit", *folder.parts))
    for folder in (f.parent.relative_to(ROOT) for f in ROOT.rglob("__init__.py"))
    if not {*folder.parts} & NOT_THE_PRODUCT and not any(p.startswith(".") for p in folder.parts)
}


def site_packages(python):
    code = "import sysconfig; print(sysconfig.get_paths()['purelib'])"
    return Path(output_of(python, "-c", code).strip())


def shipped():
    wanted = {"bubblefit/py.typed", "bubblefit/solvers/calculix/law.c"}
    for package in PACKAGES:
        folder = ROOT.joinpath(*package.split(".")[1:])
        files = [f for f in folder.glob("*.py") if f != ROOT / "setup.py"]
        wanted |= {f"bubblefit/{f.relative_to(ROOT).as_posix()}" for f in files}
    documents = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    wanted |= {f"bubblefit/{path.relative_to(ROOT).as_posix()}" for path in documents}
    pages = load_script("docs/make_api.py").PAGES  # made when the wheel is built
    wanted |= {f"bubblefit/docs/reference/api/{name}.md" for name in pages}
    for folder in ("examples", "templates", "runs/verification/published"):
        for file in (ROOT / folder).rglob("*"):
            inside = file.relative_to(ROOT)
            if file.is_file() and not any(p.startswith((".", "out")) for p in inside.parts):
                wanted.add(f"bubblefit/{inside.as_posix()}")
    return wanted


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    place = tmp_path_factory.mktemp("wheel")
    source = place / "source"
    unwanted = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "out", "build", "dist")
    shutil.copytree(ROOT, source, ignore=unwanted)
    # Litter as users leave it.
    for name in ("out/demo/result.json", "examples/bubble-known-solution/out/result.json"):
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_text("{}")
    (source / ".venv" / "lib").mkdir(parents=True)
    (source / ".venv" / "lib" / "junk.py").write_text("")
    # No build isolation: no network is needed, and the sandbox would be the same setuptools.
    options = ("--no-deps", "--no-index", "--no-build-isolation", "--wheel-dir", place)
    output_of(sys.executable, "-m", "pip", "--quiet", "wheel", *options, source)
    (built,) = place.glob("*.whl")
    return built


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


KNOWN = "examples/bubble-known-solution/project.toml"


@pytest.mark.parametrize(
    ("code", "absent"),
    [
        ("from bubblefit.cli.main import main; main(['--help'], standalone_mode=False)", HEAVY),
        ("import bubblefit.cli.fits", {"gmsh", "scipy.stats", "dask", "h5py"}),
        ("import bubblefit.project.project", HEAVY - {"numba", "nlopt", "pydantic", "jinja2"}),
        ("import bubblefit", {*HEAVY, "scipy", "click"}),
        ("import bubblefit; [getattr(bubblefit, name) for name in bubblefit.__all__]",
         {"click", "bubblefit.cli"}),
        (f"import bubblefit as b; b.read_project(b.__path__[0] + '/{KNOWN}')",
         {"matplotlib", "gmsh", "click", "numba", "meshio", "h5py", "pandas", "scipy.sparse",
          "scipy.spatial", "scipy.linalg"}),
    ],
)  # fmt: skip
def test_import_loads_no_heavy_library(code, absent):
    # gmsh needs X and GL libraries; the others make `bubblefit --help` slow.
    done = output_of(sys.executable, "-c", f"import sys; {code}; print(*sys.modules)")
    loaded = set(done.splitlines()[-1].split())
    assert not absent & loaded
    if code == "import bubblefit":
        assert len([name for name in loaded if name.split(".")[0] == "bubblefit"]) < 15


@pytest.mark.slow
def test_wheel_holds_the_package_and_nothing_else(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    made = r"bubblefit-[^/]+\.dist-info/|bubblefit/kernels-\w+/[^/]+\.nb[ci]$"
    assert {n for n in names if not re.match(made, n)} == shipped()
    (licence,) = [n for n in names if n.endswith("LICENSE")]
    assert "MIT License" in zipfile.ZipFile(wheel).read(licence).decode()


@pytest.mark.slow
def test_wheel_works_in_an_empty_environment(wheel, tmp_path, monkeypatch):
    home = tmp_path / "venv"
    output_of(sys.executable, "-m", "venv", "--without-pip", home)
    python, command = home / "bin" / "python", home / "bin" / "bubblefit"
    pip = (sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index")
    output_of(*pip, wheel)
    # Empty but for the dependencies, borrowed from this environment. A .pth line is only a
    # path: the editable install of bubblefit that hangs on a .pth over there is not read.
    (site_packages(python) / "borrowed.pth").write_text(f"{site_packages(sys.executable)}\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    place = output_of(python, "-c", "import bubblefit; print(bubblefit.__file__)")
    assert place.startswith(str(home))
    assert PROJECT["project"]["version"] in output_of(command, "--version")
    output_of(command, "init", "measured", "--example", "measured")
    assert (tmp_path / "measured" / "test3-cubic.toml").exists()
    # A first fit compiles nothing: the kernels came with the package.
    monkeypatch.setenv("BUBBLEFIT_CACHE", str(tmp_path / "cache"))
    example = "bf.__path__[0] + '/examples/biaxial-computed/project.toml'"
    output_of(python, "-c", f"import bubblefit as bf; bf.fit(bf.read_project({example}), starts=1)")
    (came,) = home.glob("lib/python*/site-packages/bubblefit/kernels-*")
    (used,) = tmp_path.glob("cache/kernels-*")
    contents = [{file.name: file.read_bytes() for file in one.iterdir()} for one in (came, used)]
    assert contents[0] == contents[1] and len(contents[0]) > 40
    # Scripts of a user, checked by the types of what is installed; one is run: fit, chart, export.
    shutil.copytree(ROOT / "tests" / "typed", typed := tmp_path / "typed")
    check = ("-m", "mypy", "--strict", "--cache-dir", tmp_path / "types")
    output_of(sys.executable, *check, "--python-executable", python, typed)
    write_two_camera_exports(tmp_path)
    output_of(python, typed / "two_cameras.py")
    assert (tmp_path / "moduli.png").exists() and list((tmp_path / "card").glob("*.inp"))
    assert (tmp_path / "out" / "history.csv").exists()
