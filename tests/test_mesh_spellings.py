"""Mesh files as people's programs write them: one square in many spellings is one picture, and reading takes
time in proportion to the file."""

from __future__ import annotations

import itertools
import resource
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from test_meshes import render, scene

MARK = b"\xef\xbb\xbf"
POINTS = ["-1 0 -1", "1 0 -1", "1 0.2 1", "-1 0 1", "0 -3 0"]
"""A square and a point before it, which no face has: without the first vertex the faces would be others."""
OBJ = "".join(f"v {point}\n" for point in POINTS) + "f 1 2 3\nf 1 3 4\n"
POINTS_ONLY = OBJ.split("f ")[0]

OBJ_SPELLINGS: dict[str, str] = {
    "plain": OBJ,
    "empty-slash": POINTS_ONLY + "f 1/ 2/ 3/\nf 1// 3// 4//\n",
    "empty-and-full-slash": "vt 5 5\n" + POINTS_ONLY + "f 1/ 2/ 3\nf 1// 3/ 4\n",
    "tab-behind-slash": POINTS_ONLY + "f 1/\t2/\t3/\nf 1//\t3//\t4//\n",
    "continued": POINTS_ONLY + "f 1 \\\n2 \\\n3\nf 1 3\\\n 4\n",
    "continued-vertex": OBJ.replace("v -1 0 -1", "v \\\n -1 0\\\n-1"),
    "continued-at-end": OBJ.rstrip("\n") + " \\\n",
    "comment-ends-in-backslash": "# C:\\models\\\n" + OBJ.replace("f 1 3", "usemtl \\\nf 1 3"),
    "tabs": OBJ.replace(" ", "\t"),
    "blanks": OBJ.replace(" ", " \t ").replace("\nf", "  \n \t f"),
    "colours": OBJ.replace("v 1 0 -1", "v 1 0 -1 0.5 0.5 0.5"),
    "comments": OBJ.replace("\n", " # f 1 2 5\n"),
    "groups": "mtllib x\no x\ng x\ns off\nusemtl x\nl 1 2\np 1\n" + OBJ,
    "unused": "vt nan x\nvn 1 0 0\nvp 1\n" + OBJ,
    "long-line": "# " + "x" * 100_000 + "\n" + OBJ.replace("f 1 2 3", "f 1 2 3" + " " * 100_000),
    "negative": POINTS_ONLY + "f -5/ -4/ -3/\nf -5// -3// -2//\n",
    "polygon": POINTS_ONLY + "f 1 2 3 4\n",
}
LINE_ENDS = {"unix": b"\n", "windows": b"\r\n", "old-mac": b"\r"}


def ply(
    vertices: str = "property float x\nproperty float y\nproperty float z\n", more: str = "", behind: str = ""
) -> str:
    """The square in plain text; `more` goes into the header before the faces, `behind` after each vertex."""
    head = f"ply\nformat ascii 1.0\nelement vertex {len(POINTS)}\n{vertices}{more}"
    head += "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    return head + "".join(f"{point}{behind}\n" for point in POINTS) + "3 0 1 2\n3 0 2 3\n"


def faces_first() -> str:
    lines = ply().splitlines()
    vertex, face = lines[2:6], lines[6:8]
    return "\n".join([*lines[:2], *face, *vertex, lines[8], *lines[14:], *lines[9:14], ""])


def named(*names: str) -> str:
    return "".join(f"property float {name}\n" for name in names)


XYZ = named("x", "y", "z")
PLY_SPELLINGS: dict[str, str] = {
    "plain": ply(),
    "long-name": ply(XYZ + named("x" * 4000), behind=" 7"),
    "long-names": ply(XYZ + named("vertex_indices" * 9 + "a", "vertex_indices" * 9 + "b"), behind=" 7 8"),
    "many-properties": ply(XYZ + named(*(f"p{i}" for i in range(1000))), behind=" 0.5" * 1000),
    "many-elements": ply(more="".join(f"element e{i} 0\nproperty float a\n" for i in range(1000))),
    "long-element": ply(more=f"element {'vertex' * 20} 0\nproperty float x\n"),
    "faces-first": faces_first(),
    "tabs": ply().replace(" ", "\t"),
    "blanks": ply().replace(" ", " \t  "),
    "list-tab": ply().replace("list uchar", "list\tuchar"),
    "nan-unread": ply(XYZ + named("quality"), behind=" nan"),
    "words-unread": ply(XYZ + named("a", "b", "c"), behind=" -nan(ind) 1.#QNAN inf"),
    "nan-in-list-unread": ply(XYZ + "property list uchar float tags\n", behind=" 2 nan 1"),
    "nan-in-half-a-normal": ply(XYZ + named("nx", "ny"), behind=" nan 1"),
    "nan-texture": ply(XYZ + named("u", "v"), behind=" nan 1"),
    "fraction-unread": ply(XYZ + "property int tag\n", behind=" 0.5"),
    "comments": ply().replace("element face", "comment " + "x" * 1000 + "\nobj_info\nelement face"),
}


