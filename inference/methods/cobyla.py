"""Linear approximations from values of e alone (NLopt's COBYLA): slow, and needs no derivatives."""

import nlopt

from .slsqp import NloptMethod

FIRST_STEP = 0.1  # of each bound's width

METHOD = NloptMethod(nlopt.LN_COBYLA, 2000, FIRST_STEP)
