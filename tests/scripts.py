"""Scripts of the repository that are in no package, as modules: benchmarks, .ci, docs."""

import importlib.util
import sys

from .places import ROOT


def script(place):
    path = ROOT / place
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Where a dataclass looks for its names, and pickle for its functions.
    sys.modules[spec.name] = module
    # As where it is run: modules beside it are found.
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module
