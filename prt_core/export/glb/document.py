"""A glTF 2.0 document and its one binary file, by the Khronos Group's specification of 2021.

A .glb is a header of twelve bytes and two chunks: the description as JSON, and all arrays. What is
the same is there once: arrays, materials and meshes that were added before are found again.
"""

import hashlib
import json
import struct

import numpy as np

from prt_core.errors import expect
from prt_core.runtime.files import written
from prt_core.version import __version__

_COMPONENTS = {"uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
# What views of the binary chunk are used as; those of data have no target.
_TARGETS = {"attribute": 34962, "index": 34963, "data": None}
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
# Lengths of a .glb are 32 bits.
_MOST_BYTES = (1 << 32) - 1


class Document:
    """What a .glb holds, put together piece by piece.

    Attributes
    ----------
    nodes : list of dict
        All in the one scene.
    extras : dict
        Of the document.
    used : set of str
        Names of extensions.
    """

    def __init__(self):
        self.nodes, self.extras, self.used = [], {}, set()
        self._pieces, self._views, self._accessors, self._arrays = [], [], [], {}
        self._lists = {"meshes": [], "materials": []}
        self._numbers, self._length = {}, 0

    def add_array(self, values, use="attribute", normalised=False, bounds=False):
        """The number of the accessor of an array.

        Parameters
        ----------
        values : (n,) or (n, k) array
            float32, or whole numbers of 8, 16 or 32 bits; k up to 4; n at least 1.
        use : {"attribute", "index", "data"}
        normalised : bool
            Whether whole numbers stand for 0 to 1, or -1 to 1.
        bounds : bool
            Whether the least and largest values are told.
        """
        values = np.ascontiguousarray(values)
        rows = values.reshape(len(values), -1)
        key = self._digest(values, rows.shape, use, normalised, bounds)
        if key in self._arrays:
            return self._arrays[key]
        view = {"buffer": 0, "byteOffset": self._length, "byteLength": values.nbytes}
        if _TARGETS[use] is not None:
            view["target"] = _TARGETS[use]
        accessor = {
            "bufferView": len(self._views),
            "componentType": _COMPONENTS[values.dtype.name],
            "count": len(rows),
            "type": _TYPES[rows.shape[1]],
        }
        if normalised:
            accessor["normalized"] = True
        if bounds:
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self._views.append(view)
        self._pieces.append(values)
        self._length += values.nbytes + -values.nbytes % 4
        self._accessors.append(accessor)
        self._arrays[key] = len(self._accessors) - 1
        return self._arrays[key]

    def add_material(self, material):
        """The number of a material (dict)."""
        self.used.update(material.get("extensions", ()))
        return self._number("materials", material)

    def add_mesh(self, mesh):
        """The number of a mesh (dict)."""
        return self._number("meshes", mesh)

    @property
    def n_meshes(self):
        """How many there are."""
        return len(self._lists["meshes"])

    def write(self, path):
        """Write the .glb, whole or not at all; returns its length in bytes.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        PRTError
            It is longer than a .glb may be, or the system refuses.
        """
        text = json.dumps(
            self._described(), ensure_ascii=False, allow_nan=False, separators=(",", ":")
        ).encode(errors="replace")
        text += b" " * (-len(text) % 4)
        binary = struct.pack("<II", self._length, _BINARY) if self._length else b""
        length = 12 + 8 + len(text) + len(binary) + self._length
        expect(
            length <= _MOST_BYTES,
            f"{path}: would have {length / 1e9:.1f} GB, a .glb has at most 4.2; write fewer "
            "attributes, or bake fewer objects",
        )
        with written(path) as part, part.open("wb") as file:
            file.write(struct.pack("<III", 0x46546C67, 2, length))
            file.write(struct.pack("<II", len(text), _JSON) + text + binary)
            for values in self._pieces:
                file.write(values.data.cast("B"))
                file.write(b"\0" * (-values.nbytes % 4))
        return length

    def _described(self):
        parts = {
            "extensionsUsed": sorted(self.used),
            "scene": 0,
            "scenes": [{"nodes": list(range(len(self.nodes)))}],
            "nodes": self.nodes,
            **self._lists,
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": self._length}] if self._length else [],
            "extras": self.extras,
        }
        asset = {"version": "2.0", "generator": f"prt_core {__version__}"}
        # Empty lists are not allowed; the number of the scene is 0.
        return {"asset": asset} | {k: v for k, v in parts.items() if v or k == "scene"}

    def _number(self, kind, item):
        key = kind, json.dumps(item, sort_keys=True)
        if key not in self._numbers:
            self._numbers[key] = len(self._lists[kind])
            self._lists[kind].append(item)
        return self._numbers[key]

    @staticmethod
    def _digest(values, *more):
        digest = hashlib.blake2b(values, digest_size=16)
        return digest.digest(), values.dtype.name, *more
