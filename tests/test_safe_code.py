"""What the code itself never does: shells, pickles, evaluated text. Beside ruff's rules `S`."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from .places import ROOT

ROOMS = ("tests", "benchmarks", "out", "build")
SOURCES = sorted(
    path
    for path in ROOT.rglob("*.py")
    if path.relative_to(ROOT).parts[0] not in ROOMS
    and not any(part.startswith(".") for part in path.relative_to(ROOT).parts)
)
MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "marshal", "shelve", "yaml", "tarfile"}
CALLS = {
    "eval", "exec", "compile", "os.system", "os.popen", "np.loadtxt", "np.genfromtxt",
    "numpy.load", "pd.eval", "pd.read_pickle", "shutil.unpack_archive", "loadmat",
    "subprocess.getoutput", "jinja2.Environment", "SandboxedEnvironment", "tempfile.mktemp",
}  # fmt: skip


def faults(source: str) -> list[str]:
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            named = [a.name for a in node.names]
            named += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found += [f"imports {n}" for n in named if n.partition(".")[0] in MODULES]
        if not isinstance(node, ast.Call):
            continue
        name = ast.unparse(node.func)
        given = {k.arg: ast.unparse(k.value) for k in node.keywords}
        if name in CALLS or name.endswith(".extractall"):
            found.append(f"calls {name}")
        if name == "np.load" and given.get("allow_pickle") != "False":
            found.append("np.load without allow_pickle=False")
        if given.get("shell", "False") != "False" or given.get("allow_pickle") == "True":
            found.append(f"{name} with a shell or a pickle")
    return found


#: numpy's own reader of an example's own program (re.compile is no compile); and what our own
#: processes send each other, by a pipe or through Dask (docs/reference/security.md).
ALLOWED = {
    "examples/solver-adapter/bubblefit_homogeneous.py": ["calls np.loadtxt"],
    "runs/cluster.py": ["imports cloudpickle"],
    "runs/executor.py": ["imports cloudpickle"],
}


def test_no_shell_no_pickle_no_evaluated_text() -> None:
    assert len(SOURCES) > 300
    found = {str(path.relative_to(ROOT)): faults(path.read_text()) for path in SOURCES}
    assert {path: what for path, what in found.items() if what} == ALLOWED


@pytest.mark.parametrize(
    "source",
    [
        "import pickle", "from pickle import loads", "import yaml.loader", "eval('1')",
        "np.load(path)", "np.load(path, allow_pickle=True)", "run('ls', shell=True)",
        "archive.extractall()", "jinja2.Environment()",
    ],
)  # fmt: skip
def test_such_faults_are_seen(source: str) -> None:
    assert faults(source)


def test_ruff_looks_for_the_rest() -> None:
    text = (Path(ROOT) / "pyproject.toml").read_text()
    line = next(line for line in text.splitlines() if line.startswith("select = "))
    assert '"S"' in line
