"""The wheel: what is in it, that it is built from the sdist, and that it works elsewhere.

One wheel is built as `pip install .` does, in an isolated environment whose packages come from the
package index, and is installed with its dependencies into a fresh environment.
"""

import hashlib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import zipfile

import pytest

from .builders.projects import write_two_camera_exports
from .support import needs
from .support.commands import output_of
from .support.paths import NOT_THE_PRODUCT, ROOT, load_script

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
#: Every folder that is a package, found without setuptools.
PACKAGES = {
    ".".join(("bubblefit", *folder.parts))
    for folder in (f.parent.relative_to(ROOT) for f in ROOT.rglob("__init__.py"))
    if not {*folder.parts} & NOT_THE_PRODUCT and not any(p.startswith(".") for p in folder.parts)
}
#: Files of a wheel that are made when it is built.
METADATA = re.compile(r"bubblefit-[^/]+\.dist-info/")
KERNEL = re.compile(r"bubblefit/kernels-\w+/[^/]+\.nb[ci]$")
#: What `setup.py` fits to compile the kernels.
COMPILED = "examples/biaxial-computed/project.toml"


def clean_environment(**variables):
    """Return this process's environment without paths to modules and switches of the build.

    What pip installs is compiled where it is imported: most of the dependencies never are. For pip,
    0 says yes to an option that begins with no.
    """
    unwanted = ("PYTHONPATH", "CI", "BUBBLEFIT_PURE", "BUBBLEFIT_CACHE", "NUMBA_OPT")
    kept = {name: value for name, value in os.environ.items() if name not in unwanted}
    return {**kept, "PIP_NO_COMPILE": "0", **variables}


def files_of_product():
    """Return the names in the wheel of all files of the product, metadata and kernels apart."""
    names = {"bubblefit/py.typed", "bubblefit/solvers/calculix/law.c"}
    for package in PACKAGES:
        folder = ROOT.joinpath(*package.split(".")[1:])
        files = [f for f in folder.glob("*.py") if f != ROOT / "setup.py"]
        files += folder.glob("*.pyi")
        names |= {f"bubblefit/{f.relative_to(ROOT).as_posix()}" for f in files}
    documents = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    names |= {f"bubblefit/{path.relative_to(ROOT).as_posix()}" for path in documents}
    pages = load_script("docs/make_api.py").PAGES  # made when the wheel is built
    names |= {f"bubblefit/docs/reference/api/{name}.md" for name in pages}
    for folder in ("examples", "templates", "runs/verification/published"):
        for file in (ROOT / folder).rglob("*"):
            inside = file.relative_to(ROOT)
            is_left = any(p.startswith((".", "out")) or p == "__pycache__" for p in inside.parts)
            if file.is_file() and not is_left:
                names.add(f"bubblefit/{inside.as_posix()}")
    return names


