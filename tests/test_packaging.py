"""The wheel: everything the commands need, nothing else, and it works outside the repository."""

import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from .scripts import script

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
#: Folders of the repository that are no part of the package.
OUTSIDE = {"tests", "benchmarks", "docs", "examples", "out", "build", "dist"}
#: Every folder that is a package, found without setuptools.
PACKAGES = {
    ".".join(("bubblefit", *folder.parts))
    for folder in (f.parent.relative_to(ROOT) for f in ROOT.rglob("__init__.py"))
    if not {*folder.parts} & OUTSIDE and not any(p.startswith(".") for p in folder.parts)
}


def pip(python: Path | str, *arguments: Path | str) -> None:
    subprocess.run([python, "-m", "pip", "--quiet", *arguments], check=True)


def site_packages(python: Path | str) -> Path:
    ask = [python, "-c", "import sysconfig; print(sysconfig.get_paths()['purelib'])"]
    return Path(subprocess.run(ask, capture_output=True, text=True, check=True).stdout.strip())


def shipped() -> set[str]:
    """What a wheel of this working tree has to hold, found without setuptools."""
    wanted = {"bubblefit/py.typed", "bubblefit/solvers/calculix/law.c"}
    for package in PACKAGES:
        folder = ROOT.joinpath(*package.split(".")[1:])
        files = [f for f in folder.glob("*.py") if f != ROOT / "setup.py"]
        wanted |= {f"bubblefit/{f.relative_to(ROOT).as_posix()}" for f in files}
    documents = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    wanted |= {f"bubblefit/{path.relative_to(ROOT).as_posix()}" for path in documents}
    pages = script("docs/make_api.py").PAGES  # made when the wheel is built
    wanted |= {f"bubblefit/docs/reference/api/{name}.md" for name in pages}
    for folder in ("examples", "templates", "runs/verification/published"):
        for file in (ROOT / folder).rglob("*"):
            inside = file.relative_to(ROOT)
            if file.is_file() and not any(p.startswith((".", "out")) for p in inside.parts):
                wanted.add(f"bubblefit/{inside.as_posix()}")
    return wanted


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy of the working tree, so that nothing is left in the repository."""
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
    pip(sys.executable, "wheel", *options, source)
    (built,) = place.glob("*.whl")
    return built


def test_every_folder_with_modules_is_a_package():
    # Without __init__.py an editable install works and the wheel lacks the folder.
    bare = {
        module.parent.relative_to(ROOT).as_posix()
        for module in ROOT.rglob("*.py")
        if not any(p in OUTSIDE or p[0] == "." for p in module.relative_to(ROOT).parts)
        and not (module.parent / "__init__.py").exists()
        and not module.is_relative_to(ROOT / "examples")
    }
    assert not bare


def test_versions_agree():
    import bubblefit

    assert bubblefit.__version__ == PROJECT["project"]["version"]
    assert f"## {bubblefit.__version__}" in (ROOT / "CHANGELOG.md").read_text()


#: Libraries that take a tenth of a second or more to import, or are not there on every machine.
HEAVY = {"numba", "scipy.optimize", "scipy.stats", "matplotlib", "pandas", "pydantic"} | {
    "gmsh", "nlopt", "dask", "h5py", "jinja2"
}  # fmt: skip


@pytest.mark.parametrize(
    ("module", "absent"),
    [
        ("cli.main", HEAVY),
        ("cli.fits", {"gmsh", "scipy.stats", "dask", "h5py"}),
        ("fits.project", HEAVY - {"numba", "nlopt", "pydantic", "jinja2"}),
    ],
)
def test_start_up_loads_only_what_it_needs(module, absent):
    # gmsh needs X and GL libraries; the others make `bubblefit --help` slow.
    code = f"import sys, bubblefit.{module}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not absent & set(done.stdout.split())


def test_make_and_ci_agree():
    run = (ROOT / ".ci" / "run").read_text()
    assert "make lint" in run and "make test" in run
    makefile = (ROOT / "Makefile").read_text()
    for target in ("demo", "test", "lint", "bench", "calculix", "clean"):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE)


def test_links_of_the_documents_lead_somewhere():
    documents = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("examples/*/*.md")]
    for document in documents:
        for target in re.findall(r"\]\(([^)#:]+)\)", document.read_text()):
            assert (document.parent / target).exists(), f"{document.name} -> {target}"


def test_documents_that_speak_of_the_thesis_link_to_it():
    for document in (ROOT / "docs").glob("*/*.md"):
        text = re.sub(r"```.*?```|^    .*?$", "", document.read_text(), flags=re.DOTALL | re.M)
        if re.search(r"\bthe thesis\b", text, re.IGNORECASE):
            assert re.search(r"he thesis\]\([./]*references\.md", text), document


def test_every_key_of_the_project_file_is_documented():
    from bubblefit.project.schema import project_file
    from bubblefit.solvers.registry import solver_sections

    text = (ROOT / "docs" / "reference" / "project-file.md").read_text()

    def sections(annotation):
        if hasattr(annotation, "model_fields"):
            yield annotation
        for inside in getattr(annotation, "__args__", ()):
            yield from sections(inside)

    def keys(model):
        for name, field in model.model_fields.items():
            yield name
            for section in sections(field.annotation):
                yield from keys(section)

    models = (project_file(), *solver_sections().values())
    names = {key for model in models for key in keys(model)}
    missing = {key for key in names if not re.search(rf"\b{key}\b", text)}
    assert not missing


@pytest.mark.slow
def test_the_wheel_holds_the_package_and_nothing_else(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {n for n in names if not re.match(r"bubblefit-[^/]+\.dist-info/", n)} == shipped()
    (licence,) = [n for n in names if n.endswith("LICENSE")]
    assert "MIT License" in zipfile.ZipFile(wheel).read(licence).decode()


@pytest.mark.slow
def test_the_wheel_works_in_an_empty_environment(wheel, tmp_path):
    home = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", home], check=True)
    python, command = home / "bin" / "python", home / "bin" / "bubblefit"
    pip(python, "install", "--no-deps", "--no-index", wheel)
    # Empty but for the dependencies, borrowed from this environment. A .pth line is only a
    # path: the editable install of bubblefit that hangs on a .pth over there is not read.
    (site_packages(python) / "borrowed.pth").write_text(f"{site_packages(sys.executable)}\n")

    def run(*arguments: Path | str) -> str:
        done = subprocess.run(arguments, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert run(python, "-c", "import bubblefit; print(bubblefit.__file__)").startswith(str(home))
    assert PROJECT["project"]["version"] in run(command, "--version")
    run(command, "init", "mine")
    run(command, "init", "measured", "--example", "measured")
    assert (tmp_path / "measured" / "test3-cubic.toml").exists()
    project = tmp_path / "mine" / "project.toml"
    text = project.read_text()
    assert "elements = 800" in text
    project.write_text(text.replace("elements = 800", "elements = 48"))
    run(command, "bubble", project, "--starts", "1", "--jobs", "1")
    assert (tmp_path / "out" / "mine" / "report.html").exists()
