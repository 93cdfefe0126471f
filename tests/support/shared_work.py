"""Share compiled modules, and drawings of the same chart, among the processes of a run of tests."""

import hashlib
import json
import os
import shutil
import sys
import tempfile
import threading
from contextlib import suppress
from pathlib import Path

from .paths import ROOT

FORBIDDEN, PREFIX = "PYTHONDONTWRITEBYTECODE", "PYTHONPYCACHEPREFIX"


def share_compiled_modules(keeps):
    """Return the folder where this process and those it starts keep compiled modules, or None.

    Only where none may be kept beside the sources: each program would compile them for a second.
    Those of the interpreter and the libraries stay for later runs, and those of this repository if
    the run keeps anything: not with faults put in, which may have the size and the second of what
    they take the place of.
    """
    if not sys.dont_write_bytecode or PREFIX in os.environ:
        return None
    folder = tempfile.mkdtemp(prefix="bubblefit-tests-")
    places = {sys.base_prefix, sys.prefix}
    keep_compiled_modules(Path(folder), places | {str(ROOT)} if keeps else places)
    os.environ.pop(FORBIDDEN, None)
    os.environ[PREFIX] = sys.pycache_prefix = folder
    sys.dont_write_bytecode = False
    return folder


def keep_compiled_modules(folder, places):
    """Have compiled modules of places go from a folder of a run into one below .pytest_cache."""
    kept = ROOT / ".pytest_cache" / "compiled"
    for place in sorted(places):
        relative = Path(place).relative_to(Path(place).anchor)
        link = folder / relative
        if not any(parent.is_symlink() for parent in link.parents):
            link.parent.mkdir(parents=True, exist_ok=True)
            (kept / relative).mkdir(parents=True, exist_ok=True)
            link.symlink_to(kept / relative)


def forbid_compiled_modules(folder):
    """Undo `share_compiled_modules`."""
    shutil.rmtree(folder, ignore_errors=True)
    del os.environ[PREFIX]
    os.environ[FORBIDDEN] = "1"
    sys.pycache_prefix, sys.dont_write_bytecode = None, True


def rotated(files):
    """Return files from another one on in each process of a run, which share them alike.

    What a process has compiled by then, the others read: that takes a third of the time.
    """
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")
    count = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    first = len(files) * int(worker) // count
    return [*files[first:], *files[:first]]


#: Keys of texts in a specification.
TITLES = {"usermeta", "title", "text"}


def kind_of(part):
    """Return a specification without numbers and titles, and each kind of item once."""
    if isinstance(part, int | float) and not isinstance(part, bool):
        return 0
    if isinstance(part, dict):
        return {key: kind_of(value) for key, value in part.items() if key not in TITLES}
    if isinstance(part, list | tuple):
        return list({json.dumps(kind_of(value)): None for value in part})
    return part


class Drawings:
    """Draw a chart of each kind once, with a converter; the drawings lie in a folder.

    Charts of one kind differ in numbers and titles, at which no test looks in a drawing; to draw
    takes a third of the time of a command. tests/reports draws every chart.
    """

    def __init__(self, convert, folder):
        self.convert, self.folder = convert, Path(folder)
        self.folder.mkdir(exist_ok=True)

    def __call__(self, kind, spec):
        text = json.dumps([kind, kind_of(spec)])
        path = self.folder / f"{hashlib.sha256(text.encode()).hexdigest()}.{kind}"
        if not path.exists():
            drawing = self.convert(kind, spec)
            complete = path.with_name(f"{path.name}.{os.getpid()}.{threading.get_ident()}")
            complete.write_bytes(drawing)
            with suppress(FileExistsError):  # that of another process, drawn meanwhile, stays
                path.hardlink_to(complete)
            complete.unlink()
        return path.read_bytes()


class Pictures:
    """Make each picture of a page smaller once, with `html.data_uri`."""

    def __init__(self, data_uri):
        self.data_uri, self.links = data_uri, {}

    def __call__(self, folder, file):
        path = (folder / file).resolve()
        if not path.is_file() or not path.is_relative_to(folder.resolve()):
            return self.data_uri(folder, file)
        digest = hashlib.sha256(path.read_bytes()).digest()
        if digest not in self.links:
            self.links[digest] = self.data_uri(folder, file)
        return self.links[digest]


def folder_of_run(tmp_path_factory):
    """Return the temporary folder that all workers of a run share."""
    folder = tmp_path_factory.getbasetemp()
    return folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder
