"""Compiled kernels: the cache folder, which files count, edits that reach compiled code."""

import ast
import os
import shutil
import sys

from bubblefit import compilation
from bubblefit.storage import writing

from .support.commands import output_of

#: Compiles one kernel that calls another file's functions, and prints what it computes.
KERNEL = """
import numpy as np
from bubblefit.materials.law import HypoelasticLaw
law = HypoelasticLaw.linear(400.0, 250.0, 12.0)
print(law.increment(np.zeros(3), np.array([0.01, 0.0, 0.0]), np.zeros(3))[0])
"""


def run(cache, package=None):
    # Not optimised: what takes long is to compile.
    environment = {**os.environ, "BUBBLEFIT_CACHE": str(cache), "NUMBA_OPT": "0"}
    if package is not None:
        environment["PYTHONPATH"] = str(package)
    return output_of(sys.executable, "-c", KERNEL, env=environment)


def _compiles(file):
    text = file.read_text()
    if "compiled" not in text:
        return False
    functions = (n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.FunctionDef))
    decorators = (d for function in functions for d in function.decorator_list)
    return any("compiled" in ast.unparse(decorator) for decorator in decorators)


def test_every_file_with_compiled_functions_is_listed():
    outside = {"tests", "benchmarks", "build", "out"}
    sources = (file.relative_to(writing.ROOT) for file in writing.ROOT.rglob("*.py"))
    ours = [f for f in sources if f.parts[0] not in outside and not f.parts[0].startswith(".")]
    with_kernels = {file.as_posix() for file in ours if _compiles(writing.ROOT / file)}
    assert len(with_kernels) > 5
    assert with_kernels == set(compilation.KERNELS)
    assert len(compilation.KERNELS) == len(with_kernels)


def test_edit_reaches_code_compiled_from_another_file(tmp_path):
    package = tmp_path / "copy" / "bubblefit"
    shutil.copytree(
        writing.ROOT,
        package,
        ignore=shutil.ignore_patterns(".*", "out", "tests", "build", "*.egg-info", "__pycache__"),
    )
    before = run(tmp_path / "cache", package.parent)
    assert list((tmp_path / "cache").glob("kernels-*/*.nbi"))
    law = package / "materials" / "pieces.py"
    text = law.read_text()
    edited = text.replace(
        "first + pieces[component, k, 4]", "first + 2.0 * pieces[component, k, 4]"
    )
    assert edited != text
    law.write_text(edited)
    after = run(tmp_path / "cache", package.parent)
    assert after != before
    (tmp_path / "file").write_text("in the way of a cache")
    assert run(tmp_path / "file" / "cache", package.parent) == after
