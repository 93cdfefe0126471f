"""`python tests/audit FOLDER`."""

import sys
from pathlib import Path

if not __package__:
    sys.path[0] = str(Path(__file__).resolve().parents[1])
    from audit.run import main
else:
    from .run import main

sys.exit(main())
