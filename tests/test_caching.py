"""Compiled code is kept where that can be done, follows every edit, and is never required."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

from bubblefit import files

#: Compiles one kernel that calls another file's functions, and prints what it computes.
PROGRAM = """
import numpy as np
from bubblefit.materials.law import HypoelasticLaw
law = HypoelasticLaw.linear(400.0, 250.0, 12.0)
print(law.increment(np.zeros(3), np.array([0.01, 0.0, 0.0]), np.zeros(3))[0])
"""


def run(cache, package=None):
    environment = {**os.environ, "BUBBLEFIT_CACHE": str(cache)}
    if package is not None:
        environment["PYTHONPATH"] = str(package)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_where_the_cache_is(monkeypatch):
    monkeypatch.setenv("BUBBLEFIT_CACHE", "/x")
    assert files.cache_folder() == Path("/x")
    monkeypatch.delenv("BUBBLEFIT_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/y")
    assert files.cache_folder() == Path("/y/bubblefit")
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", "/z")
    assert files.cache_folder() == Path("/z/.cache/bubblefit")


def _compiles(file):
    functions = (n for n in ast.walk(ast.parse(file.read_text())) if isinstance(n, ast.FunctionDef))
    decorators = (d for function in functions for d in function.decorator_list)
    return any("compiled" in ast.unparse(decorator) for decorator in decorators)


def test_every_file_with_compiled_functions_is_among_the_kernels():
    outside = {"tests", "benchmarks", "build", "out"}
    sources = (file.relative_to(files.ROOT) for file in files.ROOT.rglob("*.py"))
    ours = [f for f in sources if f.parts[0] not in outside and not f.parts[0].startswith(".")]
    with_kernels = {file.as_posix() for file in ours if _compiles(files.ROOT / file)}
    assert len(with_kernels) > 5
    assert with_kernels == set(files.KERNELS)
    assert len(files.KERNELS) == len(with_kernels)


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path):
    (tmp_path / "file").write_text("in the way")
    kept = run(tmp_path / "cache")
    assert list((tmp_path / "cache").glob("kernels-*/*/*.nbi"))
    assert run(tmp_path / "file" / "cache") == kept


def test_an_edit_reaches_code_compiled_from_another_file(tmp_path):
    package = tmp_path / "copy" / "bubblefit"
    shutil.copytree(
        files.ROOT,
        package,
        ignore=shutil.ignore_patterns(".*", "out", "tests", "build", "*.egg-info", "__pycache__"),
    )
    before = run(tmp_path / "cache", package.parent)
    law = package / "materials" / "point_law.py"
    text = law.read_text()
    edited = text.replace(
        "first + pieces[component, k, 4]", "first + 2.0 * pieces[component, k, 4]"
    )
    assert edited != text
    law.write_text(edited)
    assert run(tmp_path / "cache", package.parent) != before
