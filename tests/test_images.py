"""Picture files as renderers write them: what they mean, and what is refused in a line that names them."""

import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from typer.testing import CliRunner

import raycheck
from raycheck.base import files
from raycheck.base.errors import ImageError
from raycheck.base.images import Window, encode_srgb, find_images, load_image, write_exr, write_pfm, write_png
from raycheck.commands.app import app
from raycheck.truth import references

SIZE = (6, 4)
COLOURS = {"beauty": 0.5, "albedo": 0.25, "normal": 0.75}


def constant(value: float, size: tuple[int, int] = SIZE) -> np.ndarray:
    """(H, W, 3), blue the brightest."""
    return np.full((*size, 3), value) * [1.0, 1.5, 2.0]


def channels(value: float, prefix: str = "", names: str = "RGB", size: tuple[int, int] = SIZE) -> dict:
    return {f"{prefix}{c}": constant(value, size)[..., i] for i, c in enumerate(names)}


def write_parts(path: Path, parts: list[tuple[str, dict]], **attributes: object) -> Path:
    """An EXR with a part for each name and its channels."""
    specs = []
    for name, layers in parts:
        spec = oiio.ImageSpec(SIZE[1], SIZE[0], len(layers), oiio.FLOAT)
        spec.channelnames = tuple(layers)
        spec.attribute("oiio:subimagename", name)
        for key, value in attributes.items():
            setattr(spec, key, value)
        specs.append(spec)
    writer = oiio.ImageOutput.create(str(path))
    assert writer.open(str(path), tuple(specs)) if len(specs) > 1 else writer.open(str(path), specs[0])
    for index, (spec, (_, layers)) in enumerate(zip(specs, parts, strict=True)):
        assert index == 0 or writer.open(str(path), spec, "AppendSubimage")
        data = np.stack(list(layers.values()), axis=2).astype(np.float32)
        assert writer.write_image(np.ascontiguousarray(data)), writer.geterror()
    writer.close()
    return path


@dataclass
class Done:
    returncode: int
    stdout: str
    stderr: str


def command(*words: object) -> Done:
    """A command line of raycheck, in this process."""
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return Done(done.exit_code, done.stdout, done.stderr)


