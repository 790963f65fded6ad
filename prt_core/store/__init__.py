"""A bake on disk: a Zarr v3 group that survives a kill and refuses what is not its own."""

from prt_core.store.compressed import (
    compressed_facts,
    read_compressed,
    remove_compressed,
    write_compressed,
)
from prt_core.store.journal import JournalMismatch, RayJournal
from prt_core.store.scenes import read_scene, write_scene
from prt_core.store.store import BakeStore

__all__ = [
    "BakeStore",
    "JournalMismatch",
    "RayJournal",
    "compressed_facts",
    "read_compressed",
    "read_scene",
    "remove_compressed",
    "write_compressed",
    "write_scene",
]
