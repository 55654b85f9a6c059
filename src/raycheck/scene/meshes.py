"""The meshes that scene files name."""

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raycheck.base.arrays import Array
from raycheck.base.errors import ReferenceError_


@dataclass(frozen=True)
class Mesh:
    vertices: Array
    """(V, 3)"""
    faces: NDArray[np.int64]
    """(F, 3)"""
    normals: Array | None
    """(V, 3), where the file has them"""


def read_mesh(path: Path, kind: str, index: int = 0) -> Mesh:
    """A file of that kind, `ply` or `obj`, or the mesh of this index of a `serialized` one; ReferenceError_
    where it is none.
    """
    from trimesh import geometry
    from trimesh.exchange import obj, ply

    try:
        if kind == "serialized":
            parts = [_serialized(path.read_bytes(), index)]
        elif kind == "ply":
            with path.open("rb") as binary:
                parts = [ply.load_ply(binary)]
        else:
            with path.open(encoding="utf-8-sig") as text:
                loaded = obj.load_obj(text, group_material=False, split_objects=False)
            parts = list(loaded["geometry"].values()) if "geometry" in loaded else [loaded]
        [one] = parts
        vertices, faces, normals = (one.get(name) for name in ("vertices", "faces", "vertex_normals"))
        mesh = Mesh(
            np.asarray(vertices, dtype=np.float64).reshape(-1, 3),
            geometry.triangulate_quads(faces),
            None if normals is None else np.asarray(normals, dtype=np.float64).reshape(-1, 3),
        )
        corners = mesh.vertices[mesh.faces]
    except Exception as error:  # trimesh names no errors of its own
        raise ReferenceError_(f"{path}: not a mesh that can be read ({error})") from None
    if not len(corners) or not np.isfinite(corners).all():
        raise ReferenceError_(f"{path}: not a mesh that can be read (no faces, or a corner that is no place)")
    return mesh


def _serialized(content: bytes, index: int) -> dict[str, NDArray[np.float64] | NDArray[np.int64] | None]:
    """A mesh of Mitsuba's, of version 3 or 4: a zlib stream after four bytes, whose place stands at the
    file's end. Jakob, Mitsuba Documentation, 2014, 8.2.10.
    """
    start, version = 0, struct.unpack_from("<HH", content)[1]
    if index:
        (count,) = struct.unpack("<I", content[-4:])
        each = "Q" if version > 3 else "I"
        if index >= count:
            raise ValueError(f"shape_index is {index}, but the file has {count} meshes")
        (start,) = struct.unpack_from(
            "<" + each, content, len(content) - 4 - struct.calcsize(each) * (count - index)
        )
    magic, version = struct.unpack_from("<HH", content, start)
    if magic != 0x041C or version not in (3, 4):
        raise ValueError(f"no serialized mesh of version 3 or 4 begins at byte {start}")
    data = zlib.decompressobj().decompress(content[start + 4 :])
    (flags,) = struct.unpack_from("<I", data)
    at = data.index(0, 4) + 1 if version > 3 else 4
    vertex_count, face_count = struct.unpack_from("<QQ", data, at)
    at += 16
    number = np.dtype("<f8" if flags & 0x2000 else "<f4")
    arrays: dict[str, NDArray[np.float64] | NDArray[np.int64] | None] = {"vertex_normals": None}
    for name, there, columns in (
        ("vertices", True, 3), ("vertex_normals", flags & 1, 3), ("uv", flags & 2, 2),
        ("colours", flags & 8, 3),
    ):  # fmt: skip
        if there:
            values = np.frombuffer(data, number, columns * vertex_count, at).astype(np.float64)
            arrays[name] = values.reshape(-1, columns)
            at += columns * vertex_count * number.itemsize
    arrays["faces"] = np.frombuffer(data, "<u4", 3 * face_count, at).astype(np.int64).reshape(-1, 3)
    return arrays