class TestLayers:
    def layered(self, path: Path) -> Path:
        layers = {k: v for name, value in COLOURS.items() for k, v in channels(value, f"{name}.").items()}
        write_exr(path, layers | {"beauty.A": np.ones(SIZE), "depth.Z": np.ones(SIZE)})
        return path

    @pytest.mark.parametrize("layer", COLOURS)
    @pytest.mark.parametrize("parts", [False, True])
    def test_chosen(self, tmp_path: Path, layer: str, parts: bool) -> None:
        path = tmp_path / "a.exr"
        if parts:
            write_parts(path, [(name, channels(value)) for name, value in COLOURS.items()])
        else:
            self.layered(path)
        for name in (layer, layer.upper()):
            np.testing.assert_allclose(load_image(f"{path}:{name}").pixels, constant(COLOURS[layer]))

    @pytest.mark.parametrize("parts", [False, True])
    def test_not_chosen(self, tmp_path: Path, parts: bool) -> None:
        path = tmp_path / "a.exr"
        if parts:
            write_parts(path, [(name, channels(value)) for name, value in COLOURS.items()])
        else:
            self.layered(path)
        with pytest.raises(ImageError, match=r"a.exr: several layers \((\w+(, )?){3}\): choose one"):
            load_image(path)
        with pytest.raises(ImageError, match=r"a.exr: no layer depth; it has (\w+(, )?){3}$"):
            load_image(f"{path}:depth")

    def test_no_layer_is_the_image(self, tmp_path: Path) -> None:
        """R, G and B themselves are the picture beside layers; so is the only layer."""
        write_exr(tmp_path / "a.exr", channels(0.25, "albedo.") | channels(0.5))
        np.testing.assert_allclose(load_image(tmp_path / "a.exr").pixels, constant(0.5))
        np.testing.assert_allclose(load_image(f"{tmp_path}/a.exr:albedo").pixels, constant(0.25))
        write_exr(tmp_path / "b.exr", channels(0.5, "view.beauty.") | {"depth.Z": np.ones(SIZE)})
        np.testing.assert_allclose(load_image(tmp_path / "b.exr").pixels, constant(0.5))
        write_parts(tmp_path / "c.exr", [("depth", {"Z": np.ones(SIZE)}), ("rgb", channels(0.5))])
        np.testing.assert_allclose(load_image(tmp_path / "c.exr").pixels, constant(0.5))

    def test_standard_errors_are_of_their_layer(self, tmp_path: Path) -> None:
        write_exr(tmp_path / "a.exr", channels(0.5, "beauty.") | channels(0.1, "stderr."))
        assert load_image(tmp_path / "a.exr").stderr is not None
        both = channels(0.5, "beauty.") | channels(0.25, "albedo.") | channels(0.1, "stderr.")
        write_exr(tmp_path / "b.exr", both | channels(0.2, "albedo.stderr."))
        assert load_image(f"{tmp_path}/b.exr:beauty").stderr is None
        np.testing.assert_allclose(load_image(f"{tmp_path}/b.exr:albedo").stderr, constant(0.2))

    def test_a_colon_in_a_name(self, tmp_path: Path) -> None:
        write_exr(tmp_path / "a.exr", channels(0.5))
        write_exr(tmp_path / "b.exr", channels(0.25))
        (tmp_path / "b.exr").rename(tmp_path / "a.exr:b")
        np.testing.assert_allclose(load_image(f"{tmp_path}/a.exr:b").pixels, constant(0.25))
        with pytest.raises(ImageError, match=r"none\.exr:b: No such file"):
            load_image(tmp_path / "none.exr:b")
        write_pfm(tmp_path / "a.pfm", constant(0.5))
        with pytest.raises(ImageError, match=r"a\.pfm: a PFM has no layer b"):
            load_image(f"{tmp_path}/a.pfm:b")

    def test_verify_and_compare_take_them(self, tmp_path: Path) -> None:
        """The albedo is never judged for the beauty."""
        truth = references.load_reference("point-light").best()[0]
        height, width = truth.shape[:2]
        for index in range(2):
            layers = {f"albedo.{c}": np.full((height, width), 0.5) for c in "RGB"}
            noise = np.random.default_rng(index).normal(1, 1e-3, (height, width))
            layers |= {f"beauty.{c}": truth[..., i] * noise for i, c in enumerate("RGB")}
            layers |= {f"beauty.stderr.{c}": np.full((height, width), 1e-4) for c in "RGB"}
            write_exr(tmp_path / f"{index}.exr", layers)
        verified = command("verify", "point-light", "--images", f"{tmp_path}/*.exr:beauty")
        assert verified.returncode == 0, verified.stdout
        refused = command("verify", "point-light", "--images", f"{tmp_path}/*.exr")
        assert "several layers (albedo, beauty)" in refused.stdout
        assert command("compare", f"{tmp_path}/0.exr:beauty", f"{tmp_path}/1.exr:beauty").returncode == 0
        refused = command("compare", f"{tmp_path}/0.exr", f"{tmp_path}/1.exr:beauty")
        assert refused.returncode == 2 and "several layers (albedo, beauty)" in refused.stderr


