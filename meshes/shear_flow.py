"""Shear of a thin round tube whose wall and booms (cords along it) carry its bending."""

import math
from dataclasses import dataclass

import numpy as np

from .mesh import Array

#: Points of Gauss-Legendre integration between two booms: exact to rounding up to a full turn.
POINTS_BETWEEN_BOOMS = 24
#: Bending stiffness about an axis, over that about the other, that is rounding.
NEGLIGIBLE_BENDING = 1e-13


@dataclass(frozen=True, eq=False)
class ThinTube:
    """A closed thin round section: a wall with booms on it.

    Parameters
    ----------
    radius : float
        Radius of the wall's middle, mm.
    wall_axial, wall_shear : float
        Stiffness of the wall along the tube and in shear, N/mm of width (E t and G t).
    boom_angles : (n,) array
        Places of the booms, degrees from the top.
    boom_stiffness : (n,) array
        Axial stiffness EA of each boom, N.
    """

    radius: float
    wall_axial: float
    wall_shear: float
    boom_angles: Array
    boom_stiffness: Array

    def shear_flow(self, direction: float = 0.0) -> tuple[Array, Array, Array]:
        """Return the shear flow of a unit force through the shear centre.

        Axial forces change along the tube by V / EI times the distance from the elastic centroid,
        in the wall and in every boom. Balance along the tube gives the flow but for a constant
        around the section, which is that of a section that does not twist (Bredt).

        Parameters
        ----------
        direction : float
            Direction of the force, degrees from the top.

        Returns
        -------
        angle, width, flow : (m,) arrays
            Points of integration around the wall in rad from the top, the width that each stands
            for in mm, and the flow there in 1/mm (N/mm per N), counted with the angle.

        References
        ----------
        T. H. G. Megson, *Aircraft Structures for Engineering Students*, chapters on the shear of
        closed sections and on structural idealisation.
        """
        booms = np.radians(self.boom_angles) % (2 * math.pi)
        places = self.radius * np.column_stack([np.cos(booms), np.sin(booms)])
        wall_stiffness = 2 * math.pi * self.radius * self.wall_axial
        axial = wall_stiffness + self.boom_stiffness.sum()
        centroid = self.boom_stiffness @ places / axial
        bending = 0.5 * wall_stiffness * self.radius**2 * np.eye(2)
        bending += (self.boom_stiffness * places.T) @ places - axial * np.outer(centroid, centroid)
        turn = math.radians(direction)
        # Two booms alone bear no bending about the line through them, and need not.
        flexibility = np.linalg.pinv(bending, rcond=NEGLIGIBLE_BENDING, hermitian=True)
        curvature = flexibility @ [math.cos(turn), math.sin(turn)]

        knots = np.unique(np.concatenate([booms, [0.0, 2 * math.pi]]))
        point, weight = np.polynomial.legendre.leggauss(POINTS_BETWEEN_BOOMS)
        half = 0.5 * np.diff(knots)[:, None]
        angle = (knots[:-1, None] + half * (1 + point)).ravel()
        width = self.radius * (half * weight).ravel()
        # Integral of the position from the top, and the booms that lie between.
        along = self.radius**2 * np.column_stack([np.sin(angle), 1 - np.cos(angle)])
        along -= self.radius * angle[:, None] * centroid
        passed = booms <= angle[:, None]
        carried = self.wall_axial * along + passed @ (
            self.boom_stiffness[:, None] * (places - centroid)
        )
        flow = -(carried @ curvature)
        return angle, width, flow - width @ flow / width.sum()

    def shear_stiffness(self, direction: float = 0.0) -> float:
        """Return the shear force over the shear strain of the section, N.

        Parameters
        ----------
        direction : float
            Direction of the force, degrees from the top.

        Returns
        -------
        float
            1 over the integral of flow^2 / G t: pi r G t of a wall alone, 27 / (4 pi) r G t of
            three equal booms on a wall without axial stiffness, and pi r G t of many.
        """
        _, width, flow = self.shear_flow(direction)
        return self.wall_shear / float(width @ flow**2)
