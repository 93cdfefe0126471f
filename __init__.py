"""bubblefit: test data in, validated material card of a coated fabric out."""

# meshio.read("job.frd") and "job.t19" work in whoever imports us. By full names: pytest imports
# this file a second time, as a module without a package.
import bubblefit.solvers.calculix.frd_format
import bubblefit.solvers.marc.t19_format  # noqa: F401

__version__ = "0.1.0"
