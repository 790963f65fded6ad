"""A bake on disk: a Zarr v3 group that survives a kill and refuses what is not its own."""

from prt_core.store.attributes import damage_as_error
from prt_core.store.begin import begin_bake, finish_bake
from prt_core.store.compressed import (
    AGAIN,
    compressed_attributes,
    read_compressed,
    remove_compressed,
    write_compressed,
)
from prt_core.store.journal import JournalMismatch, RayJournal
from prt_core.store.object_files import files_at
from prt_core.store.places import (
    expect_store_output,
    is_removable,
    is_taken,
    remove_bake,
    remove_begun,
)
from prt_core.store.scenes import (
    check_scene,
    read_backs,
    read_details,
    read_scene,
    write_scene,
)
from prt_core.store.store import GLOSS_FORM, BakeStore

__all__ = [
    "AGAIN",
    "GLOSS_FORM",
    "BakeStore",
    "JournalMismatch",
    "RayJournal",
    "begin_bake",
    "check_scene",
    "compressed_attributes",
    "damage_as_error",
    "expect_store_output",
    "files_at",
    "finish_bake",
    "is_removable",
    "is_taken",
    "read_backs",
    "read_compressed",
    "read_details",
    "read_scene",
    "remove_bake",
    "remove_begun",
    "remove_compressed",
    "write_compressed",
    "write_scene",
]