def agree(oneray: Path, folder: Path, name: str, data: bytes, expected: bytes, inside: str = "") -> None:
    """Both files give the same picture without a word."""
    pictures = []
    for file, content in ((f"given-{name}", data), (f"plain-{name}", expected)):
        (folder / file).write_bytes(content)
        path = scene(folder / f"{file}.xml", file, inside, size=12)
        done = subprocess.run(
            [oneray, path, "-o", folder / "out.pfm", "--spp", "2", "--quiet"],
            capture_output=True, text=True, check=False, timeout=60,
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, ""), file
        pictures.append((folder / "out.pfm").read_bytes())
    assert pictures[0] == pictures[1]
    assert len(set(pictures[1])) > 8


@pytest.mark.parametrize(("name", "end"), [*itertools.product(OBJ_SPELLINGS, LINE_ENDS)])
def test_obj(oneray: Path, tmp_path: Path, name: str, end: str) -> None:
    """With and without a byte order mark, with the lines' ends of any system."""
    data = OBJ_SPELLINGS[name].encode().replace(b"\n", LINE_ENDS[end])
    agree(oneray, tmp_path, "a.obj", data, OBJ.encode())
    agree(oneray, tmp_path, "b.obj", MARK + data.rstrip(LINE_ENDS[end]), OBJ.encode())


@pytest.mark.parametrize(("name", "end"), [*itertools.product(PLY_SPELLINGS, ["unix", "windows"])])
def test_ply(oneray: Path, tmp_path: Path, name: str, end: str) -> None:
    data = PLY_SPELLINGS[name].encode().replace(b"\n", LINE_ENDS[end])
    agree(oneray, tmp_path, "a.ply", data, ply().encode())
    agree(oneray, tmp_path, "b.ply", MARK + data, ply().encode())


def test_normals_that_nobody_reads(oneray: Path, tmp_path: Path) -> None:
    """A normal that is no number matters to a smooth mesh only, and there only where a face has it."""
    normals = ply(XYZ + named("nx", "ny", "nz"), behind=" 0 -1 0")
    unused = normals.replace("0 -3 0 0 -1 0", "0 -3 0 nan nan nan")
    agree(oneray, tmp_path, "a.ply", unused.encode(), normals.encode())
    used = normals.replace("1 0.2 1 0 -1 0", "1 0.2 1 nan 1 0").encode()
    flat = '<boolean name="face_normals" value="true"/>'
    agree(oneray, tmp_path, "b.ply", used, ply().encode(), flat)
    values = [struct.pack("<6f", *map(float, point.split()), np.nan, 0, 1) for point in POINTS]
    head = normals[: normals.index("end_header\n")].replace("ascii", "binary_little_endian") + "end_header\n"
    faces = b"".join(struct.pack("<B3i", 3, *face) for face in ((0, 1, 2), (0, 2, 3)))
    agree(oneray, tmp_path, "c.ply", head.encode() + b"".join(values) + faces, ply().encode(), flat)
    for file in ("given-b.ply", "given-c.ply"):
        path = scene(tmp_path / "smooth.xml", file)
        done = subprocess.run([oneray, path, "--stats", "-"], capture_output=True, text=True, check=False)
        vertex = 2 if "b" in file else 0
        said = f"{tmp_path / file}:1: vertex {vertex} has a normal that is no number: mend it, or "
        assert (done.returncode, done.stderr) == (2, said + "let the shape have face_normals\n")


@pytest.mark.parametrize("word", ["surf", "V", "1", "\x01v", "\N{NO-BREAK SPACE}v"])
def test_what_might_show_does_not_vanish_silently(oneray: Path, tmp_path: Path, word: str) -> None:
    """One line for a statement that is none, or that shows something elsewhere; it is no part of the last."""
    (tmp_path / "a.obj").write_text(OBJ.replace("3 4", "3 4/") + f"{word} 1 2 3\n" * 3, encoding="utf-8")
    (tmp_path / "b.obj").write_text(OBJ)
    path = scene(tmp_path / "a.xml", "a.obj")
    words = [oneray, path, "-o", tmp_path / "a.pfm", "--spp", "1"]
    done = subprocess.run(words, capture_output=True, check=True)
    shown = word if word.isascii() and word.isprintable() else ""
    said = f'{tmp_path}/a.obj:8: "{shown}" is not read (v, vt, vn and f are): such lines are left out\n'
    assert done.stderr.decode() == f"oneray: warning: {said}"
    np.testing.assert_array_equal(
        render(oneray, path, "--spp", "1"), render(oneray, scene(tmp_path / "b.xml", "b.obj"), "--spp", "1")
    )


