"""What a terminal is shown while a command works."""

import json
import os
import sys
import time
from contextlib import contextmanager


class Bar:
    """Shows `Progress` as one bar a stage, on stderr."""

    def __init__(self, silent):
        self._silent = silent or not sys.stderr.isatty()
        self._stage, self._bar = None, None

    def __call__(self, progress):
        # A total of 0: a call that cannot be cut is at work.
        if self._silent or not progress.total:
            return
        from tqdm import tqdm

        if progress.stage != self._stage or progress.done < self._bar.n:
            self.close()
            self._stage = progress.stage
            self._bar = tqdm(total=progress.total, desc=progress.stage, unit=" points")
        self._bar.update(progress.done - self._bar.n)

    def close(self):
        """End the line."""
        if self._bar is not None:
            self._bar.close()


class Hushed:
    """Blender writes its own lines to stdout; keep them off it while `--json` is asked for."""

    def __enter__(self):
        sys.stdout.flush()
        self._kept = os.dup(1)
        os.dup2(2, 1)

    def __exit__(self, *_):
        sys.stdout.flush()
        os.dup2(self._kept, 1)
        os.close(self._kept)


@contextmanager
def working(silent):
    """A bar for `Progress`, and a stdout that is the command's own."""
    bar = Bar(silent)
    with Hushed():
        try:
            yield bar
        finally:
            bar.close()


def show_bench(options, rows, print_rows, page, images):
    """What a bench found: one JSON list, or its table, where the report is, and what is to be
    said about the images of light."""
    if options.json:
        print(json.dumps(rows))
    else:
        print_rows(rows)
        print(f"{page}: written {time.strftime('%H:%M')}")
        for note in (note for image in images.values() for note in image.notes):
            print(f"  note    {note}")
    return 0
