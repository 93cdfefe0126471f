"""Input decks from Jinja2 templates, ours or the user's, and digests of all that shapes a run."""

import functools
import hashlib
import re
import sys
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from ..errors import InputError
from ..storage.reading import MAX_TEXT_SIZE, checksum, input_errors, is_file, read_bytes
from ..storage.templates import template_environment
from ..storage.writing import ROOT, TEMPLATES
from .base import History

#: Names of another file in a deck: a line INCLUDE (Marc), a value of a keyword's line (CalculiX).
_INCLUDE = re.compile(r"^\s*include\b\s*(?P<file>.*)", re.IGNORECASE)
_VALUE = re.compile(r"=\s*(?P<file>[^,]*)")
_ELSEWHERE = re.compile(r"[/\\\0]|^\s*[\"']?\s*(\.\.|~)")
#: Folders and suffixes of the files that determine a run of one of our own adapters.
FOLDERS = ("materials", "meshes", "solvers", "templates", "experiments/deck")
CODE = (".py", ".j2", ".c", ".f")
file_mark = checksum  #: documented for plug-ins


#: Name of the files of a user's deck, without the ending.
JOB = "job"


class ResultReader(Protocol):
    """Reads what is compared from the results of a deck; a dataclass, for the cache of runs."""

    def read(self, folder: Path) -> History:
        """Return the compared values as loads; SolverFailure where the results lack one."""


@dataclass(frozen=True, eq=False)
class UserDeck:
    """A model that is the user's own input deck.

    Attributes
    ----------
    files : mapping of str or bytes
        Content of the files of a run by name, the deck itself among them.
    reader : ResultReader
    command : tuple of str
        Words of the command that runs it; empty for a solver that knows its own.
    timeout : float or None, s
        Time after which a run is ended; that of the solver unless given.
    program : str
        Digest of the command's program.
    """

    files: Mapping[str, str | bytes]
    reader: ResultReader
    command: tuple[str, ...] = ()
    timeout: float | None = None
    program: str = ""


def render(
    solver: str,
    name: str,
    context: Mapping[str, Any],
    folder: Path | None = None,
    instead: Mapping[str, Path] | None = None,
) -> str:
    """Return the deck that a template of a solver makes of variables.

    Parameters
    ----------
    solver, name : str
        Names of the solver and of its template.
    context : mapping
        The variables.
    folder : Path, optional
        The user's own templates; the template must be there.
    instead : mapping of str to Path, optional
        Files in place of templates that the template includes.

    Raises
    ------
    InputError
        A template is missing, unreadable, or wrong, and in which line.
    """
    import jinja2

    folders = [TEMPLATES / solver]
    if folder is not None:
        if not is_file(folder / name):
            problem = f"holds no {name}; copy {TEMPLATES / solver / name} there and change it"
            raise InputError(folder, "templates", problem)
        folders.insert(0, folder)
    files = dict(instead or {})
    loaders: list[jinja2.BaseLoader] = [
        jinja2.FunctionLoader(lambda template: _of_file(files, template)),
        jinja2.FileSystemLoader(folders),
    ]
    decks = template_environment(jinja2.ChoiceLoader(loaders))
    decks.filters |= {"number": _number, "i10": _i10, "e20": _e20}
    try:
        text = decks.get_template(name).render(context)
    except jinja2.TemplateSyntaxError as error:
        where = Path(error.filename or folders[0] / name)
        raise InputError(where, f"line {error.lineno}", error.message or "syntax error") from None
    except jinja2.TemplateNotFound as error:
        raise InputError(folders[0] / name, "include", f"no template {error.name}") from None
    except UnicodeDecodeError:
        raise InputError(folders[0] / name, "", "is not a text file in UTF-8") from None
    except InputError:
        raise
    except Exception as error:  # whatever the template's expressions do
        where, line = _place(error, folders[0] / name, [str(file) for file in files.values()])
        variables = ""
        if isinstance(error, jinja2.UndefinedError):
            variables = f"; there are: {', '.join(sorted(context))}"
        raise InputError(where, f"line {line}", f"{error}{variables}") from None
    _check_inside(text, folders[0] / name)
    return text


def _check_inside(text: str, template: Path) -> None:
    """Raise InputError where a line of a deck names a file outside the run's own folder."""
    keyword = False
    for number, plain in enumerate(text.splitlines(), start=1):
        line = plain.strip()
        if line.startswith("**"):
            continue
        # A keyword's line that ends with a comma is continued in the next one.
        keyword = line.startswith("*") or keyword
        included = _INCLUDE.match(line)
        file_names = [included] if included else list(_VALUE.finditer(line)) if keyword else []
        keyword = keyword and line.endswith(",")
        for file_name in file_names:
            if _ELSEWHERE.search(file_name["file"]):
                elsewhere = file_name["file"].strip()
                problem = (
                    f"line {number} of the deck names a file elsewhere, {elsewhere!r}; "
                    'put its text into the deck: {% include "NAME" %}'
                )
                raise InputError(template, "", problem)


