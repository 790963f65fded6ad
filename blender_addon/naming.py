"""What bakes are called: after the file and the scene, so that no two of a folder are the same."""

import hashlib
from itertools import count
from pathlib import Path

# Letters and digits of every script, and these.
_ALLOWED = set(" -_.,+=()[]")
_MOST_BYTES = 120
# Files without a name in this session, one after the other.
_COUNT = count(2)
_untitled = ["untitled"]


def bake_name(scene, file):
    """Name of a scene's bake without the suffix.

    Parameters
    ----------
    scene : bpy.types.Scene
    file : str
        Path of the .blend file; empty where it was never saved.
    """
    stem = Path(file).stem if file else _untitled[0]
    return file_name(scene.prt.name or f"{stem}_{scene.name}")


def file_name(text):
    """A text as the name of a file.

    What not every system allows becomes `_`; then a digest is appended, so that names which only
    differ in that stay apart.
    """
    name = "".join(c if c.isalnum() or c in _ALLOWED else "_" for c in text).strip(" .")
    name = name.encode()[:_MOST_BYTES].decode(errors="ignore")
    if name and name == text:
        return name
    return f"{name}_{hashlib.blake2b(text.encode(), digest_size=3).hexdigest()}"


def another_file():
    """A file was opened or begun: if it has no name it is not the one before."""
    _untitled[0] = f"untitled {next(_COUNT)}"
