"""What Blender itself prints, kept off the tables."""

import os
import sys
from contextlib import contextmanager


@contextmanager
def quiet():
    """Nothing that is written to the standard output arrives, by Blender's own code either."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)