class TestWindows:
    def part(self, path: Path, x: int, y: int, full: tuple[int, int] = (8, 8)) -> Path:
        layers = channels(0.5) | channels(1e-5, "stderr.")
        window = {"x": x, "y": y, "full_x": 0, "full_y": 0, "full_width": full[0], "full_height": full[1]}
        return write_parts(path, [("", layers)], **window)

    def test_where_the_pixels_are(self, tmp_path: Path) -> None:
        assert load_image(self.part(tmp_path / "a.exr", 2, 1)).window == Window(2, 1, 8, 8)
        assert load_image(self.part(tmp_path / "b.exr", 0, 0, (4, 6))).window is None
        moved = write_parts(tmp_path / "c.exr", [("", channels(0.5))], x=5, y=7, full_x=5, full_y=7)
        assert load_image(moved).window is None

    @pytest.mark.parametrize(("x", "y"), [(-1, 0), (0, -1), (5, 0), (0, 3), (100, 0)])
    def test_outside_the_display_window(self, tmp_path: Path, x: int, y: int) -> None:
        corners = rf"\({x}, {y}\) to \({x + 3}, {y + 5}\), is not inside .*, \(0, 0\) to \(7, 7\)"
        with pytest.raises(ImageError, match=f"a.exr: the data window, {corners}"):
            load_image(self.part(tmp_path / "a.exr", x, y))

    def test_compare(self, tmp_path: Path) -> None:
        """Equal pixels of other places, or of a larger image, are no equal pictures."""
        a, same = self.part(tmp_path / "a.exr", 2, 1), self.part(tmp_path / "b.exr", 2, 1)
        assert raycheck.compare(a, same).verdict == "PASS"
        for other in (self.part(tmp_path / "c.exr", 3, 1), self.part(tmp_path / "d.exr", 0, 0, (4, 6))):
            found = raycheck.compare(a, other)
            assert found.verdict == "FAIL"
            assert "scene asks for 4×6 at column 2, row 1 of 8×8" in found.reason
        assert "4×6 pixels at column 3, row 1 of 8×8" in raycheck.compare(a, tmp_path / "c.exr").reason

    def test_verify(self, tmp_path: Path) -> None:
        """A part that has as many pixels as the scene asks for is not the picture."""
        truth = references.load_reference("point-light").best()[0]
        height, width = truth.shape[:2]
        window = {"x": 0, "y": 0, "full_x": 0, "full_y": 0, "full_width": 2 * width, "full_height": height}
        spec = oiio.ImageSpec(width, height, 3, oiio.FLOAT)
        for key, value in window.items():
            setattr(spec, key, value)
        writer = oiio.ImageOutput.create(str(tmp_path / "a.exr"))
        assert writer.open(str(tmp_path / "a.exr"), spec) and writer.write_image(truth.astype(np.float32))
        writer.close()
        [case] = raycheck.verify(scenes=["point-light"], images=[tmp_path / "a.exr"]).cases
        assert case.verdict == "FAIL"
        wanted = f"the scene asks for {width}×{height}"
        assert f"at column 0, row 0 of {2 * width}×{height}, {wanted}" in case.reason

    def test_a_crop_of_oneray(self, oneray: Path, scene, tmp_path: Path) -> None:
        for name, crop in (("a", "8,0,16,16"), ("b", "0,8,16,16")):
            words = [oneray, scene("furnace"), "--spp", "4096", "--crop", crop]
            subprocess.run([*words, "-o", tmp_path / f"{name}.exr", "--quiet"], check=True)
        assert command("compare", tmp_path / "a.exr", tmp_path / "a.exr").returncode == 0
        assert command("compare", tmp_path / "a.exr", tmp_path / "b.exr").returncode == 1


