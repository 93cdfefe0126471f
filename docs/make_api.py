"""Write the pages of the Python interface from the docstrings.

They are not tracked: the site and the wheel make them when they are built.

python docs/make_api.py            # into docs/reference/api (make docs)
python docs/make_api.py FOLDER
"""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
API = HERE / "reference" / "api"
#: Title and contents of each page, as MODULE or MODULE:NAME,NAME (in bubblefit).
PAGES: dict[str, tuple[str, tuple[str, ...]]] = {
    "fits": (
        "Projects, fits, predictions",
        ("project.objects:Bubble,Strips,Biaxial,Cylinder,Sheet,Registration,Law",
         "project.measured:read,register,Registered", "experiments.fabric:Fabric",
         "project.project:read_project,Project", "runs.fit:fit", "runs.check:check",
         "runs.result:Fit",
         "runs.simulation", "runs.predictions:predict,Predictions",
         "experiments.cycles.evaluation:cycles,Cycles",
         "experiments.cycles.values:EvaluatedHistory,CycleValues",
         "materials.card:MaterialCard,read_card,write_card,thickness_difference"),
    ),
    "studies": (
        "Studies",
        ("runs.refinement:refine,Refinement,convergence,Convergence,vary_nu12,Nu12Study,Ratios",
         "runs.compare:compare,LawComparison",
         "runs.plan:plan,Plan,Prospect", "runs.profile:profile,Profiles,Profile",
         "runs.bootstrap:bootstrap,Bootstrap",
         "runs.validation:validate,judge_cards,Validation,weights,WeightStudy",
         "runs.verification:verify,Verification",
         "runs.estimate:estimate"),
    ),
    "tests": ("Kinds of test", ("experiments.own:OwnTest", "experiments.base",
                                "experiments.predicted", "experiments.presenter",
                                "experiments.registry",
                                "inference.comparison:Comparison,Objective")),
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
    for part in parts:
        module_name, _, names = part.partition(":")
        module = importlib.import_module(f"bubblefit.{module_name}")
        blocks.append(f"## `bubblefit.{module_name}`")
        if not names:
            blocks.append(text_of(module))
        for name in names.split(",") if names else public_names(module):
            blocks += described(name, getattr(module, name))
    return "\n\n".join(block.strip() for block in blocks if block.strip()) + "\n"


def public_names(module: Any) -> list[str]:
    """Return the functions and classes that a module defines, in its order."""
    found = [
        (inspect.getsourcelines(thing)[1], name)
        for name, thing in vars(module).items()
        if not name.startswith("_")
        and (inspect.isclass(thing) or inspect.isfunction(thing))
        and thing.__module__ == module.__name__
    ]
    return [name for _, name in sorted(found)]


def described(name: str, thing: Any) -> list[str]:
    """Return heading, signature and docstring, of a class also those of its members."""
    if not inspect.isclass(thing):
        return [f"### {name}", signature(name, thing), text_of(thing)]
    blocks = [f"### class {name}"]
    if "__init__" in vars(thing) and not getattr(thing, "_is_protocol", False):
        blocks.append(signature(name, thing))
    blocks.append(text_of(thing))
    for member, value in vars(thing).items():
        function: Any = value
        if isinstance(value, classmethod | staticmethod):
            function = value.__func__
        if member.startswith("_"):
            continue
        if isinstance(function, property) or hasattr(function, "attrname"):
            read = function.fget if isinstance(function, property) else function.func
            result = str(read.__annotations__.get("return", ""))
            words = f"`{member}`" + (f": `{result}`" if result else "")
            blocks.append(f"{words}. {text_of(read)}")
        elif inspect.isfunction(function):
            blocks += [signature(member, function), text_of(function)]
    return blocks


def signature(name: str, thing: Any) -> str:
    """Return the signature as Python code, one argument a line if it is long."""
    said = inspect.signature(thing)
    arguments = [_argument(p) for p in said.parameters.values() if p.name != "self"]
    starred = [i for i, p in enumerate(said.parameters.values()) if p.kind is p.KEYWORD_ONLY]
    if starred and not any(a.startswith("*") for a in arguments):
        first = [*said.parameters].index([*said.parameters][starred[0]])
        arguments.insert(first - ("self" in said.parameters), "*")
    result = said.return_annotation
    plain = inspect.isclass(thing) or result is inspect.Signature.empty
    arrow = "" if plain else f" -> {_annotation(result)}"
    words = f"{name}({', '.join(arguments)}){arrow}"
    if len(words) > 96:
        words = "\n".join([f"{name}(", *(f"    {a}," for a in arguments), f"){arrow}"])
    return f"```python\n{words}\n```"


def _argument(parameter: inspect.Parameter) -> str:
    words = parameter.name
    if parameter.kind is parameter.VAR_POSITIONAL:
        words = f"*{words}"
    elif parameter.kind is parameter.VAR_KEYWORD:
        words = f"**{words}"
    if parameter.annotation is not parameter.empty:
        words += f": {_annotation(parameter.annotation)}"
    if parameter.default is not parameter.empty:
        words += f" = {parameter.default!r}"
    return words


def _annotation(annotation: Any) -> str:
    return annotation if isinstance(annotation, str) else inspect.formatannotation(annotation)


def text_of(thing: Any) -> str:
    """Return the docstring with sections in bold and entries as lists."""
    head, _, rest = (inspect.getdoc(thing) or "").partition("\n")
    text = f"{head}\n\n{rest.strip()}".strip()
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
            entries.append((f"`{name}` ({kind})" if kind else f"`{name}`", []))
    return "\n".join(
        f"- {head}: {' '.join(words)}" if words else f"- {head}" for head, words in entries
    )


def pages() -> dict[str, str]:
    """Return the text of every page by the name of its file."""
    return {f"{name}.md": page(*what) for name, what in PAGES.items()}


def write(folder: Path) -> None:
    """Write every page into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pages().items():
        (folder / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]) if sys.argv[1:] else API)
