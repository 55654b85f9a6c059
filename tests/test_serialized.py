"""Serialized meshes: read as a PLY of the same numbers is, and as Mitsuba reads them."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from malformed_meshes import packed, together
from test_meshes import ball, render, write_ply
from test_meshes import scene as scene_of

from raycheck.base.errors import ReferenceError_
from raycheck.scene.meshes import read_mesh

ROOT = Path(__file__).resolve().parents[1]
POINTS, FACES = ball(6)
POINTS = np.float32(POINTS).astype(float)
NORMALS = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)
UV = np.float32(POINTS[:, :2])
COLOURS = np.full_like(POINTS, 0.5)
ARRAYS = {0x1: NORMALS, 0x2: UV, 0x8: COLOURS}
BOARD = """<bsdf type="twosided"><bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
    <transform name="to_uv"><scale value="5"/></transform></texture></bsdf></bsdf>"""


def mesh(flags: int, version: int = 4, name: bytes = b"mesh\0") -> bytes:
    extra = [row for bit, rows in ARRAYS.items() if flags & bit for row in rows.tolist()]
    return packed(
        FACES.tolist(), points=POINTS.tolist(), flags=flags, version=version, extra=extra, name=name
    )


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("flags", [0x1000, 0x2000, 0x0, 0x1010, 0x1008, 0x200A, 0x1002])
def test_it_is_what_a_ply_of_the_same_numbers_is(
    oneray: Path, tmp_path: Path, flags: int, version: int
) -> None:
    """Bit for bit: in single and double precision, with and without texture coordinates and colours, which
    nobody reads; version 3 has no name. A file with the flag of face normals has none to Mitsuba 3: a warning
    says so.
    """
    write_ply(tmp_path / "mesh.ply", POINTS, FACES)
    (tmp_path / "mesh.serialized").write_bytes(mesh(flags, version))
    same = [
        render(oneray, scene_of(tmp_path / f"{kind}.xml", f"mesh.{kind}")) for kind in ("ply", "serialized")
    ]
    assert np.array_equal(*same) and same[0].any()
    done = subprocess.run(
        [oneray, tmp_path / "serialized.xml", "--check"], capture_output=True, text=True, check=True
    )
    assert ("has face normals, which Mitsuba 3 does not heed" in done.stderr) == (flags == 0x1010)


def test_a_file_has_several(oneray: Path, tmp_path: Path) -> None:
    """Each is found by its place, whatever is between them; the first also where none is written down."""
    others = (mesh(0x200B, name=b"\0"), packed())
    for version in (3, 4):
        wanted = mesh(0x1000, version)
        for index in range(3):
            meshes = [*others[:index], wanted, *others[index:]]
            data = together(*meshes, version=version)
            (tmp_path / f"mesh@{index}.serialized").write_bytes(data)
            if index and version == 3:  # all of a file are of one version
                meshes = [mesh(0x200B, 3)] * index + [wanted]
                (tmp_path / f"mesh@{index}.serialized").write_bytes(together(*meshes, version=3))
            (tmp_path / "mesh.ply").unlink(missing_ok=True)
            write_ply(tmp_path / "mesh.ply", POINTS, FACES)
            one = render(oneray, scene_of(tmp_path / "one.xml", f"mesh@{index}.serialized"))
            assert np.array_equal(one, render(oneray, scene_of(tmp_path / "ply.xml", "mesh.ply")))
            found = read_mesh(tmp_path / f"mesh@{index}.serialized", "serialized", index)
            assert np.array_equal(found.vertices, POINTS) and np.array_equal(found.faces, FACES)
    (tmp_path / "mesh.serialized").write_bytes(mesh(0x1000))
    alone = render(oneray, scene_of(tmp_path / "one.xml", "mesh.serialized"))
    assert np.array_equal(alone, render(oneray, scene_of(tmp_path / "ply.xml", "mesh.ply")))


@pytest.mark.parametrize(
    "inside",
    ["", '<boolean name="face_normals" value="true"/>', '<boolean name="flip_normals" value="true"/>'],
)
@pytest.mark.parametrize("flags", [0x1000, 0x2003, 0x100B])
def test_means_what_it_means_in_mitsuba(oneray: Path, tmp_path: Path, flags: int, inside: str) -> None:
    """With normals or texture coordinates, within the errors of both."""
    mi = pytest.importorskip("mitsuba")
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", "libLLVM.so.19.1")
    mi.set_variant("llvm_ad_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    (tmp_path / "mesh@1.serialized").write_bytes(together(packed(), mesh(flags)))
    file = scene_of(tmp_path / "scene.xml", "mesh@1.serialized", inside + (BOARD if flags & 2 else ""))
    loaded = mi.load_file(str(file))
    theirs = np.array([np.array(mi.render(loaded, spp=512, seed=seed)) for seed in range(12)], dtype=float)
    ours = np.array([render(oneray, file, "--spp", "256", "--seed", str(seed)) for seed in range(12)])
    for means in (lambda images: images.mean(axis=(1, 2)), lambda images: images):
        a, b = means(ours), means(theirs)
        error = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / 12)
        varies = error > 1e-6
        normal = (a.mean(axis=0) - b.mean(axis=0))[varies] / error[varies]
        assert np.abs(normal).max() < 7.5 and np.sqrt((normal**2).mean()) < (1.3 if normal.size > 100 else 3)


def test_raycheck_reads_them_alike(tmp_path: Path) -> None:
    for flags in (0x1000, 0x200B):
        (tmp_path / "mesh.serialized").write_bytes(mesh(flags))
        found = read_mesh(tmp_path / "mesh.serialized", "serialized")
        assert np.array_equal(found.vertices, POINTS) and np.array_equal(found.faces, FACES)
        assert (found.normals is None) == (flags == 0x1000)
    for index in range(3):
        assert (
            len(read_mesh(ROOT / "tests/meshes/three.serialized", "serialized", index).faces)
            == (12, 12, 6)[index]
        )
    with pytest.raises(ReferenceError_, match="shape_index is 3, but the file has 3 meshes"):
        read_mesh(ROOT / "tests/meshes/three.serialized", "serialized", 3)
