"""Write the pages of the Python interface from the docstrings.

They are not tracked: the site and the wheel make them when they are built.

python docs/make_api.py            # into docs/reference/api (make docs)
python docs/make_api.py FOLDER
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import bubblefit

HERE = Path(__file__).resolve().parent
API = HERE / "reference" / "api"
#: Title and contents of each page, as MODULE or MODULE:NAME,NAME (in bubblefit).
PAGES: dict[str, tuple[str, tuple[str, ...]]] = {
    "fits": (
        "Projects, fits, predictions",
        ("project.objects:Bubble,Strips,Biaxial,Cylinder,Deck,Sheet,Registration,Law",
         "project.measured:read,register,Registered", "experiments.sections:Fabric",
         "project.project:read_project,Project", "runs.fit:fit", "runs.check:check",
         "runs.result:Fit",
         "runs.simulation", "runs.predictions:predict,Predictions",
         "experiments.cycles.evaluation:cycles,Cycles",
         "experiments.cycles.values:EvaluatedHistory,CycleValues",
         "materials.card:MaterialCard,ModulusBand,read_card,write_card,thickness_difference",
         "notes:BubblefitWarning"),
    ),
    "studies": (
        "Studies",
        ("runs.refinement:refine,Refinement,vary_nu12,Nu12Study,Ratios",
         "runs.convergence:convergence,Convergence",
         "runs.compare:compare,LawComparison",
         "runs.plan:plan,Plan,Prospect", "runs.profile:profile,Profiles,Profile",
         "runs.bootstrap:bootstrap,Bootstrap",
         "runs.validation:validate,judge_cards,Validation",
         "runs.weight_study:weights,WeightStudy",
         "runs.verification.verify:verify,Verification",
         "runs.estimate:estimate"),
    ),
    "tests": ("Kinds of test", ("experiments.own:OwnTest", "experiments.base",
                                "experiments.predicted",
                                "experiments.registry",
                                "inference.comparison:Comparison",
                                "inference.objective:Objective")),
    "laws": ("Laws", ("materials.law:HypoelasticLaw", "materials.forms.spline:Form",
                      "materials.forms.base")),
    "readers": (
        "Readers of data",
        ("readers.registry", "readers.frames:Frame,FrameOptions,FrameRows,frame_of,read_frames",
         "readers.machine_tables:MachineTable,TableOptions,Channel,read_machine_table",
         "readers.tables:TextTable,read_lines", "readers.text_frames:read_text_rows",
         "readers.curves:LoadCurve,read_load_curves"),
    ),
    "solvers": ("Solvers", ("solvers.base", "solvers.registry")),
    "methods": ("Optimisers", ("inference.methods",)),
}  # fmt: skip
HEAD = "<!-- Written by docs/make_api.py from the docstrings. -->\n"
SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)


def page(title: str, parts: tuple[str, ...]) -> str:
    """Return the text of a page."""
    blocks = [HEAD, f"# {title}"]
    modules = []
    for part in parts:
        module_name, _, names = part.partition(":")
        module = importlib.import_module(f"bubblefit.{module_name}")
        modules.append(module)
        if names:
            for name in names.split(","):
                thing = getattr(module, name)
                blocks += described(f"## `{public_name(module, name)}`", name, thing)
        else:
            blocks += [f"## `{module.__name__}`", text_of(module)]
            for name in public_names(module):
                heading = public_name(module, name).removeprefix(f"{module.__name__}.")
                blocks += described(f"### `{heading}`", name, getattr(module, name))
    blocks.append(aliases("\n".join(blocks), modules))
    return "\n\n".join(block.strip() for block in blocks if block.strip()) + "\n"


def public_name(module: Any, name: str) -> str:
    """Return the name under which users import an object of a module."""
    is_public = name in bubblefit.__all__ and getattr(bubblefit, name) is getattr(module, name)
    return f"bubblefit.{name}" if is_public else f"{module.__name__}.{name}"


def aliases(text: str, modules: Sequence[Any]) -> str:
    """Return what the names of types mean that signatures on a page have, "" if none has any."""
    words = set(re.findall(r"\w+", " ".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))))
    lines = {}
    for module in modules:
        for node in ast.parse(inspect.getsource(module)).body:
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                name = node.targets[0].id
                if name in words and name[0].isupper() and not name.isupper():
                    lines[name] = f"- `{name}`: `{ast.unparse(node.value)}`"
    if not lines:
        return ""
    return "\n".join(["## Types\n", *(lines[name] for name in sorted(lines))])


def public_names(module: Any) -> list[str]:
    """Return the functions and classes that a module defines, in its order."""
    lines = [
        (_definition(thing).lineno, name)
        for name, thing in vars(module).items()
        if not name.startswith("_")
        and (inspect.isclass(thing) or inspect.isfunction(thing))
        and thing.__module__ == module.__name__
    ]
    return [name for _, name in sorted(lines)]


def described(heading: str, name: str, thing: Any) -> list[str]:
    """Return heading, signature and docstring, of a class also those of its members."""
    if not inspect.isclass(thing):
        return [heading, signature(name, thing), text_of(thing)]
    blocks = [heading]
    has_init = "__init__" in vars(thing) and not getattr(thing, "_is_protocol", False)
    if has_init:
        blocks.append(signature(name, thing))
    blocks.append(text_of(thing))
    if has_init and thing.__init__.__doc__:
        blocks.append(text_of(thing.__init__))
    properties = []
    methods = []
    for member, value in vars(thing).items():
        function: Any = value
        if isinstance(value, classmethod | staticmethod):
            function = value.__func__
        if member.startswith("_"):
            continue
        if isinstance(function, property) or hasattr(function, "attrname"):
            properties.append(_property(member, function))
        elif inspect.isfunction(function):
            depth = heading.partition(" ")[0]
            methods += [f"{depth}# `{name}.{member}`", signature(member, function)]
            methods.append(text_of(function))
    if properties:
        blocks.append("\n".join(["**Properties**\n", *properties]))
    return [*blocks, *methods]


def _property(name: str, value: Any) -> str:
    """Return the entry of a property, or of a cached one."""
    read = value.fget if isinstance(value, property) else value.func
    result = _source_annotations(read).get("return", "")
    text = " ".join(text_of(read).split())
    return f"- `{name}`{f' ({result})' if result else ''}{f': {text}' if text else ''}"


def signature(name: str, thing: Any) -> str:
    """Return the signature as Python code, one argument a line if it is long."""
    parameters = inspect.signature(thing).parameters
    annotations = _source_annotations(thing)
    arguments = []
    has_star = False
    for parameter in parameters.values():
        if parameter.name in ("self", "cls"):
            continue
        if parameter.kind is parameter.KEYWORD_ONLY and not has_star:
            arguments.append("*")
        has_star |= parameter.kind in (parameter.KEYWORD_ONLY, parameter.VAR_POSITIONAL)
        arguments.append(_argument(parameter, annotations.get(parameter.name, "")))
    result = "" if inspect.isclass(thing) else annotations.get("return", "")
    arrow = f" -> {result}" if result else ""
    words = f"{name}({', '.join(arguments)}){arrow}"
    if len(words) > 96:
        words = "\n".join([f"{name}(", *(f"    {a}," for a in arguments), f"){arrow}"])
    return f"```python\n{words}\n```"


def _argument(parameter: inspect.Parameter, annotation: str) -> str:
    """Return an argument of a signature."""
    words = parameter.name
    if parameter.kind is parameter.VAR_POSITIONAL:
        words = f"*{words}"
    elif parameter.kind is parameter.VAR_KEYWORD:
        words = f"**{words}"
    if annotation:
        words += f": {annotation}"
    if parameter.default is not parameter.empty:
        # The text of a function would hold its address, another one in each build.
        is_function = inspect.isfunction(parameter.default)
        words += " = ..." if is_function else f" = {parameter.default!r}"
    return words


def _source_annotations(thing: Any) -> dict[str, str]:
    """Return annotations by name as the source has them: aliases under their names."""
    if inspect.isclass(thing):
        annotations: dict[str, str] = {}
        for cls in reversed(thing.__mro__):
            if cls.__module__.startswith("bubblefit."):
                annotations |= _class_annotations(cls)
        return annotations
    node = _definition(thing)
    assert isinstance(node, ast.FunctionDef)
    return _function_annotations(node)


def _class_annotations(cls: type) -> dict[str, str]:
    """Return the annotations of the fields of a class, and of its __init__."""
    node = _definition(cls)
    assert isinstance(node, ast.ClassDef)
    annotations = {}
    for member in node.body:
        if isinstance(member, ast.AnnAssign) and isinstance(member.target, ast.Name):
            annotations[member.target.id] = ast.unparse(member.annotation)
        elif isinstance(member, ast.FunctionDef) and member.name == "__init__":
            annotations |= _function_annotations(member)
    return annotations


def _definition(thing: Any) -> ast.FunctionDef | ast.ClassDef:
    """Return the syntax tree of a function or a class."""
    return _definitions(thing.__module__)[thing.__qualname__]


@cache
def _definitions(module: str) -> dict[str, ast.FunctionDef | ast.ClassDef]:
    """Return the functions and classes of a module, and those of its classes, by qualified name."""
    definitions: dict[str, ast.FunctionDef | ast.ClassDef] = {}

    def add(body: Sequence[ast.stmt], prefix: str) -> None:
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                definitions[f"{prefix}{node.name}"] = node
            if isinstance(node, ast.ClassDef):
                add(node.body, f"{prefix}{node.name}.")

    add(ast.parse(inspect.getsource(sys.modules[module])).body, "")
    return definitions


def _function_annotations(node: ast.FunctionDef) -> dict[str, str]:
    """Return the annotations of the arguments of a function, and of its result as "return"."""
    arguments = node.args
    named = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    named += [extra for extra in (arguments.vararg, arguments.kwarg) if extra is not None]
    annotations = {a.arg: ast.unparse(a.annotation) for a in named if a.annotation is not None}
    if node.returns is not None:
        annotations["return"] = ast.unparse(node.returns)
    return annotations


def text_of(thing: Any) -> str:
    """Return the docstring with sections in bold and entries as lists."""
    summary, _, details = (inspect.getdoc(thing) or "").partition("\n")
    text = f"{summary}\n\n{details.strip()}".strip()
    if inspect.isclass(thing) and (thing.__doc__ or "").startswith(f"{thing.__name__}("):
        return ""  # the default docstring of a dataclass
    parts = SECTION.split(text)
    blocks = [parts[0].strip()]
    for head, body in zip(parts[1::2], parts[2::2], strict=True):
        blocks.append(f"**{head}**\n\n{_entries(body)}")
    return "\n\n".join(blocks)


def _entries(body: str) -> str:
    """Return a list of the entries of a section: "name : type", or a type, and words below."""
    entries: list[tuple[str, list[str]]] = []
    for line in body.strip().splitlines():
        if line.startswith(" "):
            entries[-1][1].append(line.strip())
        elif line:
            name, _, kind = line.partition(" : ")
            entries.append((f"`{name}`, *{kind}*" if kind else f"`{name}`", []))
    return "\n".join(
        f"- {head}: {' '.join(words)}" if words else f"- {head}" for head, words in entries
    )


def pages() -> dict[str, str]:
    """Return the text of every page by the name of its file."""
    return {f"{name}.md": page(title, parts) for name, (title, parts) in PAGES.items()}


def write(folder: Path) -> None:
    """Write every page into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pages().items():
        (folder / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]) if sys.argv[1:] else API)
