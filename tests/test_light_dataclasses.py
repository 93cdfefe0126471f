"""Dataclasses that share their methods behave as those of the standard library."""

import copy
import dataclasses
import inspect
import pickle

import pytest
from bubblefit.light_dataclasses import light_dataclass

DECORATORS = (light_dataclass, dataclasses.dataclass)


@light_dataclass(frozen=True)
class Point:
    x: float
    y: float = 2.0
    label: str = dataclasses.field(default="", repr=False, compare=False)
    parts: list = dataclasses.field(default_factory=list)


@light_dataclass(frozen=True, eq=False)
class Sheet:
    thickness: float


class HeavySheet(Sheet):
    def __init__(self, thickness):
        super().__init__(thickness)
        self.weight = 2.0 * thickness


def test_equality_hash_and_text_are_those_of_the_fields():
    assert Point(1.0) == Point(1.0, 2.0, "other") != Point(2.0)
    assert Point(1.0) != Sheet(1.0)
    assert repr(Point(1.0)) == "Point(x=1.0, y=2.0, parts=[])"
    assert str(inspect.signature(Point)).startswith("(x: float, y: float = 2.0, ")
    assert dataclasses.replace(Point(1.0), x=3.0) == Point(3.0)
    assert dataclasses.asdict(Point(1.0)) == {"x": 1.0, "y": 2.0, "label": "", "parts": []}
    pair = [light_dataclass(frozen=True)(type("Pair", (), {"__annotations__": {"a": int}}))(1)]
    assert hash(pair[0]) == hash((1,)) and {pair[0]: 3}[type(pair[0])(1)] == 3
    assert Sheet(1.0) != Sheet(1.0) and len({Sheet(1.0), Sheet(1.0)}) == 2


def test_fields_are_frozen():
    for instance in (Point(1.0), Sheet(1.0), copy.copy(Sheet(1.0)), HeavySheet(1.0)):
        name = dataclasses.fields(instance)[0].name
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(instance, name, 3.0)
        with pytest.raises(dataclasses.FrozenInstanceError):
            delattr(instance, name)
    with pytest.raises(dataclasses.FrozenInstanceError):
        Sheet(1.0).area = 3.0
    assert HeavySheet(1.5).weight == 3.0  # a subclass that is no dataclass may have attributes
    assert pickle.loads(pickle.dumps(Point(1.0, 5.0))) == Point(1.0, 5.0)


@pytest.mark.parametrize("base", DECORATORS)
@pytest.mark.parametrize("derived", DECORATORS)
def test_light_and_standard_classes_derive_from_each_other(base, derived):
    first = base(frozen=True)(type("First", (), {"__annotations__": {"a": int}}))
    second = type("Second", (first,), {"__annotations__": {"b": int}, "b": 2})
    second = derived(frozen=True)(second)
    instance = second(1)
    assert repr(instance) == "Second(a=1, b=2)" and instance == second(1, 2)
    assert hash(instance) == hash((1, 2))
    with pytest.raises(dataclasses.FrozenInstanceError):
        instance.b = 3
