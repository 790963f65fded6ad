"""Shrink some of Blender's own images of light (Poly Haven, CC0) to those that web pages offer.

python scripts/web_lights.py
"""

from pathlib import Path

import numpy as np

import prt_core
from prt_core.blender_access import studio_lights
from prt_core.export.web.sources import rgbe, shrunk

_NAMES = "courtyard", "city", "sunset", "studio"
_TARGET = Path(prt_core.__file__).parent / "export" / "web" / "page" / "lights.npz"


def main():
    lights = studio_lights()
    images = {name: rgbe(shrunk(lights[name]).pixels) for name in _NAMES}
    np.savez_compressed(_TARGET, **images)
    print(f"{_TARGET}: {_TARGET.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
