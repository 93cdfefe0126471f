"""Presenters by the class of what they present.

A kind of test or a result imports nothing that shows it: what does, in `reports`, lies above and
registers itself here. `bubblefit` itself, above all, says how to load a presenter when one is
first needed, so that a run which shows nothing imports nothing of `reports`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

P = TypeVar("P")


class Presenters(Generic[P]):
    """Presenters of one sort of objects by their class.

    Attributes
    ----------
    load : callable
        Imports the module that registers the presenter of an object, where there is one.
    """

    def __init__(self) -> None:
        self._by_class: dict[type, P] = {}
        self.load: Callable[[Any], object] = lambda presented: None

    def register(self, cls: type, presenter: P) -> None:
        """Let a presenter present the objects of a class, those of its subclasses too."""
        self._by_class[cls] = presenter

    def of(self, presented: object) -> P | None:
        """Return the presenter of an object, loaded if need be; None where there is none."""
        presenter = self.registered(presented)
        if presenter is None:
            self.load(presented)
            presenter = self.registered(presented)
        return presenter

    def registered(self, presented: object) -> P | None:
        """Return the presenter of an object without loading one."""
        classes = (cls for cls in type(presented).__mro__ if cls in self._by_class)
        cls = next(classes, None)
        return None if cls is None else self._by_class[cls]


#: Presenters of kinds of test.
KINDS = Presenters[Any]()
#: Functions that write the files of a result into a folder and return the path of its page.
PAGES = Presenters[Callable[[Any, Path], Path]]()
#: Functions that draw a result for a notebook, by the name of the drawing.
DRAWINGS = Presenters[Mapping[str, Callable[..., Any]]]()
