"""The repository root is the package `bubblefit`: which of its folders are packages of it.

A wheel has the compiled kernels and the pages of the Python interface, which are made with the
modules of the wheel in the environment that builds it. A wheel with kernels is for the platform and
the Python that compiled them. Where they cannot be made, the wheel goes without them and is for any
platform; if the environment variable CI is set, that is an error. BUBBLEFIT_PURE=1 asks for a wheel
without kernels.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

#: Folders of the repository that are not part of what is installed.
APART = ("tests", "benchmarks", "examples", "docs", "build", "out")


#: A short tube, whose wall wrinkles.
TUBE = """
fabric = { thickness = 0.8 }
[[cylinder]]
diameter = 150.0
pressure = 60.0
length = 800.0
span = 600.0
element_size = 75.0
deflections = [2.0]
"""
#: Compiles what fits and cylinders use; prints the folder of the kernels. All that it imports is
#: among what pyproject.toml requires of the environment that builds.
COMPILE = f"""
import pathlib, tempfile
import bubblefit as bf
from bubblefit.compilation import kernel_folder
for name in ("biaxial-computed", "bubble-known-solution"):
    fit = bf.fit(bf.read_project(bf.__path__[0] + f"/examples/{{name}}/project.toml"), starts=1)
with tempfile.TemporaryDirectory() as place:
    file = pathlib.Path(place, "project.toml")
    file.write_text({TUBE!r})
    for tube in bf.read_project(file).tests.values():
        bf.simulate(tube, bf.MaterialCard(fit.law, 0.8))
print(kernel_folder())
"""


#: A picture of the README; a link, alone in parentheses or not.
PICTURE = re.compile(r"!\[([^\]]+)\]\([^)\s]+\)")
LINK = re.compile(r"(\(?)\[([^\]]+)\]\(([^)\s]+)\)(\)?)")


def index_page():
    """Return the README for a package index, on which links to files of the repository are dead.

    In their place stands the command that prints the document, or the name of the file. A picture
    is replaced by its description.
    """

    def without_link(match):
        opening, text, target, closing = match.groups()
        path = Path(target.partition("#")[0])
        topic = path.stem if path.stem != "README" else path.as_posix().removeprefix("docs/")
        command = "bubblefit docs" if topic == "README.md" else f"bubblefit docs {topic}"
        source = command if path.suffix == ".md" and path.parts[0] != "examples" else path
        return f"(`{source}`)" if opening and closing else f"{opening}{text} (`{source}`){closing}"

    readme = Path(__file__).with_name("README.md").read_text(encoding="utf-8")
    return LINK.sub(without_link, PICTURE.sub(r"*\1.*", readme))


class Modules(build_py):
    """Build the modules without this file, and add pages of the interface and compiled kernels."""

    def run(self):
        """Build the modules in an empty folder, then make pages and kernels with them."""
        if self.editable_mode:
            super().run()
            return
        # A module that an earlier build left there would be packed.
        shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()
        package = Path(self.build_lib, "bubblefit")
        pages = package / "docs" / "reference" / "api"
        self.run_python("the pages of the Python interface", "docs/make_api.py", pages)
        if os.environ.get("BUBBLEFIT_PURE", "0") in ("", "0"):
            self.add_kernels(package)

    def add_kernels(self, package):
        """Compile the kernels in a folder of their own, not in the user's cache, and add them."""
        with tempfile.TemporaryDirectory() as cache:
            settings = {"BUBBLEFIT_CACHE": cache}
            printed = self.run_python("compiled kernels", "-c", COMPILE, **settings)
            if printed is not None:
                folder = Path(printed.strip().rpartition("\n")[2])
                shutil.copytree(folder, package / folder.name)

    def run_python(self, purpose, *arguments, **settings):
        """Run Python on the modules that are built and return what it prints; None if it fails."""
        # pip names its isolated environment by this variable, too.
        isolated = os.environ.get("PYTHONPATH")
        paths = [os.path.abspath(self.build_lib), *([isolated] if isolated else [])]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)} | settings
        command = [sys.executable, *arguments]
        process = subprocess.run(command, env=environment, capture_output=True, text=True)
        if process.returncode == 0:
            return process.stdout
        reason = process.stderr.strip().rpartition("\n")[2]
        message = f"bubblefit: the wheel goes without {purpose}, which failed with: {reason}"
        if os.environ.get("CI"):
            sys.exit(f"{process.stderr}\n{message}; as CI is set, this is an error")
        print(f"{message}; the first run compiles what is missing", file=sys.stderr)
        return None

    def find_package_modules(self, package, package_dir):
        """Return (package, module, path) of what is installed."""
        modules = super().find_package_modules(package, package_dir)
        return [module for module in modules if (package, module[1]) != ("bubblefit", "setup")]


class Wheel(bdist_wheel):
    """Name platform and Python in the tag of a wheel that has compiled kernels."""

    def get_tag(self):
        """Return the tag (Python, ABI, platform) after the modules are built."""
        folder = Path(self.get_finalized_command("build_py").build_lib, "bubblefit")
        # What is pure is installed where modules of Python are; only the tag is of a platform.
        self.root_is_pure = not any(folder.glob("kernels-*"))
        tag = super().get_tag()
        self.root_is_pure = True
        return tag


INSIDE = [name for name in find_packages(".") if name.split(".")[0] not in APART]
setup(
    long_description=index_page(),
    long_description_content_type="text/markdown",
    packages=["bubblefit", *(f"bubblefit.{name}" for name in INSIDE)],
    cmdclass={"build_py": Modules, "bdist_wheel": Wheel},
)
