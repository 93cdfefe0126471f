"""What an analysis of any model is given: how decks are to be, and what runs them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

from ...meshes.mesh import Mesh
from .shells import ShellMesh

T = TypeVar("T")
#: Makes something of the .frd file and the number of iterations.
Reader = Callable[[Path, int], T]
#: Steps and increments that converged in a run that stopped early.
Converged = Collection[tuple[int, int]]
#: As a reader, of a run that stopped early; and why it did.
Rescue = Callable[[Path, int, Converged, str], T]


class Run(Protocol):
    """Runs a deck in a scratch folder of its own."""

    def __call__(
        self, files: Mapping[str, str], read: Reader[T], rescue: Rescue[T] | None = None
    ) -> T:
        """What `read` makes of the results, or `rescue` of those of a run that stopped early.

        Parameters
        ----------
        files : text of each input file by name.

        Raises
        ------
        SolverFailure : it did not end well.
        """


@dataclass(frozen=True)
class Setup:
    """How decks are written.

    element : "S8R" or "S4". templates : the user's own folder. shells : the mesh of shells of a
    mesh of quads, made once.
    """

    element: str
    templates: Path | None
    shells: Callable[[Mesh], ShellMesh]