class TestPrecision:
    @pytest.mark.parametrize(
        ("name", "stored", "bits", "found"),
        [
            ("a.png", "uint8", 0, "8-bit"),
            ("a.png", "uint16", 0, "16-bit"),
            ("a.tif", "uint16", 0, "16-bit"),
            ("a.dpx", "uint16", 10, "10-bit"),
            ("a.exr", "half", 0, "half"),
            ("a.tif", "float", 0, "float"),
            ("a.hdr", "float", 0, "rgbe"),
        ],
    )
    def test_named(self, tmp_path: Path, name: str, stored: str, bits: int, found: str) -> None:
        """And half a step of it is the quantum."""
        grey = np.linspace(0.05, 0.9, SIZE[0] * SIZE[1] * 3).reshape(*SIZE, 3)
        spec = oiio.ImageSpec(SIZE[1], SIZE[0], 3, stored)
        if bits:
            spec.attribute("oiio:BitsPerSample", bits)
        writer = oiio.ImageOutput.create(str(tmp_path / name))
        assert writer.open(str(tmp_path / name), spec)
        shown = encode_srgb(grey) if "-bit" in found else grey
        assert writer.write_image(np.ascontiguousarray(shown, dtype=np.float32))
        writer.close()
        image = load_image(tmp_path / name)
        assert image.precision == found
        difference = np.abs(image.pixels - grey)
        assert (difference <= 1.01 * image.quantum + 1e-6).all()
        if "-bit" in found:
            assert difference.max() > 0.2 * image.quantum.max()

    def test_16_bits_never_pass(self, tmp_path: Path) -> None:
        truth = references.load_reference("point-light").best()[0]
        spec = oiio.ImageSpec(truth.shape[1], truth.shape[0], 3, oiio.UINT16)
        writer = oiio.ImageOutput.create(str(tmp_path / "a.png"))
        assert writer.open(str(tmp_path / "a.png"), spec)
        assert writer.write_image(np.ascontiguousarray(encode_srgb(truth), dtype=np.float32))
        writer.close()
        [case] = raycheck.verify(scenes=["point-light"], images=[tmp_path / "a.png"]).cases
        assert case.verdict == "INCONCLUSIVE"
        assert "16 bits cannot show that an image is right" in case.reason

    def test_whole_numbers_of_32_bits(self, tmp_path: Path) -> None:
        spec = oiio.ImageSpec(4, 6, 3, oiio.UINT32)
        spec.channelnames = ("R", "G", "B")
        writer = oiio.ImageOutput.create(str(tmp_path / "a.exr"))
        assert writer.open(str(tmp_path / "a.exr"), spec)
        assert writer.write_image(np.full((6, 4, 3), 7, np.uint32))
        writer.close()
        with pytest.raises(ImageError, match=r"a.exr: pixels of type uint, floats are needed"):
            load_image(tmp_path / "a.exr")


class TestPfm:
    DATA = np.arange(6 * 4 * 3, dtype="<f4").tobytes()

    @pytest.mark.parametrize(
        "head",
        [
            "PF\n4 6\nnan\n", "PF\n4 6\n0\n", "PF\n4 6\n-0.0\n", "PF\n4 6\ninf\n", "PF\n4 6\n-inf\n",
            "PF\n4 6\n1e999\n", "PF\n4 6\n1e-999\n", "PF\n4 6\n1_0\n", "PF\n4 6\n0x1\n", "PF\n4 6\nx\n",
            "PF\n6_4 6\n-1\n", "PF\n+4 6\n-1\n", "PF\n4 -6\n-1\n", "PF\n4.0 6\n-1\n", "PF\n٤ 6\n-1\n",
            "PF\n4 6\n-1 3\n", "PF\n4 99999999999\n-1\n", "PF\n4\n6 -1 2\n",
        ],
    )  # fmt: skip
    def test_refused(self, tmp_path: Path, head: str) -> None:
        (tmp_path / "a.pfm").write_bytes(head.encode() + self.DATA * 20)
        with pytest.raises(ImageError, match=r"a.pfm: the PFM header is not 'PF WIDTH HEIGHT SCALE'"):
            load_image(tmp_path / "a.pfm")

    @pytest.mark.parametrize(
        "head",
        [
            "PF\n4 6\n-1\n", "PF 4 6 -1.0\n", "PF\r\n4 6\r\n-1.000000\r\n", "PF\n4\n6\n-1e0\n",
            "PF\n# made by\n4 6 # size\n-1.\n", "PF\n004 06\n-1.0\n",
        ],
    )  # fmt: skip
    def test_read(self, tmp_path: Path, head: str) -> None:
        (tmp_path / "a.pfm").write_bytes(head.encode() + self.DATA)
        expected = np.arange(72.0).reshape(6, 4, 3)[::-1]
        np.testing.assert_array_equal(load_image(tmp_path / "a.pfm").pixels, expected)

    def test_the_scale_is_a_factor(self, tmp_path: Path) -> None:
        """As to OpenImageIO and Mitsuba."""
        for scale, order in ((-2.5, "<f4"), (0.5, ">f4")):
            data = np.frombuffer(self.DATA, "<f4").astype(order).tobytes()
            (tmp_path / "a.pfm").write_bytes(f"PF\n4 6\n{scale}\n".encode() + data)
            found = load_image(tmp_path / "a.pfm").pixels
            theirs = oiio.ImageBuf(f"{tmp_path}/a.pfm").get_pixels(oiio.FLOAT)[::-1]
            np.testing.assert_allclose(found, theirs)