def digests(wheel):
    """Return the digest of each file of the package in a wheel, kernels and metadata apart."""
    archive = zipfile.ZipFile(wheel)
    names = [n for n in archive.namelist() if not (METADATA.match(n) or KERNEL.match(n))]
    return {name: hashlib.sha256(archive.read(name)).hexdigest() for name in names}


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A copy of the repository with what users and earlier builds leave there."""
    folder = tmp_path_factory.mktemp("tree") / "source"
    unwanted = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "out", "build", "dist")
    shutil.copytree(ROOT, folder, ignore=unwanted)
    for name in (
        "out/demo/result.json",
        "examples/bubble-known-solution/out/result.json",
        "examples/plug-in/__pycache__/junk.cpython-311.pyc",
        "docs/reference/api/deleted_page.md",
        "build/lib/bubblefit/deleted_module.py",
        "build/lib/another_package/junk.py",
        ".venv/lib/junk.py",
    ):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("")
    return folder


@pytest.fixture(scope="module")
def pure_wheel(source, tmp_path_factory):
    """The wheel of the repository, without kernels and without isolation."""
    folder = tmp_path_factory.mktemp("pure")
    options = ("--no-deps", "--no-index", "--no-build-isolation", "--wheel-dir", folder)
    environment = clean_environment(BUBBLEFIT_PURE="1", CI="1")
    output_of(sys.executable, "-m", "pip", "--quiet", "wheel", *options, source, env=environment)
    (wheel,) = folder.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def wheel(source, tmp_path_factory):
    """The wheel that pip builds of the sdist in an isolated environment."""
    needs.package_index()
    folder = tmp_path_factory.mktemp("wheel")
    code = f"import setuptools.build_meta as b; b.build_sdist({str(folder)!r})"
    environment = clean_environment(CI="1")
    output_of(sys.executable, "-c", code, cwd=source, env=environment)
    (sdist,) = folder.glob("*.tar.gz")
    options = ("--no-deps", "--wheel-dir", folder)
    output_of(sys.executable, "-m", "pip", "--quiet", "wheel", *options, sdist, env=environment)
    (wheel,) = folder.glob("*.whl")
    return wheel


@pytest.mark.slow
def test_wheel_holds_package_and_nothing_else(pure_wheel):
    assert pure_wheel.name.endswith("-py3-none-any.whl")
    names = set(zipfile.ZipFile(pure_wheel).namelist())
    assert {name for name in names if not METADATA.match(name)} == files_of_product()
    (licence,) = [name for name in names if name.endswith("LICENSE")]
    assert "MIT License" in zipfile.ZipFile(pure_wheel).read(licence).decode()


def test_pages_of_the_interface_are_the_same_in_each_build():
    pages = load_script("docs/make_api.py").pages()
    assert len(pages) > 5
    assert [name for name, text in pages.items() if " at 0x" in text] == []


@pytest.mark.slow
def test_wheel_built_in_isolation_from_sdist_holds_kernels_and_what_the_repository_has(
    wheel, pure_wheel
):
    assert digests(wheel) == digests(pure_wheel)
    names = zipfile.ZipFile(wheel).namelist()
    assert len([name for name in names if KERNEL.match(name)]) > 80
    python = "cp" + sysconfig.get_config_var("py_version_nodot")
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    assert wheel.name.endswith(f"-{python}-{python}-{platform}.whl")


@pytest.mark.slow
def test_failed_compilation_is_an_error_in_ci_and_a_message_elsewhere(source, tmp_path):
    broken = tmp_path / "broken"
    shutil.copytree(source, broken, ignore=shutil.ignore_patterns(".venv"))
    (broken / COMPILED).write_text("[fabric]\nthickness = -1\n")
    (broken / "docs" / "make_api.py").write_text("")  # pages are not the subject
    build = (sys.executable, "setup.py", "--quiet", "bdist_wheel")
    how = {"cwd": broken, "capture_output": True, "text": True}
    done = subprocess.run(build, env=clean_environment(), **how)
    assert done.returncode == 0, done.stderr
    assert "the wheel goes without compiled kernels" in done.stderr
    assert "fabric.thickness" in done.stderr and "the first run compiles" in done.stderr
    (wheel,) = broken.glob("dist/*.whl")
    assert wheel.name.endswith("-py3-none-any.whl")
    done = subprocess.run(build, env=clean_environment(CI="1"), **how)
    assert done.returncode != 0 and "as CI is set, this is an error" in done.stderr


@pytest.mark.slow
def test_first_fit_of_another_user_compiles_nothing(wheel, tmp_path, monkeypatch):
    venv = tmp_path / "venv"
    environment = clean_environment(HOME=str(tmp_path / "home"))
    environment.pop("XDG_CACHE_HOME", None)
    output_of(sys.executable, "-m", "venv", "--without-pip", venv)
    python, command = venv / "bin" / "python", venv / "bin" / "bubblefit"
    pip = (sys.executable, "-m", "pip", "--quiet", "--python", python, "install")
    output_of(*pip, wheel, env=environment)

    def run(*words):
        return output_of(*words, cwd=tmp_path, env=environment)

    place = run(python, "-c", "import bubblefit; print(bubblefit.__file__)")
    assert place.startswith(str(venv))
    assert PROJECT["project"]["version"] in run(command, "--version")
    run(command, "init", "measured", "--example", "measured")
    assert (tmp_path / "measured" / "test3-cubic.toml").exists()
    example = f"bf.__path__[0] + '/{COMPILED}'"
    run(python, "-c", f"import bubblefit as bf; bf.fit(bf.read_project({example}), starts=1)")
    (shipped,) = venv.glob("lib/python*/site-packages/bubblefit/kernels-*")
    (used,) = tmp_path.glob("home/.cache/bubblefit/kernels-*")
    kernels = [
        {file.name: file.read_bytes() for file in folder.iterdir()} for folder in (shipped, used)
    ]
    assert kernels[0] == kernels[1] and len(kernels[0]) > 80
    # Scripts of a user, checked by the types of what is installed; one is run: fit, chart, export.
    typed = tmp_path / "typed"
    shutil.copytree(ROOT / "tests" / "typed", typed)
    check = ("-m", "mypy", "--strict", "--cache-dir", tmp_path / "types")
    run(sys.executable, *check, "--python-executable", python, typed)
    write_two_camera_exports(tmp_path)
    run(python, typed / "two_cameras.py")
    assert (tmp_path / "moduli.png").exists() and list((tmp_path / "card").glob("*.inp"))
    assert (tmp_path / "out" / "history.csv").exists()
