"""A small reader of .glb files that holds them against the specification, for tests."""

import json
import struct
from pathlib import Path

import numpy as np

_TYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32,
          5126: np.float32}  # fmt: skip
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
# glTF's axes of Blender's (x, z, -y), and back.
TO_BLENDER = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


class Glb:
    """A .glb that was read and checked.

    Attributes
    ----------
    json : dict
    nodes : dict of str -> dict
        By name.

    Files of others need no `check`.
    """

    def __init__(self, path, check=True):
        data = Path(path).read_bytes()
        magic, version, length = struct.unpack_from("<III", data)
        assert (magic, version, length) == (0x46546C67, 2, len(data))
        size, kind = struct.unpack_from("<II", data, 12)
        assert kind == 0x4E4F534A and size % 4 == 0
        self.json = json.loads(data[20 : 20 + size])
        self.binary = b""
        if 20 + size < length:
            binary, kind = struct.unpack_from("<II", data, 20 + size)
            assert kind == 0x004E4942 and 28 + size + binary == length and binary % 4 == 0
            self.binary = data[28 + size :]
        self.nodes = {node["name"]: node for node in self.json["nodes"]}
        if check:
            self._check()

    def array(self, number):
        """(n,) or (n, k) array of an accessor; normalised whole numbers as float64."""
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        kind, width = np.dtype(_TYPES[accessor["componentType"]]), _WIDTHS[accessor["type"]]
        start = view["byteOffset"] + accessor.get("byteOffset", 0)
        assert start % kind.itemsize == 0
        count = accessor["count"] * width
        assert accessor["count"] >= 1 and count * kind.itemsize <= view["byteLength"]
        values = np.frombuffer(self.binary, kind, count, start)
        values = values.reshape(-1, width) if width > 1 else values
        if accessor.get("normalized"):
            values = values / np.iinfo(kind).max
        if kind.kind == "f":
            assert np.isfinite(values).all()
        return values

    def primitives(self, name):
        """Of the node of that name: (attributes by name as arrays, triangles, material) each."""
        for primitive in self.json["meshes"][self.nodes[name]["mesh"]]["primitives"]:
            attributes = {k: self.array(v) for k, v in primitive["attributes"].items()}
            triangles = self.array(primitive["indices"]).reshape(-1, 3)
            yield attributes, triangles, self.json["materials"][primitive["material"]]

    def matrix(self, name):
        """(4, 4) of the node of that name, in glTF's axes."""
        node, result = self.nodes[name], np.eye(4)
        x, y, z, w = node.get("rotation", (0, 0, 0, 1))
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        result[:3, :3] = turn * node.get("scale", (1, 1, 1))
        result[:3, 3] = node.get("translation", (0, 0, 0))
        return result

    def corners(self, name):
        """What the triangles of a node show, in Blender's world: (n, 3, 3) places, (n, 3, 3)
        normals and (n, 3, 3) radiance, and the uv of corners or None."""
        matrix, parts = self.matrix(name), []
        mirrored = np.linalg.det(matrix[:3, :3]) < 0
        for attributes, triangles, _ in self.primitives(name):
            triangles = triangles[:, ::-1] if mirrored else triangles
            place = attributes["POSITION"] @ matrix[:3, :3].T + matrix[:3, 3]
            normal = attributes["NORMAL"] @ np.linalg.inv(matrix[:3, :3])
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            uv = attributes.get("TEXCOORD_0")
            parts.append(
                (
                    (place @ TO_BLENDER.T)[triangles],
                    (normal @ TO_BLENDER.T)[triangles],
                    attributes["_PRT_RADIANCE"][triangles],
                    None if uv is None else uv[triangles],
                )
            )
        columns = zip(*parts, strict=True)
        return [None if part[0] is None else np.concatenate(part) for part in columns]

    def _check(self):
        described = self.json
        assert described["asset"]["version"] == "2.0"
        assert all(described[k] for k in described if isinstance(described[k], list))
        length = described["buffers"][0]["byteLength"]
        assert length <= len(self.binary) < length + 4
        for view in described["bufferViews"]:
            assert view["byteOffset"] + view["byteLength"] <= length
        assert sorted(described["scenes"][0]["nodes"]) == list(range(len(described["nodes"])))
        used = set()
        for mesh in described["meshes"]:
            for primitive in mesh["primitives"]:
                self._check_primitive(primitive)
        for material in described["materials"]:
            used.update(material.get("extensions", ()))
            assert 0 <= min(material["pbrMetallicRoughness"]["baseColorFactor"])
            assert max(material["pbrMetallicRoughness"]["baseColorFactor"]) <= 1
        assert used == set(described.get("extensionsUsed", ()))
        for node in described["nodes"]:
            assert abs(np.linalg.norm(node.get("rotation", (0, 0, 0, 1))) - 1) < 1e-9

    def _check_primitive(self, primitive):
        accessors, views = self.json["accessors"], self.json["bufferViews"]
        arrays = {name: self.array(number) for name, number in primitive["attributes"].items()}
        count = len(arrays["POSITION"])
        for name, number in primitive["attributes"].items():
            assert name in {"POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0"} or name[0] == "_"
            assert len(arrays[name]) == count
            view = views[accessors[number]["bufferView"]]
            assert view["target"] == 34962 and view["byteLength"] / count % 4 == 0
        place = accessors[primitive["attributes"]["POSITION"]]
        assert place["min"] == arrays["POSITION"].min(axis=0).tolist()
        assert place["max"] == arrays["POSITION"].max(axis=0).tolist()
        assert np.abs(np.linalg.norm(arrays["NORMAL"], axis=1) - 1).max() < 5e-4
        assert 0 <= arrays["COLOR_0"].min() and arrays["COLOR_0"].max() <= 1
        indices = self.array(primitive["indices"])
        assert views[accessors[primitive["indices"]]["bufferView"]]["target"] == 34963
        assert len(indices) % 3 == 0 and indices.max() < count
        assert indices.max() < np.iinfo(indices.dtype).max
        assert len(np.unique(indices)) == count, "vertices that no triangle has"
