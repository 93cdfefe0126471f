"""How to cite the program and the method that it follows."""

from __future__ import annotations

from .. import __version__
from ..reports import Listing, Words
from ..reports.content import Part

BIBTEX = """@software{{bubblefit,
  title = {{bubblefit: material models of coated fabrics from bubble inflation tests and strip
           tests by inverse finite element analysis}},
  author = {{{{The bubblefit developers}}}},
  version = {{{version}}},
  license = {{MIT}}
}}
@mastersthesis{{jekel2016,
  title = {{Obtaining Non-linear Orthotropic Material Models for PVC-Coated Polyester via Inverse
           Bubble Inflation}},
  author = {{Jekel, Charles F.}},
  school = {{Stellenbosch University}},
  month = mar,
  year = {{2016}},
  url = {{https://hdl.handle.net/10019.1/98627}}
}}"""


def citation() -> list[Part]:
    """Words and BibTeX, as CITATION.cff of the program has it."""
    said = f"Please cite bubblefit {__version__} and the thesis whose method it follows:"
    return [Words([said]), Listing(BIBTEX.format(version=__version__))]
