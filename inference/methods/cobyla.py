"""Linear approximations from values of e alone (NLopt's COBYLA): slow, and needs no derivatives."""

import nlopt

from .slsqp import NloptMethod

METHOD = NloptMethod(nlopt.LN_COBYLA, 2000, first_step=0.1)
