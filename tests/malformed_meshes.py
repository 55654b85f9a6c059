"""Mesh files with one fault each, and the message that each must get after "FILE:"."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

VERTICES = ["property float x", "property float y", "property float z"]
FACES = ["property list uchar int vertex_indices"]
SQUARE = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]


def ply(
    *body: str,
    form: str = "ascii 1.0",
    vertices: object = 4,
    faces: object = 2,
    of_vertices: list[str] | None = None,
    of_faces: list[str] | None = None,
) -> bytes:
    """A PLY file: header lines 1 to 8 as long as nothing else is given, then the body."""
    header = ["ply", f"format {form}", f"element vertex {vertices}", *(of_vertices or VERTICES)]
    header += [f"element face {faces}", *(of_faces or FACES), "end_header"]
    return "".join(line + "\n" for line in [*header, *body]).encode()


def binary(points: list[float], corners: list[int], **header: object) -> bytes:
    """A little-endian PLY file with one face."""
    head = ply(form="binary_little_endian 1.0", faces=1, **header)  # type: ignore[arg-type]
    numbers = struct.pack(f"<{len(points)}f", *points)
    return head + numbers + struct.pack(f"<B{len(corners)}i", len(corners), *corners)


def shape(name: str) -> str:
    """What a scene says of a mesh file; "mesh@2.serialized" is the third mesh of its file."""
    kind, index = name.rpartition(".")[2], name.partition("@")[2].partition(".")[0]
    which = f'<integer name="shape_index" value="{index}"/>' if index else ""
    return f'<shape type="{kind}"><string name="filename" value="{name}"/>{which}'


CORNERS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]


def packed(
    faces: Sequence[Sequence[int]] = ((0, 1, 2),),
    *,
    points: Sequence[Sequence[float]] = CORNERS,
    flags: int = 0x1000,
    counts: tuple[int, int] | None = None,
    version: int = 4,
    extra: Sequence[Sequence[float]] = (),
    head: int = 0x041C,
    name: bytes = b"mesh\0",
) -> bytes:
    """A serialized mesh: its numbers after the points are `extra`, one array after the other."""
    number = "d" if flags & 0x2000 else "f"
    data = struct.pack("<I", flags) + (name if version > 3 else b"")
    data += struct.pack("<QQ", *(counts or (len(points), len(faces))))
    for row in (*points, *extra):
        data += struct.pack(f"<{len(row)}{number}", *row)
    for face in faces:
        data += struct.pack(f"<{len(face)}I", *face)
    return struct.pack("<HH", head, version) + zlib.compress(data)


def together(*meshes: bytes, version: int = 4, count: int | None = None) -> bytes:
    """A file of serialized meshes, with their places at its end."""
    places = [sum(map(len, meshes[:i])) for i in range(len(meshes))]
    end = struct.pack(f"<{len(meshes)}{'Q' if version > 3 else 'I'}", *places)
    return b"".join(meshes) + end + struct.pack("<I", len(meshes) if count is None else count)


TRIANGLE = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0]
OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
CORNER = "a corner of the face is no v, v/vt, v//vn or v/vt/vn"
NUMBER = "a number up to 3.40282e+38 is wanted"

PACKED = packed()
UNSUPPORTED = "of serialized meshes is not supported (3, 4): a PLY of the mesh is"
NOWHERE = "but no serialized mesh of Mitsuba does"
LARGE = 2**28 + 1

SERIALIZED: dict[str, tuple[bytes, str]] = {
    "three-bytes.serialized": (PACKED[:3], f"1: mesh 0 should begin at byte 0, {NOWHERE}"),
    "ply.serialized": (ply(*SQUARE), f"1: mesh 0 should begin at byte 0, {NOWHERE}"),
    "big-endian.serialized": (b"\x04\x1c" + PACKED[2:], f"1: mesh 0 should begin at byte 0, {NOWHERE}"),
    "version-2.serialized": (packed(version=2), f"1: version 2 {UNSUPPORTED}"),
    "version-5.serialized": (packed(version=5), f"1: version 5 {UNSUPPORTED}"),
    "nothing-behind.serialized": (PACKED[:4], "1: the file ends before the mesh's first numbers do"),
    "no-zlib.serialized": (
        PACKED[:4] + b"no zlib stream",
        "1: the mesh is no zlib stream from its first numbers on: incorrect header check",
    ),
    "bad-block.serialized": (
        PACKED[:6] + b"\xff" * 30,
        "1: the mesh is no zlib stream from its first numbers on: invalid block type",
    ),
    "no-checksum.serialized": (
        PACKED[:-1] + bytes([PACKED[-1] ^ 1]),
        "1: the mesh is no zlib stream from its first numbers on: incorrect data check",
    ),
    "name-without-end.serialized": (
        PACKED[:4] + zlib.compress(struct.pack("<I", 0x1000) + b"name"),
        "1: the zlib stream ends before the mesh's first numbers do",
    ),
    "counts-missing.serialized": (
        PACKED[:4] + zlib.compress(struct.pack("<I", 0x1000) + b"\0" + bytes(12)),
        "1: the zlib stream ends before the mesh's triangles do",
    ),
    "many-vertices.serialized": (
        packed(counts=(LARGE, 1)),
        f"1: {LARGE} vertices are said to follow: at most {2**28} are supported",
    ),
    "many-triangles.serialized": (
        packed(counts=(3, 2**64 - 1)),
        f"1: {2**64 - 1} triangles are said to follow: at most {2**28} are supported",
    ),
    "absurd-counts.serialized": (
        packed(counts=(10**7, 10**7)),
        "1: 10000000 vertices and 10000000 triangles are said to follow, but only "
        f"{len(packed(counts=(10**7, 10**7))) - 4} "
        "bytes do",
    ),
    "vertices-missing.serialized": (
        packed([], counts=(4, 1)),
        "1: the zlib stream ends before the mesh's vertices do",
    ),
    "triangles-missing.serialized": (
        packed(counts=(3, 2)),
        "1: the zlib stream ends before the mesh's triangles do",
    ),
    "normals-missing.serialized": (
        packed([], counts=(3, 1), flags=0x1001),
        "1: the zlib stream ends before the mesh's normals do",
    ),
    "uv-missing.serialized": (
        packed([], counts=(3, 1), flags=0x1002),
        "1: the zlib stream ends before the mesh's texture coordinates do",
    ),
    "colours-missing.serialized": (
        packed([], counts=(3, 1), flags=0x1008),
        "1: the zlib stream ends before the mesh's colours do",
    ),
    "double-is-single.serialized": (
        packed([], counts=(6, 1), flags=0x2000),
        "1: the zlib stream ends before the mesh's vertices do",
    ),
    "index-beyond.serialized": (packed([[0, 1, 3]]), "1: face 0 has the vertex 3, but there are only 0 to 2"),
    "index-large.serialized": (
        packed([[0, 1, 2], [0, 2**32 - 1, 1]]),
        "1: face 1 has the vertex 4.2949673e+09, but there are only 0 to 2",
    ),
    "nan.serialized": (
        packed(points=[CORNERS[0], [1.0, float("nan"), 0.0], CORNERS[2]]),
        f"1: vertex 1 has the coordinate nan: {NUMBER}",
    ),
    "infinite.serialized": (
        packed(points=[*CORNERS[:2], [0.0, 1e39, 0.0]], flags=0x2000),
        f"1: vertex 2 has the coordinate 1e+39: {NUMBER}",
    ),
    "no-number-normal.serialized": (
        packed(extra=[[float("nan")] * 3] * 3, flags=0x1001),
        "1: vertex 0 has a normal that is no number: mend it, or let the shape have face_normals",
    ),
    "no-faces.serialized": (packed([]), "1: the mesh has no faces"),
    "beyond@2.serialized": (
        together(PACKED, PACKED),
        '1: "shape_index" is 2, but the file has 2 meshes, from 0 on',
    ),
    "no-places@1.serialized": (
        PACKED + struct.pack("<I", 2**31),
        f"1: the file ends in the places of {2**31} meshes, which it is too short for",
    ),
    "none@1.serialized": (
        together(PACKED, count=0),
        '1: "shape_index" is 1, but the file has 0 meshes, from 0 on',
    ),
    "place-beyond@1.serialized": (
        PACKED + struct.pack("<QQI", 0, 10**9, 2),
        f"1: mesh 1 should begin at byte 1000000000, {NOWHERE}",
    ),
    "place-of-nothing@1.serialized": (
        PACKED + struct.pack("<QQI", 0, 7, 2),
        f"1: mesh 1 should begin at byte 7, {NOWHERE}",
    ),
    "second-truncated@1.serialized": (
        together(PACKED, PACKED[:20])[: len(PACKED) + 20] + struct.pack("<QQI", 0, len(PACKED), 2),
        "1: the mesh is no zlib stream from its first numbers on: incorrect data check",
    ),
}

MALFORMED: dict[str, tuple[bytes, str]] = {
    **SERIALIZED,
    "no-ply.ply": (b"plywood\n", '1: this is no PLY file: its first line must be "ply"'),
    "obj-as-ply.ply": (OBJ.encode(), '1: this is no PLY file: its first line must be "ply"'),
    "header-ends.ply": (
        b"ply\nformat ascii 1.0\n",
        '3: the header has "" (format once, comment, element, property, end_header)',
    ),
    "unknown-format.ply": (
        ply(form="binary_middle_endian 1.0"),
        '2: the format "binary_middle_endian 1.0" is not supported '
        "(ascii 1.0, binary_little_endian 1.0, binary_big_endian 1.0)",
    ),
    "unknown-version.ply": (
        ply(form="ascii 2.0"),
        '2: the format "ascii 2.0" is not supported '
        "(ascii 1.0, binary_little_endian 1.0, binary_big_endian 1.0)",
    ),
    "unknown-type.ply": (
        ply(of_vertices=["property real x"]),
        '4: "real" is no type of PLY (char, uchar, short, ushort, int, uint, float, double)',
    ),
    "unknown-word.ply": (
        ply(of_vertices=["attribute float x"]),
        '4: the header has "attribute" (format once, comment, element, property, end_header)',
    ),
    "count-words.ply": (ply(vertices="four"), '3: "four" is no number of elements (0 to 268435456)'),
    "count-negative.ply": (ply(vertices=-4), '3: "-4" is no number of elements (0 to 268435456)'),
    "count-absurd.ply": (
        ply(vertices=99999999999),
        '3: "99999999999" is no number of elements (0 to 268435456)',
    ),
    "count-beyond-file.ply": (
        ply(*SQUARE, vertices=268435456),
        '3: 268435456 elements "vertex" are said to follow, but only 24 bytes do',
    ),
    "without-z.ply": (
        ply(*SQUARE, of_vertices=VERTICES[:2]),
        "3: the vertices need the properties x, y and z",
    ),
    "x-twice.ply": (
        ply(of_vertices=[VERTICES[0], VERTICES[0]]),
        '5: the property "x" is given twice',
    ),
    "without-indices.ply": (
        ply(*SQUARE, "3 0 1 2", "3 0 2 3", of_faces=["property list uchar int indices"]),
        "7: the faces need a list vertex_indices or vertex_index",
    ),
    "float-indices.ply": (
        ply(of_faces=["property list uchar float vertex_index"]),
        '8: "vertex_index" must be a list of integers, its length too',
    ),
    "property-first.ply": (
        b"ply\nformat ascii 1.0\nproperty float x\n",
        "3: a property before the first element",
    ),
    "faces-first.ply": (
        b"ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_index\nend_header\n3 0 1 2\n",
        '3: the faces have no vertices: an element "vertex" is wanted',
    ),
    "long-word.ply": (
        b"ply\n" + b"x" * 50 + b"\n",
        f'2: the header has "{39 * "x"}" (format once, comment, element, property, end_header)',
    ),
    "long-count.ply": (
        ply(vertices="0" * 38 + "3"),
        f'3: "{38 * "0"}3" is no number of elements (0 to 268435456)',
    ),
    "utf-16.ply": ("\ufeffply\n".encode("utf-16-le"), "1: the file is UTF-16: UTF-8 is wanted"),
    "utf-16.obj": ("\ufeffv 0 0 0\n".encode("utf-16-be"), "1: the file is UTF-16: UTF-8 is wanted"),
    "cut-continuation.obj": (f"{OBJ}f 1 2 \\\n\\\nx\n".encode(), f"7: {CORNER}"),
    "slash.obj": (f"{OBJ}f / 2 3\n".encode(), f"5: {CORNER}"),
    "slashes.obj": (f"{OBJ}f 1///2 2 3\n".encode(), f"5: {CORNER}"),
    "minus.obj": (f"{OBJ}f - 1 2\n".encode(), f"5: {CORNER}"),
    "backslash.obj": (f"{OBJ}f 1 2 3\\4\n".encode(), f"5: {CORNER}"),
    "backslash-number.obj": (b"v 0 0\\1 0\n", f'1: "0\\1" is no coordinate: {NUMBER}'),
    "crlf-word.obj": (b"v 0 0 0\r\nv 0 a 0\r\n", f'2: "a" is no coordinate: {NUMBER}'),
    "old-mac-word.obj": (b"v 0 0 0\rv 0 a 0\r", f'2: "a" is no coordinate: {NUMBER}'),
    "faces-first-beyond.ply": (
        b"ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_index\nelement vertex 2\n"
        b"property float x\nproperty float y\nproperty float z\nend_header\n3 0 1 2\n0 0 0\n0 0 1\n",
        "10: face 0 has the vertex 2, but there are only 0 to 1",
    ),
    "truncated.ply": (
        ply(*SQUARE, "3 0 1 2"),
        '15: the file ends before the 2 elements "face" of line 7 do',
    ),
    "two-corners.ply": (
        binary(TRIANGLE, [0, 1], vertices=3),
        "7: face 0 has 2 corners: only triangles are supported, as in Mitsuba",
    ),
    "truncated-binary-face.ply": (
        binary(TRIANGLE, [0, 1, 2], vertices=3)[:-1],
        '7: the file ends before the 1 elements "face" of this line do',
    ),
    "longer.ply": (ply(*SQUARE, "3 0 1 2", "3 0 2 3", "3 1 2 3"), "16: 8 bytes are left after all elements"),
    "quad.ply": (
        ply(*SQUARE, "4 0 1 2 3", faces=1),
        "14: face 0 has 4 corners: only triangles are supported, as in Mitsuba",
    ),
    "index-beyond.ply": (
        ply(*SQUARE, "3 0 1 2", "3 0 2 4"),
        "15: face 1 has the vertex 4, but there are only 0 to 3",
    ),
    "index-negative.ply": (
        binary(TRIANGLE, [0, 1, -1], vertices=3),
        "7: face 0 has the vertex -1, but there are only 0 to 2",
    ),
    "index-fraction.ply": (
        ply(*SQUARE, "3 0 1 2.5", faces=1),
        "14: 2.5 is no integer, and a value of type int is wanted",
    ),
    "word.ply": (ply("0 0 0", "1 zero 0", *SQUARE), f'11: "zero" is no value of PLY: {NUMBER}'),
    "nan.ply": (ply("0 0 0", "1 nan 0", *SQUARE), f'11: "nan" is no value of PLY: {NUMBER}'),
    "nan-binary.ply": (
        binary([float("nan"), *TRIANGLE[1:]], [0, 1, 2], vertices=3),
        f"3: vertex 0 has the coordinate nan: {NUMBER}",
    ),
    "infinite-binary.ply": (
        binary([*TRIANGLE[:8], float("inf")], [0, 1, 2], vertices=3),
        f"3: vertex 2 has the coordinate inf: {NUMBER}",
    ),
    "no-faces.ply": (ply(*SQUARE, faces=0), "1: the mesh has no faces"),
    "no-faces.obj": (OBJ.encode(), "1: the mesh has no faces"),
    "word.obj": (b"v 0 a 0\n", f'1: "a" is no coordinate: {NUMBER}'),
    "two-coordinates.obj": (b"v 0 0\n", "1: the coordinate is missing: a number is wanted"),
    "infinite.obj": (b"v 0 0 0\nv 0 1e39 0\n", f'2: "1e39" is no coordinate: {NUMBER}'),
    "index-beyond.obj": (
        f"{OBJ}f 1 2 5\n".encode(),
        "5: the face refers to vertex 5, but there are 4 so far",
    ),
    "index-zero.obj": (f"{OBJ}f 0 1 2\n".encode(), "5: the face refers to vertex 0, but there are 4 so far"),
    "index-negative.obj": (
        f"{OBJ}f -5 -1 -2\n".encode(),
        "5: the face refers to vertex -5, but there are 4 so far",
    ),
    "normal-beyond.obj": (
        f"{OBJ}vn 0 0 1\nf 1//1 2//1 3//2\n".encode(),
        "6: the face refers to normal 2, but there are 1 so far",
    ),
    "texture-beyond.obj": (
        f"{OBJ}f 1/1 2/1 3/1\n".encode(),
        "5: the face refers to texture coordinate 1, but there are 0 so far",
    ),
    "normal-zero.obj": (f"{OBJ}vn 0 0 0\n".encode(), "5: a normal must not be 0"),
    "some-normals.obj": (
        f"{OBJ}vn 0 0 1\nf 1//1 2//1 3\n".encode(),
        "7: 1 of 3 vertices have no normal: all or none must have one",
    ),
    "two-corners.obj": (f"{OBJ}f 1 2\n".encode(), "5: the face has 2 corners: three or more are wanted"),
    "corner-word.obj": (
        f"{OBJ}f 1 2 x\n".encode(),
        "5: a corner of the face is no v, v/vt, v//vn or v/vt/vn",
    ),
    "corner-four.obj": (
        f"{OBJ}f 1 2 3.5\n".encode(),
        "5: a corner of the face is no v, v/vt, v//vn or v/vt/vn",
    ),
    "zero-byte.obj": (f"{OBJ}f 1 2 \0\n".encode(), "5: the face has 2 corners: three or more are wanted"),
}