N = 20_000


def around(n: int) -> str:
    """n points on a circle."""
    turn = 2 * np.pi / n * np.arange(n)
    return "".join(f"v {x:.9f} {y:.9f} 0\n" for x, y in zip(np.cos(turn), np.sin(turn), strict=True))


def fan(n: int, corner: Callable[[int], str], head: str = "") -> str:
    faces = "".join(f"f 1{corner(i)} {i + 1}{corner(i)} {i + 2}{corner(i)}\n" for i in range(1, n - 1))
    return head + around(n) + faces


def long_list(n: int) -> str:
    return ply(XYZ + "property list int float tags\n", behind=f" {n} " + "1 " * n)


LARGE: dict[str, Callable[[int], str]] = {
    "corners-at-a-vertex.obj": lambda n: fan(n, lambda i: f"//{i}", "vn 1 0 1\n" * n),
    "seams-at-a-vertex.obj": lambda n: fan(n, lambda i: f"/{i}", "vt 1 0\n" * n),
    "faces-at-an-edge.obj": lambda n: around(n) + "".join(f"f 1 2 {i}\n" for i in range(3, n + 1)),
    "polygon.obj": lambda n: around(n) + "f " + " ".join(str(i + 1) for i in range(n)) + "\n",
    "continued-polygon.obj": lambda n: around(n) + "f " + " \\\n".join(str(i + 1) for i in range(n)) + "\n",
    "equal-faces.obj": lambda n: OBJ + "f 1 2 3\n" * n,
    "equal-vertices.obj": lambda n: OBJ * n,
    "groups.obj": lambda n: OBJ + "".join(f"g x{i}\nusemtl y{i}\nf 1 2 3\n" for i in range(n)),
    "unread.obj": lambda n: OBJ + "surf\n" * (4 * n),
    "long-line.obj": lambda n: OBJ + "# " + "x" * 100 * n + "\nf 1 2 3" + " " * 100 * n + "\n",
    "long-number.obj": lambda n: f"v 0 0 0.{'0' * 20 * n}\n" + OBJ,
    "list.ply": long_list,
    "properties.ply": lambda n: ply(XYZ + named("u", "v") * n, behind=" 0 1" * n),
    "elements.ply": lambda n: ply(more="".join(f"element e{i} 0\nproperty int a\n" for i in range(n))),
    "long-name.ply": lambda n: ply(XYZ + named("x" * 100 * n), behind=" 1"),
}


def processor_seconds(*command: object) -> float:
    """Of a program: the others on this machine do not count."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(list(map(str, command)), check=False, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


@pytest.mark.parametrize("name", LARGE)
def test_reading_is_linear(oneray: Path, tmp_path: Path, name: str) -> None:
    """Four times the file is read in less than ten times the time; what looks at all pairs takes sixteen. The
    output has no folder, so that the program ends when it has read the scene.
    """
    seconds = []
    for n in (N, 4 * N):
        (tmp_path / name).write_text(LARGE[name](n))
        command = (oneray, scene(tmp_path / "large.xml", name, size=1), "-o", tmp_path / "none/out.exr")
        assert "none/out.exr" in subprocess.run(command, capture_output=True, text=True, check=False).stderr
        seconds.append(min(processor_seconds(*command) for _ in range(3)))
    assert seconds[1] < 10 * seconds[0] + 0.05, seconds


@pytest.mark.parametrize("name", ["corners-at-a-vertex.obj", "faces-at-an-edge.obj", "equal-faces.obj"])
def test_searches_among_triangles_are_linear(oneray: Path, tmp_path: Path, name: str) -> None:
    """What lies close to what: where all triangles do, not all pairs are looked at."""
    seconds = []
    for n in (N // 2, 2 * N):
        (tmp_path / name).write_text(LARGE[name](n))
        path = scene(tmp_path / "large.xml", name, size=1)
        seconds.append(processor_seconds(oneray, path, "--spp", 1, "-o", tmp_path / "out.exr"))
    assert seconds[1] < 10 * seconds[0], seconds
