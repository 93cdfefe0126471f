"""Registry of presenters: the functions and objects that show a result, by the result's class.

Results and kinds of test do not import the code that shows them. That code, in `reports`,
registers its presenters here. The package's `__init__` says how a presenter is loaded when it is
first needed, so that a run which shows nothing imports nothing of `reports`.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

P = TypeVar("P")


class Presenters(Generic[P]):
    """A registry of presenters of one sort, by the class of the objects that they present.

    Attributes
    ----------
    load : callable
        Function of an object that imports the module which registers its presenter, if any.
    """

    def __init__(self) -> None:
        self._by_class: dict[type, P] = {}
        self.load: Callable[[Any], object] = lambda presented: None

    def register(self, cls: type, presenter: P) -> None:
        """Register the presenter of a class and of its subclasses."""
        self._by_class[cls] = presenter

    def of(self, presented: object) -> P | None:
        """Return the presenter of an object, after loading it if need be; None if there is none."""
        presenter = self.registered(presented)
        if presenter is None:
            self.load(presented)
            presenter = self.registered(presented)
        return presenter

    def registered(self, presented: object) -> P | None:
        """Return the presenter of an object if one is registered already, without loading any."""
        classes = (cls for cls in type(presented).__mro__ if cls in self._by_class)
        cls = next(classes, None)
        return None if cls is None else self._by_class[cls]


#: Presenters of kinds of test.
KINDS = Presenters[Any]()
#: Functions that write the files of a result into a folder and return the path of its page.
PAGES = Presenters[Callable[[Any, Path], Path]]()
#: Functions that draw a result for a notebook, by the name of the drawing.
DRAWINGS = Presenters[Mapping[str, Callable[..., Any]]]()
