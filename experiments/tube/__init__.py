"""An inflated tube in tension and torsion: a kind of test.

A long closed tube, warp along it, with the same strain everywhere (`TubeModel`): torsion shears the
wall as nothing but G12 resists, so that a tube tells G12 where strips and bubbles do not.
"""

from ..measured import MeasuredKind
from .planning import candidates
from .prepared import PreparedTube
from .test import TubeSection, read


class TubeKind(MeasuredKind):
    """An inflated tube in tension and torsion."""

    name = "tube"
    title = "an inflated tube in tension and torsion"
    section = TubeSection
    folder_key = "folder"
    prepared = PreparedTube
    read = staticmethod(read)
    candidates = staticmethod(candidates)


KIND = TubeKind()
