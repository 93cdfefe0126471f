"""Shear stiffness of a thin round tube whose wall and booms (cords along it) carry its bending."""

import math

import numpy as np

from ..light_dataclasses import dataclass
from .mesh import Array

#: Number of points of Gauss-Legendre integration between two booms, which suffices for a full turn.
POINTS_BETWEEN_BOOMS = 24
#: A ratio of the smaller to the larger principal bending stiffness that is taken for zero.
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

        With a shear force V the axial forces in the wall and the booms change along the tube by
        V / EI times their stiffness and their distance from the elastic centroid; EI is the bending
        stiffness. Equilibrium along the tube gives the shear flow up to a constant around the
        section, which follows from the condition that the section does not twist (Bredt).

        Parameters
        ----------
        direction : float
            Direction of the force, degrees from the top.

        Returns
        -------
        angle, width, flow : (m,) arrays
            Integration points around the wall in rad from the top; the width of the wall in mm that
            each represents; the shear flow there in N/mm per N, positive along increasing angles.

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
        """Return the shear stiffness of the section in N: shear force over shear strain.

        Parameters
        ----------
        direction : float
            Direction of the force, degrees from the top.

        Returns
        -------
        float
            1 over the integral of flow^2 / (G t) around the wall, with its shear stiffness G t and
            radius r: pi r G t for a wall without booms, 27 / (4 pi) r G t for three equal booms on
            a wall without axial stiffness, and pi r G t for many booms.
        """
        _, width, flow = self.shear_flow(direction)
        return self.wall_shear / float(width @ flow**2)
