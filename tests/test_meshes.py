"""Meshes: the formats mean the same, no ray slips through, and trees leave nothing out."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from building import ROOT, build
from malformed_meshes import MALFORMED, shape

sys.path.insert(0, str(ROOT / "scripts"))

from benchmark_scenes import obj_box

MESHES = ROOT / "tests/meshes"
ODD = [ROOT / f"tests/odd/{name}.xml" for name in ("meshes", "few-triangles", "many-shapes", "many-hidden")]


def ball(rings: int) -> tuple[np.ndarray, np.ndarray]:
    """A closed, bumpy ball: vertices (V, 3) float32 and outward triangles (F, 3); 4·rings·(rings - 1)."""
    side = 2 * rings
    theta, phi = np.meshgrid(
        np.linspace(0, np.pi, rings + 1)[1:-1], np.arange(side) * np.pi / rings, indexing="ij"
    )
    around = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    points = np.concatenate([around.reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    points *= 1 + 0.1 * np.prod(np.sin(points * [8, 9, 7]), axis=1, keepdims=True)
    row, j = np.arange(rings - 2)[:, None] * side, np.arange(side)[None]
    k = (j + 1) % side
    a, b, c, d = row + j, row + k, row + side + j, row + side + k
    top, bottom, last = len(points) - 2 + 0 * j, len(points) - 1 + 0 * j, (rings - 2) * side
    corners = [(a, c, d), (a, d, b), (top, j, k), (bottom, last + k, last + j)]
    faces = np.concatenate([np.stack(corner, axis=-1).reshape(-1, 3) for corner in corners])
    return points.astype(np.float32), faces


def write_ply(path: Path, points: np.ndarray, faces: np.ndarray, form: str = "binary_little_endian") -> None:
    head = f"ply\nformat {form} 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property float {c}\n" for c in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_index\nend_header\n"
    if form == "ascii":
        text = "".join("{!r} {!r} {!r}\n".format(*map(float, p)) for p in points)
        path.write_text(head + text + "".join("3 {} {} {}\n".format(*f) for f in faces))
        return
    order = "<" if "little" in form else ">"
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", f"{order}i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    path.write_bytes(head.encode() + points.astype(f"{order}f4").tobytes() + rows.tobytes())


def write_obj(path: Path, points: np.ndarray, faces: np.ndarray) -> None:
    text = "".join("v {!r} {!r} {!r}\n".format(*map(float, p)) for p in points)
    path.write_text(text + "".join("f {} {} {}\n".format(*(f + 1)) for f in faces))


def scene(
    path: Path,
    mesh: str,
    inside: str = "",
    more: str = '<emitter type="constant"/>',
    camera: str = '<lookat origin="0, -3.5, 1" target="0, 0, 0" up="0, 0, 1"/>',
    size: int = 24,
    depth: int = 3,
    fov: float = 40,
) -> Path:
    """A scene file that shows one mesh."""
    path.write_text(f"""<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="{depth}"/></integrator>
<sensor type="perspective"><float name="fov" value="{fov}"/>
    <transform name="to_world">{camera}</transform>
    <film type="hdrfilm">
        <integer name="width" value="{size}"/><integer name="height" value="{size}"/><rfilter type="box"/>
    </film>
</sensor>
{shape(mesh)}{inside}</shape>
{more}
</scene>""")
    return path


def render(oneray: Path, file: Path, *options: str) -> np.ndarray:
    """The picture's mean, (height, width, 3)."""
    out = file.with_suffix(".exr")
    subprocess.run([oneray, file, "-o", out, "--quiet", *options], check=True, timeout=60)
    return oiio.ImageBuf(str(out)).get_pixels(oiio.FLOAT)[..., :3]


def statistics(oneray: Path, file: Path, *options: str) -> dict:
    """What --stats says. By way of a shell: a child of Python counts Python's memory as its own."""
    command = ["sh", "-c", '"$@"; exit $?', "sh", oneray, file, "--stats", "-", *options]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


