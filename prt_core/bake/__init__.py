"""The bake: its stages, what it holds, its report, and its compressed form."""

from prt_core.bake.bake import Bake
from prt_core.bake.gather import gather_terms
from prt_core.bake.load import load
from prt_core.bake.settings import BakeSettings
from prt_core.bake.steps import bake_steps

__all__ = ["Bake", "BakeSettings", "bake_steps", "gather_terms", "load"]
