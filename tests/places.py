"""Where things are, for all tests."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
KNOWN = EXAMPLES / "bubble-known-solution" / "project.toml"
#: Tables of published numbers, with their sources.
PUBLISHED = ROOT / "runs" / "verification" / "published"
#: Measured data beside the repository.
SHARED = ROOT.parent / "shared" / "data"
