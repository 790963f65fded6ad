"""Bakes as glTF 2.0 binary files, for game engines, browsers and other modellers."""

from prt_core.export.glb.settings import GLBSettings
from prt_core.export.glb.writer import glb_steps

__all__ = ["GLBSettings", "glb_steps"]