@pytest.mark.parametrize("face_normals", ["false", "true"])
def test_formats_agree(oneray: Path, tmp_path: Path, face_normals: str) -> None:
    """The same mesh in each format gives the same picture, bit for bit."""
    points, faces = ball(7)
    inside = f'<boolean name="face_normals" value="{face_normals}"/>'
    for form in ("ascii", "binary_little_endian", "binary_big_endian"):
        write_ply(tmp_path / f"{form}.ply", points, faces, form)
    write_obj(tmp_path / "text.obj", points, faces)
    pictures = [
        render(oneray, scene(tmp_path / f"{name}.xml", name, inside), "--spp", "4")
        for name in ("ascii.ply", "binary_little_endian.ply", "binary_big_endian.ply", "text.obj")
    ]
    assert pictures[0].std() > 0
    for picture in pictures[1:]:
        np.testing.assert_array_equal(picture, pictures[0])


def test_forms_of_faces_agree(oneray: Path, tmp_path: Path) -> None:
    """v, v/vt, v//vn and v/vt/vn, negative indices, and a polygon as the fan around its first corner."""
    head = "v -1 0 -1\nv 1 0 -1\nv 1 0.2 1\nv -1 0 1\nvt 0 0\nvn 0 -1 0\n"
    forms = {
        "plain": "f 1 2 3\nf 1 3 4\n",
        "texture": "f 1/1 2/1 3/1\nf 1/1 3/1 4/1\n",
        "negative": "f -4 -3 -2\nf -4 -2 -1\n",
        "fan": "f 1 2 3 4\n",
        "comments": "# x\n\nusemtl y\nf 1 2\t3 # z\r\n  f 1 3 4\r\n",
    }
    with_normals = {
        "normal": "f 1//1 2//1 3//1\nf 1//1 3//1 4//1\n",
        "all": "f 1/1/1 2/1/1 3/1/1 4/1/1\n",
        "negative-normal": "f -4//-1 -3//-1 -2//-1 -1/-1/-1\n",
    }
    for group in (forms, with_normals):
        pictures = []
        for name, text in group.items():
            (tmp_path / f"{name}.obj").write_text(head + text)
            pictures.append(render(oneray, scene(tmp_path / f"{name}.xml", f"{name}.obj"), "--spp", "2"))
        assert pictures[0].max() > 0
        for picture in pictures[1:]:
            np.testing.assert_array_equal(picture, pictures[0])


def test_other_properties_are_skipped(oneray: Path, tmp_path: Path) -> None:
    """Vertex colours, lists, other elements and any integer types, by their declared sizes."""
    points, faces = ball(3)
    write_ply(tmp_path / "plain.ply", points, faces)
    head = f"ply\nformat binary_big_endian 1.0\nobj_info x\nelement vertex {len(points)}\n"
    head += "property uchar red\n"
    head += "property double y\nproperty list ushort short tags\nproperty float x\nproperty float z\n"
    head += "element edge 2\nproperty int a\nproperty list uint double b\n"
    head += f"element face {len(faces)}\nproperty char flag\n"
    head += "property list int ushort vertex_indices\nend_header\n"
    body = b"".join(struct.pack(">BdHhhff", 9, p[1], 2, -1, 5, p[0], p[2]) for p in points)
    body += struct.pack(">iIddiI", 1, 2, 0.5, 0.25, 2, 0)
    body += b"".join(struct.pack(">biHHH", -1, 3, *f) for f in faces)
    (tmp_path / "rich.ply").write_bytes(head.encode() + body)
    plain = render(oneray, scene(tmp_path / "a.xml", "plain.ply"), "--spp", "2")
    np.testing.assert_array_equal(render(oneray, scene(tmp_path / "b.xml", "rich.ply"), "--spp", "2"), plain)


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("rings", [3, 40])
def test_no_ray_slips_out(oneray: Path, tmp_path: Path, rings: int, precision: str) -> None:
    """From within a black closed mesh no light of the surroundings is seen, wherever one looks."""
    write_ply(tmp_path / "mesh.ply", *ball(rings))
    black = '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>'
    for turn in ("", '<rotate x="1" angle="90"/>', '<rotate y="1" angle="180"/><translate x="0.1" y="0.2"/>'):
        file = scene(tmp_path / "in.xml", "mesh.ply", black, camera=turn, fov=120, size=256)
        assert not render(oneray, file, "--spp", "16", "--precision", precision).any()


