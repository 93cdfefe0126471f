"""Strips of constant moduli whose thickness or nu12 is unknown."""

from bubblefit.project.project import read_project

from .projects import constant_strips

FIT = "[fit]\nstarts = 2\nseed = 7\n"


def project(folder, unknowns, *changes):
    return read_project(constant_strips(folder, (FIT, f"{FIT}[fit.unknowns]\n{unknowns}\n"),
                                        *changes))  # fmt: skip
