"""`python -m prt_core …` is `prt …`."""

import sys

from prt_core.cli import main

sys.exit(main())
