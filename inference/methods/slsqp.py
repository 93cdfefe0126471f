"""Sequential quadratic programming on e itself (NLopt's SLSQP).

With the exact gradient of e, or with differences where there is none.

References
----------
D. Kraft, A software package for sequential quadratic programming, DFVLR-FB 88-28 (1988).
"""

import nlopt

from ..nlopt_search import NloptMethod

METHOD = NloptMethod(nlopt.LD_SLSQP, 500)
