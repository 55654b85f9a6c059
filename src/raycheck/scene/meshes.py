"""The meshes that scene files name."""

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


def read_mesh(path: Path, kind: str) -> Mesh:
    """A file of that kind, `ply` or `obj`; ReferenceError_ where it is none."""
    from trimesh import geometry
    from trimesh.exchange import obj, ply

    try:
        if kind == "ply":
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
