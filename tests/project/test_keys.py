"""project/keys.pyi: the types of keyword arguments are those of the sections of a project file."""

import ast
import inspect
import typing

import pytest
from bubblefit.project import keys as keys_module
from bubblefit.project import objects
from bubblefit.runs.fit import fit

from ..support.paths import ROOT, load_script

make_keys = load_script("docs/make_keys.py")


def parsed(text):
    """Return the names and types of each class by its name."""
    return {
        node.name: {
            line.target.id: ast.unparse(line.annotation)
            for line in node.body
            if isinstance(line, ast.AnnAssign)
        }
        for node in ast.parse(text).body
        if isinstance(node, ast.ClassDef)
    }


def test_file_is_what_the_sections_say():
    """If not: python docs/make_keys.py."""
    current = parsed((ROOT / "project" / "keys.pyi").read_text())
    assert current == parsed(make_keys.text())
    assert current["BubbleKeys"]["elements"] == "int"
    assert {*current} == {name for name in vars(keys_module) if name.endswith("Keys")} - {"_Keys"}


@pytest.mark.parametrize(
    "function",
    [
        objects.Bubble.__init__,
        objects.Bubble.read,
        objects.Strips.__init__,
        objects.Strips.read,
        objects.Biaxial.__init__,
        objects.Biaxial.read,
        objects.Cylinder.__init__,
        objects.Cylinder.read,
        objects.Deck.__init__,
        objects.Sheet.__init__,
        objects.Registration.__init__,
        objects.Law.__init__,
        fit,
    ],
)
def test_no_key_is_an_argument_by_name_as_well(function):
    signature = inspect.signature(function)
    (rest,) = [p for p in signature.parameters.values() if p.kind is p.VAR_KEYWORD]
    name = str(rest.annotation).removeprefix("Unpack[").removesuffix("]")
    classes = parsed((ROOT / "project" / "keys.pyi").read_text())
    keys = {*classes[name]}
    if name.endswith("FileKeys"):
        keys |= {*classes[name.replace("File", "")]}
    assert not keys & {*signature.parameters}


def test_type_of_a_field():
    assert make_keys.type_text(typing.Literal["a", "b"] | None) == 'Literal["a", "b"] | None'
    assert make_keys.type_text(list[float]) == "ArrayLike"
    assert make_keys.type_text(list[str]) == "Sequence[str]"
