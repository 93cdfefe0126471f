"""The repository root is the package `bubblefit`: which of its folders are packages of it.

Pages of the Python interface and compiled kernels need bubblefit's dependencies to be made. They
are left out of the package if the environment that builds it does not have these.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import find_packages, setup
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
#: Compiles what fits and cylinders use, in the user's cache as a run would; prints the folder.
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
        bf.simulate(tube, fit.card)
print(kernel_folder() or "")
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
        """Build the modules, then make pages and kernels with them and add these."""
        super().run()
        if not self.editable_mode:
            package = Path(self.build_lib, "bubblefit")
            self.run_python("docs/make_api.py", package / "docs/reference/api")
            kernels = Path(self.run_python("-c", COMPILE))
            if kernels.name:
                shutil.copytree(kernels, package / kernels.name, dirs_exist_ok=True)
            else:
                print("bubblefit: the kernels were not compiled; the first run compiles them")

    def run_python(self, *arguments):
        """Run Python on the modules that are built; return the last line that it prints."""
        # pip names its isolated environment by this variable, too.
        isolated = os.environ.get("PYTHONPATH")
        paths = [os.path.abspath(self.build_lib), *([isolated] if isolated else [])]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
        command = [sys.executable, *arguments]
        process = subprocess.run(command, env=environment, capture_output=True, text=True)
        return process.stdout.strip().rpartition("\n")[2] if process.returncode == 0 else ""

    def find_package_modules(self, package, package_dir):
        """Return (package, module, path) of what is installed."""
        modules = super().find_package_modules(package, package_dir)
        return [module for module in modules if (package, module[1]) != ("bubblefit", "setup")]


INSIDE = [name for name in find_packages(".") if name.split(".")[0] not in APART]
setup(
    long_description=index_page(),
    long_description_content_type="text/markdown",
    packages=["bubblefit", *(f"bubblefit.{name}" for name in INSIDE)],
    cmdclass={"build_py": Modules},
)
