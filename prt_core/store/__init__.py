"""A bake on disk: a Zarr v3 group that survives a kill and refuses what is not its own."""

from prt_core.store.journal import JournalMismatch, RayJournal
from prt_core.store.scenes import read_scene, write_scene
from prt_core.store.store import BakeStore

__all__ = ["BakeStore", "JournalMismatch", "RayJournal", "read_scene", "write_scene"]