ODD_NAMES = [
    "a b", "a%20b", "%s%d%n", "a?b=c", "a#b", "ü€𝔸", 'q"uo\'te', "[bold]x[bold]", "[red]", ":smile:",
    "{output}", "{0}", "$HOME", "~", "a\\b", "a;b", "a&b", "<b>", "*", "[1]", "-x", "a:b",
    "x" * 200, "a\u0308",
]  # fmt: skip


class TestNames:
    """A message keeps a path's letters, and odd ones are no obstacle."""

    @pytest.mark.parametrize("name", ODD_NAMES)
    def test_read_and_refused(self, tmp_path: Path, name: str) -> None:
        folder = tmp_path / name
        folder.mkdir()
        good, bad = folder / f"{name}.exr", folder / f"bad{name}.exr"
        write_exr(good, channels(0.5, size=(32, 32)) | channels(0.02, "stderr.", size=(32, 32)))
        bad.write_bytes(b"v/1\x01" + b"junk" * 100)
        assert find_images(str(good)) == [good]
        done = command("compare", good, good, "--json", folder / f"{name}.json")
        assert done.returncode == 0 and (folder / f"{name}.json").is_file(), done.stderr
        done = command("compare", bad, good)
        assert done.returncode == 2
        assert done.stderr.startswith(f"raycheck: {bad}: not an image that can be read (")
        assert done.stderr.count(str(tmp_path)) == done.stderr.count("\n") == 1
        write_exr(bad, channels(0.5, size=(4, 4)) | channels(0.02, "stderr.", size=(4, 4)))
        done = command("compare", good, bad)
        assert done.returncode == 1
        assert done.stdout == f"FAIL {bad}: the image is 4×4 pixels, the scene asks for 32×32\n"

    def test_not_text(self, tmp_path: Path) -> None:
        path = tmp_path / os.fsdecode(b"\xff\xfe.exr")
        path.write_bytes(b"v/1\x01" + b"junk" * 100)
        done = command("compare", path, path)
        assert done.returncode == 2 and done.stderr.count("\n") == 1
        assert "the name is not UTF-8: give the file another" in done.stderr

    def test_lines_stay_lines(self, tmp_path: Path) -> None:
        path = tmp_path / "a\n\x1b[31mb.exr"
        path.write_bytes(b"v/1\x01" + b"junk" * 100)
        done = command("compare", path, path)
        assert done.returncode == 2 and done.stderr.count("\n") == 1 and "\x1b" not in done.stderr
        assert f"{tmp_path}/a\\n\\x1b[31mb.exr: not an image" in done.stderr

    @pytest.mark.parametrize("name", ODD_NAMES)
    def test_oneray(self, oneray: Path, scene, tmp_path: Path, name: str) -> None:
        folder = tmp_path / name
        folder.mkdir()
        copy = folder / f"{name}.xml"
        copy.write_bytes(scene("furnace").read_bytes())
        words = [oneray, copy, "-o", folder / f"{name}.exr", "--spp", "2", "--quiet"]
        subprocess.run(words, check=True, cwd=folder)
        assert load_image(folder / f"{name}.exr").stderr is not None
        copy.write_text("<scene/>")
        done = subprocess.run([*words], check=False, capture_output=True, text=True)
        assert done.returncode == 2 and done.stderr.startswith(f"{copy}:1: ")


