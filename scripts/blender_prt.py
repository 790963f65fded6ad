"""The command line inside a running Blender, on the scene that is open:

blender -b scene.blend --python-exit-code 1 -P scripts/blender_prt.py -- bake -o scene.prt
blender -b scene.blend --python-exit-code 1 -P scripts/blender_prt.py -- relight scene.prt …

Blender's own Python has numpy but not the other packages; they come from the project's `.venv`
(or PRT_PACKAGES, a site-packages folder) when its Python is of the same version.
"""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def _packages():
    """Site-packages folders that fit this Python."""
    if os.environ.get("PRT_PACKAGES"):
        return [Path(os.environ["PRT_PACKAGES"])]
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    return [ROOT / ".venv" / "lib" / version / "site-packages"]


def main():
    sys.path.insert(0, str(ROOT))
    # After Blender's own packages: its numpy must win.
    sys.path.extend(str(folder) for folder in _packages() if folder.is_dir())
    try:
        from prt_core.cli import main as prt
    except ImportError as error:
        print(
            f"prt: {error}; run 'make setup' with Python {sys.version_info.major}."
            f"{sys.version_info.minor}, or set PRT_PACKAGES to a folder that has the packages",
            file=sys.stderr,
        )
        return 2
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    return prt(arguments, in_blender=True)


code = main()
if code:
    # An exception is what makes Blender's --python-exit-code count.
    sys.stderr.flush()
    raise SystemExit(code)