@pytest.mark.parametrize("precision", ["double", "single"])
def test_edges_and_corners_that_are_aimed_at(oneray: Path, tmp_path: Path, precision: str) -> None:
    """A wall of triangles whose corners lie on the lines between pixels and on their centers: rays along the
    axis, and in the film's planes, meet edge after edge. Seen from both sides it hides what is behind."""
    n = 33
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
    points = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    i = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)[None]).reshape(-1)
    faces = np.concatenate([np.stack([i, i + 1, i + n + 1], -1), np.stack([i, i + n + 1, i + n], -1)])
    write_ply(tmp_path / "wall.ply", points, faces)
    black = '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>'
    for z in (-0.25, 0.5):
        camera = f'<lookat origin="0, 0, {z}" target="0, 0, 0" up="0, 1, 0"/>'
        file = scene(tmp_path / "wall.xml", "wall.ply", black, camera=camera, fov=90, size=128)
        assert not render(oneray, file, "--spp", "64", "--precision", precision).any()


@pytest.fixture(scope="module")
def every_box(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A build that looks into every box, at few triangles too, and at every other shape without a tree."""
    target = tmp_path_factory.mktemp("boxes")
    everything = "-O2 -DEVERY_BOX -DLOOP_MOST=1000000 -DFEW_MOST=0"
    return build(target, CFLAGS=everything, KERNELS="generic", LANES="native")


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("file", ODD, ids=lambda path: path.stem)
def test_trees_leave_nothing_out(
    oneray: Path, every_box: Path, tmp_path: Path, file: Path, precision: str
) -> None:
    """The same film with and without trees."""
    films = [tmp_path / "tree", tmp_path / "loop"]
    for program, film in zip((oneray, every_box), films, strict=True):
        command = [program, file, "--samples", "0:40", "--film", film, "--precision", precision]
        subprocess.run(command, check=True, timeout=60)
    assert films[0].read_bytes() == films[1].read_bytes()


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("estimator", ["mis", "light"])
def test_few_triangles_are_met_as_in_a_tree(
    oneray: Path, every_box: Path, tmp_path: Path, precision: str, estimator: str
) -> None:
    """The same film where all lanes look at all triangles at once, with corners and edges shared, faces in
    one place and vertex normals.
    """
    films = [tmp_path / "few", tmp_path / "tree"]
    file = obj_box(tmp_path, 48)
    for program, film in zip((oneray, every_box), films, strict=True):
        command = [program, file, "--samples", "0:40", "--film", film, "--precision", precision]
        subprocess.run([*command, "--estimator", estimator, "--quiet"], check=True, timeout=60)
    assert films[0].read_bytes() == films[1].read_bytes()


def test_estimators_agree_on_mesh_lights(oneray: Path, tmp_path: Path) -> None:
    """Walk, next event estimation, MIS and light tracing have one mean, with interpolated normals too; the
    tolerance is 5 standard errors, of the means of the pictures."""
    means, errors = [], []
    for estimator in ("walk", "nee", "mis", "light"):
        out = tmp_path / "out.exr"
        command = [oneray, ODD[0], "-o", out, "--spp", "2000", "--estimator", estimator, "--quiet"]
        subprocess.run(command, check=True, timeout=120)
        pixels = oiio.ImageBuf(str(out)).get_pixels(oiio.FLOAT).astype(float)
        means.append(pixels[..., :3].mean())
        errors.append(np.sqrt((pixels[..., 3:6] ** 2).sum() * 3) / pixels[..., :3].size)
    for mean, error in zip(means[:3], errors[:3], strict=True):
        assert abs(mean - means[3]) < 5 * np.hypot(error, errors[3]), (means, errors)


def test_flat_triangles_are_left_out(oneray: Path, tmp_path: Path) -> None:
    points, faces = ball(3)
    write_ply(tmp_path / "plain.ply", points, faces)
    flat = np.concatenate([[[0, 0, 1], [2, 2, 2]], faces])
    write_ply(tmp_path / "flat.ply", points, flat)
    file = scene(tmp_path / "flat.xml", "flat.ply")
    command = [oneray, file, "-o", tmp_path / "flat.exr", "--spp", "2"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    said = f"oneray: warning: {tmp_path}/flat.ply: 2 of {len(flat)} triangles have no area and are left out\n"
    assert done.stderr == said
    plain = render(oneray, scene(tmp_path / "plain.xml", "plain.ply"), "--spp", "2")
    flat_picture = oiio.ImageBuf(str(tmp_path / "flat.exr")).get_pixels(oiio.FLOAT)
    np.testing.assert_array_equal(flat_picture[..., :3], plain)


def test_hash_covers_the_mesh(oneray: Path, tmp_path: Path) -> None:
    """Films of a scene whose mesh has changed in between are of different pictures."""
    points, faces = ball(3)
    file = scene(tmp_path / "scene.xml", "mesh.ply")
    for number, scale in enumerate((1, 1.5)):
        write_ply(tmp_path / "mesh.ply", points * scale, faces)
        part = ["--samples", f"{4 * number}:4", "--film", tmp_path / f"{number}.film"]
        subprocess.run([oneray, file, *part], check=True)
    merge = [oneray, "merge", tmp_path / "0.film", tmp_path / "1.film", "-o", tmp_path / "out.exr"]
    done = subprocess.run(merge, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "is a film of something else" in done.stderr


def test_a_mesh_is_no_output(oneray: Path, tmp_path: Path) -> None:
    write_ply(tmp_path / "mesh.ply", *ball(3))
    before = (tmp_path / "mesh.ply").read_bytes()
    file = scene(tmp_path / "scene.xml", "mesh.ply")
    done = subprocess.run([oneray, file, "--film", tmp_path / "mesh.ply"], capture_output=True, check=False)
    assert done.returncode == 2
    assert (tmp_path / "mesh.ply").read_bytes() == before


def test_there_are_enough_malformed_meshes() -> None:
    assert len(MALFORMED) >= 40


@pytest.mark.parametrize("name", MALFORMED)
def test_malformed(oneray: Path, tmp_path: Path, name: str) -> None:
    data, message = MALFORMED[name]
    (tmp_path / name).write_bytes(data)
    file = scene(tmp_path / "scene.xml", name)
    done = subprocess.run([oneray, file, "-o", tmp_path / "out.exr"], capture_output=True, check=False)
    assert done.stderr.decode() == f"{tmp_path / name}:{message}\n"
    assert done.returncode == 2
    assert not (tmp_path / "out.exr").exists()


@pytest.mark.parametrize("precision", ["double", "single"])
def test_memory_of_many_triangles(oneray: Path, tmp_path: Path, precision: str) -> None:
    """At most 200 bytes a triangle at the peak; scripts/million_triangles.py measures a million."""
    peaks, counts = [], []
    for rings in (3, 180):
        points, faces = ball(rings)
        counts.append(len(faces))
        write_ply(tmp_path / "mesh.ply", points, faces)
        file = scene(tmp_path / "scene.xml", "mesh.ply")
        stats = statistics(oneray, file, "--spp", "1", "--precision", precision)
        peaks.append(stats["peak_memory_bytes"])
    assert (peaks[1] - peaks[0]) / (counts[1] - counts[0]) <= 200


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("none.ply", "No such file or directory"),
        ("d.obj", "Is a directory"),
        ("empty.ply", "the file is empty"),
        ("empty.obj", "the file is empty"),
        ("empty.serialized", "the file is empty"),
    ],
)
def test_missing_file(oneray: Path, tmp_path: Path, name: str, what: str) -> None:
    """The message names the line of the scene that asks for the file."""
    (tmp_path / "d.obj").mkdir()
    if name.startswith("empty"):
        (tmp_path / name).touch()
    file = scene(tmp_path / "scene.xml", name)
    done = subprocess.run([oneray, file, "-o", tmp_path / "out.exr"], capture_output=True, check=False)
    assert done.stderr.decode() == f"{file}:9: {tmp_path / name}: {what}\n"
    assert done.returncode == 2
