"""What tests need that is not there everywhere: programs, libraries, measured data.

The one place where a test is left out. Without the thing it skips and says why; in CI, where
`.ci/run` sets `CI`, it fails: a green run there has run everything.
"""

import importlib
import os
import shutil
import subprocess
import sys
import tempfile

import pytest
from bubblefit.errors import BubblefitError
from bubblefit.solvers.calculix.executable import find_ccx
from bubblefit.solvers.calculix.library import compiler
from bubblefit.storage.writing import cache_folder

from .paths import SHARED


def missing(what):
    """Skip the test, in CI fail it; `what` is not there, and how to get it."""
    if os.environ.get("CI"):
        pytest.fail(f"CI runs every test: {what}", pytrace=False)
    pytest.skip(what, allow_module_level=True)


def program(*names, package):
    """Path of the first of these programs that there is; `package` brings one."""
    for name in names:
        if path := shutil.which(name):
            return path
    missing(f"there is no {' or '.join(names)}: install {package}")


def fortran():
    return program("gfortran", package="gfortran")


def c_compiler():
    """The C compiler as a command, as the CalculiX adapter looks for it."""
    try:
        return compiler()
    except BubblefitError as error:
        missing(str(error))


def library(name):
    try:
        return importlib.import_module(name)
    except (ImportError, OSError) as error:
        missing(f"{name} cannot be loaded: {error}")


def package_index():
    """The index from which pip takes the packages of a build environment."""
    with tempfile.TemporaryDirectory() as folder:
        command = (sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "wheel")
        done = subprocess.run([*command, "--dest", folder], capture_output=True, text=True)
    if done.returncode:
        missing(f"pip reaches no package index: {done.stderr.strip()[-200:]}")


def linux(what):
    if sys.platform != "linux":
        missing(f"{what}: tried on Linux")


def calculix():
    try:
        return find_ccx()
    except BubblefitError as error:
        missing(str(error))


def calculix_decks():
    """Folder of CalculiX' own test decks, where `.ci/decks` puts them."""
    calculix()
    folder = cache_folder() / "calculix" / "decks"
    if not folder.is_dir():
        missing("CalculiX' test decks are not there: sh .ci/decks")
    return folder


def measured_data():
    if not SHARED.is_dir():
        missing(f"no measured data: {SHARED} is not there")
    return SHARED