def _number(value: float) -> str:
    """Return the shortest decimal of 13 digits: 0.81, not 0.8100000000000001."""
    # At most 20 characters: CalculiX reads no more, and would lose the end of an exponent.
    return f"{float(value):.13g}"


def _i10(values: int | Sequence[int]) -> str:
    """Return whole numbers, 10 columns each (Marc's extended format)."""
    numbers = [values] if isinstance(values, int) else values
    fields = [f"{number:10d}" for number in numbers]
    if any(len(field) > 10 for field in fields):
        raise ValueError(f"a number of more than 10 digits: {max(numbers)}")
    return "".join(fields)


def _e20(values: float | Sequence[float]) -> str:
    """Return numbers, 20 columns and 13 digits each."""
    numbers = [values] if isinstance(values, int | float) else values
    return "".join(f"{number:20.12E}" for number in numbers)


def _of_file(files: Mapping[str, Path], name: str) -> tuple[str, str, None] | None:
    """Return text, name and None as Jinja2 asks a loader; None where no file is given."""
    if name not in files:
        return None
    path = files[name]
    with input_errors(path):
        text = read_bytes(path, MAX_TEXT_SIZE).decode("utf-8").replace("\r\n", "\n")
    # The next block begins on a line of its own.
    return text if text.endswith("\n") else text + "\n", str(path), None


def _place(error: BaseException, default: Path, files: Sequence[str] = ()) -> tuple[Path, int]:
    """Return template file and line of an error; Jinja2 puts them into the traceback."""
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        if frame.filename.endswith(".j2") or frame.filename in files:
            return Path(frame.filename), frame.lineno or 0
    return default, 0


def in_words(name: str, version: str, **settings: object) -> str:
    """Return a solver, its version and the settings that matter, in one line."""
    parts = [f"{name} {version}".rstrip(), *(f"{key}={value}" for key, value in settings.items())]
    return "; ".join(parts)


def templates_mark(folder: Path | None) -> str:
    """Return the SHA-256 of a folder's templates and files they include, names and contents."""
    if folder is None:
        return ""
    waiting = sorted(path.relative_to(folder) for path in folder.rglob("*.j2") if path.is_file())
    marks: dict[str, str] = {}
    while waiting:
        name = waiting.pop()
        if name.as_posix() not in marks:
            marks[name.as_posix()] = checksum(folder / name)
            waiting += [
                included for included in _included(folder / name) if (folder / included).is_file()
            ]
    return hashlib.sha256(repr(sorted(marks.items())).encode()).hexdigest()


def program_mark(path: Path) -> str:
    """Return the SHA-256 of a program's content, of a script's own text; InputError if unread."""
    with input_errors(path):
        about = path.stat()
    return _program_mark(path, about.st_mtime_ns, about.st_size, about.st_ino)


@functools.lru_cache(maxsize=64)
def _program_mark(path: Path, *_: int) -> str:
    # Some megabytes: read again only where the file has changed.
    return checksum(path)


@functools.cache
def code_mark(module: str) -> str:
    """Return the SHA-256 of `FOLDERS` and of a plug-in's package or `module`."""
    files = {
        path.relative_to(ROOT).as_posix(): path
        for name in FOLDERS
        for path in (ROOT / name).rglob("*")
    }
    top = module.partition(".")[0]
    if top != __package__.partition(".")[0]:
        package = sys.modules.get(top)
        for folder in map(Path, getattr(package, "__path__", ())):
            files |= {f"{top}/{p.relative_to(folder).as_posix()}": p for p in folder.rglob("*.py")}
        if not hasattr(package, "__path__") and getattr(package, "__file__", None):
            files[f"{top}.py"] = Path(str(getattr(package, "__file__")))  # noqa: B009
    marks = {name: checksum(path) for name, path in files.items() if path.suffix in CODE}
    return hashlib.sha256(repr(sorted(marks.items())).encode()).hexdigest()


def _included(template: Path) -> list[Path]:
    """Return the files that a template names in full; its mistakes are left to the run."""
    import jinja2.meta

    with input_errors(template):
        content = template.read_bytes()
    try:
        tree = template_environment(jinja2.BaseLoader()).parse(content.decode("utf-8"))
    except (jinja2.TemplateSyntaxError, UnicodeDecodeError):
        return []
    names = jinja2.meta.find_referenced_templates(tree)
    return [Path(name) for name in names if name is not None]
