"""Linear approximations from values of e alone (NLopt's COBYLA): slow, and needs no derivatives.

References
----------
M. J. D. Powell, A direct search optimization method that models the objective and constraint
functions by linear interpolation, in: Advances in Optimization and Numerical Analysis (1994) 51.
"""

import nlopt

from ..nlopt_search import NloptMethod

METHOD = NloptMethod(nlopt.LN_COBYLA, 2000, first_step=0.1)