class TestLinks:
    """What is written goes to where a link leads, also where nothing is yet."""

    @pytest.mark.parametrize("exists", [False, True])
    @pytest.mark.parametrize("depth", [1, 3])
    def test_written_through(self, oneray: Path, scene, tmp_path: Path, exists: bool, depth: int) -> None:
        (tmp_path / "away/further").mkdir(parents=True)
        (tmp_path / "links").mkdir()
        for kind in ("exr", "pfm", "png", "json"):
            target = tmp_path / f"away/further/target.{kind}"
            if exists:
                target.write_text("old")
            links = [tmp_path / f"links/{i}.{kind}" for i in range(depth)]
            for link, to in zip(links, [*links[1:], None], strict=True):
                link.symlink_to(to.name if to else f"../away/further/target.{kind}")
            words = [oneray, scene("furnace"), "--spp", "2", "--quiet"]
            words += ["--stats" if kind == "json" else "-o", links[0]]
            subprocess.run(words, check=True)
            assert all(link.is_symlink() for link in links)
            assert target.stat().st_size > 100
        assert sorted(p.name for p in (tmp_path / "away/further").iterdir()) == [
            f"target.{kind}" for kind in ("exr", "json", "pfm", "png")
        ]

    def test_no_way(self, oneray: Path, scene, tmp_path: Path) -> None:
        """A ring of links, or a link into no folder: a line, and nothing is left behind."""
        (tmp_path / "a.exr").symlink_to("b.exr")
        (tmp_path / "b.exr").symlink_to("a.exr")
        (tmp_path / "c.exr").symlink_to("none/c.exr")
        said = {"a": "Too many levels of symbolic links", "c": "No such file or directory"}
        for name, reason in said.items():
            words = [oneray, scene("furnace"), "--spp", "2", "-o", tmp_path / f"{name}.exr"]
            done = subprocess.run(words, capture_output=True, text=True, check=False)
            assert done.returncode == 2
            assert done.stderr == f"oneray: {tmp_path}/{name}.exr: cannot be written: {reason}\n"
        assert len(list(tmp_path.iterdir())) == 3

    def test_raycheck(self, tmp_path: Path) -> None:
        a = tmp_path / "a.exr"
        write_exr(a, channels(0.5, size=(32, 32)) | channels(0.02, "stderr.", size=(32, 32)))
        (tmp_path / "away").mkdir()
        (tmp_path / "link.json").symlink_to("away/found.json")
        assert command("compare", a, a, "--json", tmp_path / "link.json").returncode == 0
        assert (tmp_path / "link.json").is_symlink() and (tmp_path / "away/found.json").is_file()
        assert [p.name for p in (tmp_path / "away").iterdir()] == ["found.json"]
        (tmp_path / "pages").symlink_to("away/pages/of")
        assert files.made_folder(tmp_path / "pages") == tmp_path / "away/pages/of"
        assert (tmp_path / "pages").is_dir() and (tmp_path / "pages").is_symlink()
        done = command("report", "--seconds", "0", "-o", a)
        assert (done.returncode, done.stderr) == (2, f"raycheck: {a}: cannot be a folder: File exists\n")
        (tmp_path / "lost.json").symlink_to("none/found.json")
        done = command("compare", a, a, "--json", tmp_path / "lost.json")
        assert done.returncode == 2 and done.stderr.startswith(f"raycheck: {tmp_path}/lost.json: there is no")


class TestDamaged:
    """Bytes that were lost or changed: an image, or one line that names the file."""

    @pytest.mark.parametrize("kind", ["exr", "parts.exr", "pfm", "png"])
    def test_bytes(self, tmp_path: Path, kind: str) -> None:
        whole, path = tmp_path / f"whole.{kind}", tmp_path / f"damaged.{kind}"
        if kind == "exr":
            write_exr(whole, channels(0.5) | channels(0.1, "stderr.") | channels(0.2, "albedo."))
        elif kind == "pfm":
            write_pfm(whole, constant(0.5))
        elif kind == "png":
            write_png(whole, np.full((*SIZE, 3), 128, np.uint8))
        else:
            write_parts(whole, [("a", channels(0.5)), ("b", channels(0.25))])
        random, refused = np.random.default_rng(7), 0
        for number in range(200):
            content = bytearray(whole.read_bytes())
            for _ in range(random.integers(1, 5)):
                content[random.integers(0, min(len(content), 900))] = random.integers(0, 256)
            path.write_bytes(content[: random.integers(0, len(content))] if number % 5 == 0 else content)
            try:
                assert load_image(path).pixels.ndim == 3
            except ImageError as error:
                refused += 1
                assert str(error).startswith(f"{path}: ") and "\n" not in str(error)
        assert refused >= 40
