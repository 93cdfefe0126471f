"""The repository root is the package `bubblefit`: which of its folders are packages of it."""

import os
import subprocess
import sys
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

#: Folders of the repository that are not part of what is installed.
APART = ("tests", "benchmarks", "examples", "docs", "build", "out")


class Modules(build_py):
    """Leave this file out of the package, and add the pages of the Python interface to it."""

    def run(self):
        """Build; the pages are left out where the dependencies are not installed."""
        super().run()
        if not self.editable_mode:
            pages = Path(self.build_lib, "bubblefit/docs/reference/api")
            subprocess.run(
                [sys.executable, "docs/make_api.py", pages],
                env=os.environ | {"PYTHONPATH": os.path.abspath(self.build_lib)},
                capture_output=True,
            )

    def find_package_modules(self, package, package_dir):
        """(package, module, path) of what is installed."""
        every = super().find_package_modules(package, package_dir)
        return [module for module in every if (package, module[1]) != ("bubblefit", "setup")]


INSIDE = [name for name in find_packages(".") if name.split(".")[0] not in APART]
setup(
    packages=["bubblefit", *(f"bubblefit.{name}" for name in INSIDE)],
    cmdclass={"build_py": Modules},
)
