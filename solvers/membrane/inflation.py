"""Analysis of a closed membrane: its inflation, beyond limit pressures too, and its bending.

The pressure is prescribed; beyond a limit pressure the enclosed volume is prescribed instead.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...meshes.cylinder_model import ClosedGas, InflatedModel
from ...notes import Note
from ..base import SNAP, History
from . import bending
from .closed import FROM_SLACK, ClosedMembrane, closed_membrane
from .loading import IncrementRecord, Loading, RunRequest, march, reach_in_halves, straight_on
from .membrane import initial_moduli
from .sensitivity import Neighbours

Array = NDArray[np.float64]


@dataclass(frozen=True)
class VolumeControl:
    """Settings of volume control, by which a limit pressure is passed.

    Steps are relative increases of the volume.
    """

    #: Multiple of the pressure that is added as an outer pressure, so that a constant mass of gas
    #: is so stiff that it nearly prescribes the volume.
    overpressure: float = 50.0
    step: float = 0.01  #: largest step
    smallest_step: float = 1e-4  #: below it the search fails
    step_growth: float = 1.5  #: factor of the step after one that led to an equilibrium
    max_growth: float = 2.0  #: largest volume, as a multiple of that at the start
    #: Of Newton's method: near a snap it hardly leads to an equilibrium in more iterations.
    max_iterations: int = 14


VOLUME_CONTROL = VolumeControl()


def through_snap(
    membrane: ClosedMembrane,
    neighbours: Neighbours,
    u: Array,
    previous: float,
    level: float,
    settings: VolumeControl = VOLUME_CONTROL,
) -> Array | None:
    """Return the equilibrium at a pressure beyond a limit pressure, by volume control.

    Parameters
    ----------
    membrane : ClosedMembrane
    neighbours : Neighbours
        They follow each step, as derivatives depend on the strain path.
    u : (n, 3) array, mm
        Equilibrium at the pressure `previous`.
    previous, level : float, MPa
        The pressures at the start and the end.
    settings : VolumeControl

    Returns
    -------
    (n, 3) array, mm, or None
        None if no equilibrium is found.
    """
    outer_pressure = settings.overpressure * level
    initial_volume, _ = membrane.cavity.measure(membrane.reference + u)
    volume = initial_volume
    pressure = previous
    step = settings.step
    slope = np.zeros_like(u)
    membranes = [membrane, *neighbours.membranes]
    try:
        while step >= settings.smallest_step and volume < settings.max_growth * initial_volume:
            constant = (outer_pressure + pressure) * volume * (1.0 + step)
            _fill(membranes, ClosedGas(constant, outer_pressure))
            displacement = membrane.equilibrium(u + step * slope, 0.0)
            if displacement is None:
                displacement = membrane.rest(u + step * slope, 0.0)
            if displacement is None and step < 0.5 * settings.step:
                # Snapping gathers in one bulge, and the rest of the wall slackens.
                displacement = membrane.equilibrium_from_slack(u, level)
            if displacement is None:
                step = 0.5 * step
                slope = np.zeros_like(u)
                continue
            if membrane.pressure >= level:
                _fill(membranes, None)
                return membrane.equilibrium(displacement, level)
            neighbours.follow(membrane, displacement)
            membrane.accept()
            slope = (displacement - u) / step
            u = displacement
            volume = membrane.volume
            pressure = membrane.pressure
            step = min(settings.step, settings.step_growth * step)
        return None
    finally:
        _fill(membranes, None)


def _fill(membranes: Sequence[ClosedMembrane], gas: ClosedGas | None) -> None:
    """Give membranes the same closed gas, or none."""
    for membrane in membranes:
        membrane.gas = gas


def analyse_inflated(
    membrane: ClosedMembrane, model: InflatedModel, request: RunRequest
) -> tuple[History, Array]:
    """Inflate a closed membrane from its unloaded state, and bend it if the model has a bending.

    Parameters
    ----------
    membrane : ClosedMembrane
    model : InflatedModel
    request : RunRequest
        Its guess is not used, as the way from the unloaded state decides where a membrane that
        snaps or wrinkles ends.

    Returns
    -------
    History
        Of the bending if there is one, else of the inflation.
    (frames, nodes, 3, k) array
        Derivatives of the displacements by the k parameters of the request.

    Raises
    ------
    SolverFailure
        If no equilibrium is found.
    """
    request = replace(request, guess=None)
    membrane.wrinkle[:] = 0.0
    neighbours = Neighbours(membrane, request.parameters)
    levels = np.array(model.pressures)
    if model.bending is not None and membrane.wrinkle_stiffness is not None:
        # Every third is enough, as only the last is reported and the law hardly depends on
        # increments. With a stiff wall, whose caps fold in large steps, none is left out.
        levels = levels[::-3][::-1]
    volume = np.zeros(len(levels))
    wrinkled = np.zeros(len(levels))
    sides = np.ones(len(model.mesh.quads), dtype=bool)
    leaps = model.bending is not None and not neighbours.membranes
    filling = Filling(membrane, neighbours, leaps)
    sides[model.mesh.element_sets.get("caps", np.empty(0, dtype=np.intp))] = False
    record = IncrementRecord(membrane, len(levels))
    membrane.keep_tangent = False
    slopes = np.zeros((*record.path.shape, len(request.parameters)))
    for i, u in enumerate(march(filling, levels, request)):
        neighbours.follow(membrane, u)
        slopes[i] = neighbours.slopes(u, neighbours.displacements)
        record.accept(i, u)
        volume[i] = membrane.volume
        wrinkled[i] = membrane.wrinkled_share(sides)
    remarks = filling.remarks()
    if model.bending is not None:
        released = _released(membrane, model, record.path[-1], neighbours)
        inflated = bending.InflatedState(
            record.path[-1], float(levels[-1]), record.low, record.high
        )
        history, slopes = bending.analyse(
            released,
            model,
            inflated,
            sides,
            request,
            neighbours,
        )
        return replace(history, remarks=(*remarks, *history.remarks)), slopes
    sets = model.mesh.node_sets
    reactions = {n: record.forces[:, sets[n]].sum(axis=1) for n in model.supports}
    parameter_count = len(neighbours.membranes)
    history = History(
        levels,
        record.path,
        record.low,
        record.high,
        reactions,
        cavity_pressure=levels,
        cavity_volume=model.copies * volume,
        iterations=membrane.iterations,
        path=record.path,
        wrinkled=wrinkled,
        remarks=remarks,
        relaxed=membrane.wrinkle_stiffness is not None,
        load_slope=np.zeros((len(levels), parameter_count)) if parameter_count else None,
    )
    return history, slopes


def _released(
    membrane: ClosedMembrane,
    model: InflatedModel,
    inflated: Array,
    neighbours: Neighbours,
) -> ClosedMembrane:
    """Return the inflated membrane with the supports of the bending instead of the inflation.

    Parameters
    ----------
    inflated : array
        Its displacement (n, 3) mm.
    neighbours : Neighbours
        They are given the new supports, too.
    """
    fixed = model.fixed(bent=True)
    released = closed_membrane(model, membrane.law, membrane.tolerance, fixed, membrane.wall)
    released.strain_old[:] = membrane.strain_old
    released.stress_old[:] = membrane.stress_old
    released.wrinkle[:] = membrane.wrinkle
    neighbours.continue_on(released)
    displacements = [inflated, *neighbours.displacements]
    for closed, u in zip([released, *neighbours.membranes], displacements, strict=True):
        if closed.cords is not None:
            closed.cords.begin(closed.reference + u)
    released.iterations = membrane.iterations
    return released


class Filling(Loading):
    """Loading of a closed membrane by a pressure (MPa), with neighbours that follow its steps.

    Attributes
    ----------
    leaps : bool
        Whether a limit pressure is passed in one increment instead of by volume control, as is
        enough where only the end counts and nothing is differentiated.
    snaps : list of (float, float, bool)
        For each snap, the pressures (MPa) before and after it, and whether it was passed at once.
    """

    max_halvings = 8
    #: If the volume grows by a larger share in an increment, it is repeated in smaller steps, and
    #: by volume control from where they would be less than a share of the increment.
    max_volume_growth = 0.1
    smallest_step = 0.02

    def __init__(
        self, membrane: ClosedMembrane, neighbours: Neighbours, leaps: bool = False
    ) -> None:
        self.membrane = membrane
        self.neighbours = neighbours
        self.leaps = leaps
        self.snaps: list[tuple[float, float, bool]] = []

    def remarks(self) -> tuple[Note, ...]:
        """Return a note for each snap."""
        return tuple(
            Note(
                SNAP,
                f"snaps, or nearly, between {previous * 1e3:.4g} and {level * 1e3:.4g} kPa: "
                f"passed {'in one increment' if leaps else 'by leading the volume'}",
            )
            for previous, level, leaps in self.snaps
        )

    def equilibrium(self, start: Array, level: float) -> Array | None:
        membrane = self.membrane
        return membrane.rest(start, level) if self.leaps else membrane.equilibrium(start, level)

    def first_equilibrium(self, level: float) -> Array:
        initial_moduli(self.membrane.law)
        displacement = None
        if self.leaps:
            unloaded = np.zeros_like(self.membrane.reference)
            displacement = self.membrane.rest(unloaded, level, FROM_SLACK)
        if displacement is None:
            displacement = self._from_slack(level, self.max_halvings)
        return displacement

    def extrapolate(self, levels: Sequence[float], path: Sequence[Array], level: float) -> Array:
        return straight_on(levels, path, level)

    def reach(
        self,
        lower: float,
        u: Array,
        level: float,
        start: Array,
        halvings: int,
    ) -> Array | None:
        displacement = self._directly(lower, u, level, start, halvings)
        if displacement is not None and self._grows_steadily(u, displacement, 1.0):
            return displacement
        # Newton may leap over a limit point, but the law needs the strain path across it.
        newton = self.membrane.newton
        max_iterations = VOLUME_CONTROL.max_iterations
        self.membrane.newton = replace(newton, max_iterations=max_iterations)
        try:
            lower, u = self._steadily_towards(lower, u, level)
            if lower == level:
                return u
            leap = None
            if self.leaps and displacement is not None:
                # Loads of bent cylinders differ by 3e-5 from those after leading the volume.
                leap = self.equilibrium(displacement, level)
            self.snaps.append((lower, level, leap is not None))
            if leap is not None:
                return leap
            return through_snap(self.membrane, self.neighbours, u, lower, level)
        finally:
            self.membrane.newton = newton

    def _grows_steadily(self, u: Array, displacement: Array, share: float) -> bool:
        """Return whether the volume grows little between two displacements (nodes, 3) mm.

        Parameters
        ----------
        share : float
            Of the increment that lies between them. With the root of it the growth may fall, so
            that steps which approach a leap end.
        """
        cavity = self.membrane.cavity
        reference = self.membrane.reference
        volume, _ = cavity.measure(reference + displacement)
        previous_volume, _ = cavity.measure(reference + u)
        return volume < (1.0 + self.max_volume_growth * np.sqrt(share)) * previous_volume

    def _steadily_towards(self, lower: float, u: Array, level: float) -> tuple[float, Array]:
        """Return the highest pressure up to a level to which the volume grows steadily.

        Its displacement (nodes, 3) mm follows. Steps below the level are accepted.

        Parameters
        ----------
        lower, u
            The pressure reached before, and the displacement there.
        """
        increment = level - lower
        step = 0.5 * increment
        while step >= self.smallest_step * increment:
            target = min(level, lower + step)
            displacement = self.equilibrium(u, target)
            share = (target - lower) / increment
            if displacement is None or not self._grows_steadily(u, displacement, share):
                while lower + step >= target:
                    step = 0.5 * step
                continue
            lower, u = target, displacement
            if lower == level:
                break
            self.neighbours.follow(self.membrane, u)
            self.membrane.accept()
            step = 1.5 * step
        return lower, u

    def failure_message(self, previous: float, level: float, increment: str) -> str:
        return (
            f"no equilibrium at {level * 1e3:.4g} kPa ({increment}); more increments usually help, "
            "unless the membrane has a limit pressure below this one"
        )

    def _directly(
        self,
        lower: float,
        u: Array,
        level: float,
        start: Array,
        halvings: int,
    ) -> Array | None:
        """Return the equilibrium (nodes, 3) mm at a level without leading the volume, or None.

        Parameters
        ----------
        lower, level : float
            The level reached before, and the one to reach.
        u, start : (nodes, 3) array, mm
            Displacement at `lower`, and where the search starts.
        halvings : int
            How often the step may be halved.
        """
        displacement = self.equilibrium(start, level)
        if displacement is None and halvings == self.max_halvings:
            # Folds of a cap come and go: treat it as slack before trying smaller steps.
            displacement = self.membrane.equilibrium_from_slack(u, level)
        if displacement is None:
            displacement = reach_in_halves(self, lower, u, level, halvings)
        return displacement

    def _from_slack(self, level: float, halvings: int) -> Array:
        """Return the equilibrium at the first pressure, from the slack, unloaded membrane.

        Flat facets carry no pressure until they are stretched. Lower pressures are tried first
        where the search fails; SolverFailure if none leads to an equilibrium.
        """
        none = np.zeros_like(self.membrane.reference)
        displacement = self.membrane.equilibrium_from_slack(none, level)
        if displacement is not None:
            return displacement
        if halvings > 0:
            lower = self._from_slack(0.25 * level, halvings - 1)
            displacement = self._directly(0.25 * level, lower, level, lower, halvings)
            if displacement is not None:
                return displacement
        raise SolverFailure(f"no equilibrium at the first increment, {level * 1e3:.4g} kPa")
