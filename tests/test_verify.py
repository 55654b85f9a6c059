"""Renderers whose mistakes are known, judged: what is right passes, what is wrong fails and is called by its
name.

Synthetic renderers give the closed form or the reference plus noise. Seeds are fixed.
"""

import json
import os
import re
import subprocess
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import raycheck
from raycheck.base.errors import NotFound, ReferenceError_, RenderError
from raycheck.base.images import encode_srgb, load_image, write_exr, write_pfm, write_png
from raycheck.judging import judge_renderer, repeated, sentences
from raycheck.judging import verify as verify_module
from raycheck.judging.settings import PILOT_SPP
from raycheck.renderers.commands import Command, split_command
from raycheck.scene import variants
from raycheck.scene.content import read_content
from raycheck.scene.techniques import TECHNIQUES, applicable, technique
from raycheck.stats.verdict import ALPHA, Outcome
from raycheck.truth import references
from raycheck.truth.expected import truth_of

HERE = Path(__file__).parent
SCENE = "point-light"


@pytest.fixture(scope="module")
def truth():
    return truth_of(references.load_reference(SCENE)).mean


def noisy(mean, noise=0.5):
    """Right: gamma noise of relative deviation noise/√spp in each pixel, alike in its channels."""

    def render(scene, spp, seed):
        rng = np.random.default_rng(seed)
        k = spp / noise**2
        return mean * rng.gamma(k, 1 / k, (*mean.shape[:2], 1))

    return render


def judged(render, scene=SCENE, **settings):
    [case] = raycheck.verify(render, [scene], **{"spp": 16} | settings).cases
    return case


class TestVerdicts:
    def test_right(self, truth):
        case = judged(noisy(truth))
        assert case.verdict is Outcome.PASS
        assert case.bias_low <= case.bias <= case.bias_high
        assert case.mde_image < 0.01 and case.images == 64

    def test_spp_is_planned_for_what_a_pass_needs(self, truth):
        case = judged(noisy(truth, noise=3.0), spp=None)
        assert case.verdict is Outcome.PASS
        assert case.spp > 8

    def test_too_bright(self, truth):
        case = judged(noisy(1.03 * truth))
        assert case.verdict is Outcome.FAIL
        assert re.search(r"^everything is [23]\.\d+ % ± [\d.]+ % too bright", case.reason)
        assert case.bias == pytest.approx(0.03, abs=0.003)

    def test_dark_corner(self, truth):
        broken = truth.copy()
        broken[40:56, 8:16] *= 0.9
        case = judged(noisy(broken))
        assert case.verdict is Outcome.FAIL
        assert "2 of 64 tiles differ" in case.reason and "too dark" in case.reason
        assert "columns 8–15 from the top left (lower left)" in case.reason

    def test_a_thorough_run_does_what_would_decide(self, truth):
        """A corner whose noise the pilot did not show leaves the first look open; the second has seeds of its
        own.
        """
        seeds = []

        def render(scene, spp, seed):
            seeds.append(seed)
            image = noisy(truth, noise=4.0)(scene, spp, seed)
            if spp > PILOT_SPP:
                image[:16, :16] = noisy(truth, noise=100.0)(scene, spp, seed)[:16, :16]
            return image

        quick = judged(render, spp=None)
        assert quick.verdict is Outcome.INCONCLUSIVE and quick.looks == 1
        seeds.clear()
        case = judged(render, spp=None, thorough=True)
        assert case.verdict is Outcome.PASS and case.looks == 2
        assert len(set(seeds)) == len(seeds) > 2 * 64
        still_open = replace(case, verdict=Outcome.INCONCLUSIVE, more_samples=2.0)
        [again] = raycheck.verify(render, [SCENE], thorough=True, earlier=[still_open]).cases
        assert again == still_open, "two looks are all, however often a run is resumed"
        assert judged(render, spp=quick.spp, thorough=True).looks == 1

    @pytest.mark.parametrize(("more", "first"), [({}, 0.5), ({"spp": 16}, 1.0), ({"level": 1e-3}, 0.5)])
    def test_the_looks_of_a_thorough_run_share_its_level(self, truth, monkeypatch, more, first):
        """Half of it is for those that follow the first, whether any do or not."""
        levels = []

        class Spied(repeated.Repeated):
            def __post_init__(self):
                super().__post_init__()
                levels.append(self.settings.alpha)

            def look(self):
                self.case = replace(open_, verdict=Outcome.PASS)
                return self.case

        def first_look(task, truth, taken, settings):
            levels.append(settings.alpha)
            return open_

        open_ = replace(judged(noisy(truth)), verdict=Outcome.INCONCLUSIVE, more_samples=2.0)
        monkeypatch.setattr(verify_module, "Repeated", Spied)
        monkeypatch.setattr(verify_module, "judge_task", first_look)
        judged(noisy(truth), **{"spp": None, "thorough": True} | more)
        whole = more.get("level", ALPHA)
        assert levels[0] == pytest.approx(first * whole) and sum(levels) == pytest.approx(whole)

    def test_noise_says_what_would_decide(self, truth):
        case = judged(noisy(truth, noise=20.0), spp=1)
        assert case.verdict is Outcome.INCONCLUSIVE
        assert "times the samples" in case.reason
        assert case.more_samples > 1.5

    def test_same_seeds_same_verdict(self, truth):
        first, second = judged(noisy(truth)), judged(noisy(truth))
        assert (first.bias, first.p_omnibus) == (second.bias, second.p_omnibus)
        assert judged(noisy(truth), seed=1).bias != first.bias


@pytest.mark.parametrize(
    ("mistake", "words"),
    [
        (lambda x: x[::-1], "upside down"),
        (lambda x: x[:, ::-1], "mirrored"),
        (lambda x: x[:, :, ::-1], "red and blue are swapped"),
        (lambda x: x * np.pi, "a factor of π"),
        (lambda x: x / 2, "a factor of 1/2"),
        (lambda x: 2 * x[::-1], "upside down"),
        (lambda x: x * 1.37, "everything is 37 % ± "),
        (lambda x: encode_srgb(x), "sRGB-encoded"),
        (lambda x: x[:, :63], "63×64 pixels, the scene asks for 64×64"),
    ],
)
def test_mistakes_of_convention_are_named(truth, mistake, words):
    right = noisy(truth, noise=0.1)
    case = judged(lambda scene, spp, seed: mistake(right(scene, spp, seed)))
    assert case.verdict is Outcome.FAIL
    assert words in case.reason
    assert case.seconds < 2


def test_clamped():
    mean = truth_of(references.load_reference("cornell-box")).mean
    right = noisy(mean)
    case = judged(lambda *a: np.minimum(right(*a), 1.0), "cornell-box")
    assert case.verdict is Outcome.FAIL
    assert "clamped at 1" in case.reason


SLOPE = np.linspace(0.2, 1.06, 64)[:, None, None]


@pytest.mark.parametrize(
    ("wrong", "fails"),
    [
        (lambda right: right * SLOPE, True),  # a cosine squared: 37 % too dark
        (lambda right: right * [0.9, 0.6, 0.7], True),  # albedos decoded as sRGB
        (lambda right: np.where(SLOPE < 0.5, right, 0.9 * right.mean(axis=1, keepdims=True)), True),  # a bad
        # dimension of points that are otherwise even
        (lambda right: gaussian_filter(np.minimum(right, 2 * right.mean()), (2, 2, 0)), True),  # a denoiser
    ],
)
def test_what_is_calmer_is_not_called_clamped(truth, wrong, fails):
    """Bright samples are missing where their values show it: less noise has many other reasons."""
    right = noisy(truth, noise=2.0)
    case = judged(lambda *a: wrong(right(*a)))
    assert case.verdict is Outcome.FAIL and "clamped" not in case.reason


def test_even_samples_are_not_called_clamped(truth):
    """A stratified sampler: right, with a twentieth of the variance."""
    case = judged(noisy(truth, noise=0.1))
    assert case.verdict is Outcome.PASS


def test_clamped_samples_are_shown_by_their_values(truth):
    """One sample in ten has all the light, and none more than a firefly may."""
    most = 6 * truth.max()

    def render(scene, spp, seed):
        rng = np.random.default_rng(seed)
        shape = (spp, *truth.shape[:2], 1)
        samples = 10 * (rng.random(shape) < 0.1) * rng.exponential(size=shape)
        return np.minimum(truth * samples, most).mean(axis=0)

    case = judged(render)
    assert case.verdict is Outcome.FAIL
    assert f"bright samples are clamped at {most:.4g}" in case.reason


def test_sentence_and_table_are_of_one_channel_and_one_level(truth):
    """Bright in red on the left and dark in blue on the right, as no convention has it: the sentence has the
    channel and the figures that stand in the table, and says nothing of the picture as a whole beside them.
    """
    left = np.linspace(1, 0, 64)[None, :, None]
    wrong = truth * (1 + 0.3 * left**2 * [1, 0, 0] - 0.2 * (1 - left) ** 3 * [0, 0, 1])
    case = judged(noisy(wrong, noise=0.1))
    assert case.verdict is Outcome.FAIL
    said = f"the image as a whole is {sentences.amount(case.bias, case.bias_low, case.bias_high)}"
    assert said in case.reason and case.reason.count("the image") == 1 and "everything" not in case.reason
    of = {"red": 0, "green": 1, "blue": 2}[case.channel]
    mean = (wrong - truth).mean(axis=(0, 1))[of] / truth.mean(axis=(0, 1))[of]
    assert case.bias == pytest.approx(mean, abs=1e-3)


def test_channels_that_differ_by_a_third_have_no_factor_together(truth):
    case = judged(noisy(truth * [1.33, 1.0, 0.75], noise=0.1))
    assert re.match(r"everything is 33 % ± [\d.]+ % too bright in red, right in green, 25 % ±", case.reason)
    assert "as a whole" not in case.reason


def test_nan_is_counted_and_located(truth):
    def render(scene, spp, seed):
        image = noisy(truth)(scene, spp, seed)
        image[5, 7, 0], image[9, 9] = np.nan, np.inf
        return image

    case = judged(render)
    assert case.verdict is Outcome.FAIL
    assert "1 NaN and 3 Inf values in 2 of 4096 pixels, the first in row 5, column 7" in case.reason


def test_identical_seeds(truth):
    case = judged(lambda scene, spp, seed: truth)
    assert case.verdict is Outcome.FAIL and "the seed changes nothing" in case.reason
    case = judged(lambda scene, spp, seed: noisy(truth)(scene, spp, seed % 4))
    assert case.verdict is Outcome.FAIL and "gave the same one" in case.reason


def test_a_renderer_that_crashes_fails_with_its_words():
    def render(scene, spp, seed):
        raise ZeroDivisionError("no light")

    case = judged(render)
    assert case.verdict is Outcome.FAIL and case.reason.startswith("ZeroDivisionError: no light (seed ")


class TestCommand:
    """The contract of --renderer."""

    def script(self, folder, body):
        path = folder / "my renderer.py"
        path.write_text(textwrap.dedent(body))
        return f'"{sys.executable}" "{path}"'

    def test_split(self):
        assert split_command("'a b' --x={spp} c\\ d", windows=False) == ["a b", "--x={spp}", "c d"]
        windows = r'"C:\My Tools\render.exe" {scene} -o {output} C:\new\table'
        assert split_command(windows, windows=True) == [
            r"C:\My Tools\render.exe", "{scene}", "-o", "{output}", r"C:\new\table",
        ]  # fmt: skip
        with pytest.raises(NotFound, match="cannot be split"):
            split_command("'open")

    def test_output_is_required(self):
        with pytest.raises(NotFound, match=r"no \{output\}"):
            Command.parse("render {scene}")

    def test_spaces_and_placeholders(self, tmp_path):
        folder = tmp_path / "with space"
        folder.mkdir()
        command = self.script(
            folder,
            """
            import sys, struct
            scene, out, rest = sys.argv[1:]
            assert scene.endswith("a scene.xml"), scene
            open(out, "wb").write(b"PF 1 1 -1\\n" + struct.pack("<3f", *map(float, rest.split("/"))))
            """,
        )
        scene = folder / "a scene.xml"
        scene.write_text("")
        made = Command.parse(command + " {scene} {output}.pfm {spp}/{seed}/3").render(scene, 7, 9, 10)
        assert made.image.pixels.tolist() == [[[7.0, 9.0, 3.0]]]
        assert made.seconds > 0

    @pytest.mark.parametrize(
        ("body", "words"),
        [
            (
                "import sys; print('first\\nno lamp', file=sys.stderr); sys.exit(7)",
                "exit status 7; it said: “first | no lamp”",
            ),
            ("pass", "exit status 0, but {output} was not written"),
            ("import sys; open(sys.argv[1], 'w').write('hello')", "not an image that can be read"),
            (
                "import sys; open(sys.argv[1], 'wb').write(b'PF 4 4 -1\\n123')",
                "3 bytes of pixels, 4×4 needs 192",
            ),
            ("import time; time.sleep(60)", "no image after 1 s"),
        ],
    )
    def test_plain_words(self, tmp_path, body, words):
        command = Command.parse(self.script(tmp_path, body) + " {output}")
        with pytest.raises(RenderError) as error:
            command.render(tmp_path, 1, 1, 1.0)
        assert words in str(error.value)

    def test_missing_program(self):
        with pytest.raises(NotFound, match="cannot be started"):
            raycheck.verify("/no/such/program {scene} {output}", [SCENE])

    def test_without_scene_one_scene_must_be_named(self):
        with pytest.raises(NotFound, match=r"no \{scene\}"):
            raycheck.verify("render {output}")

    def test_without_seed_and_spp(self, tmp_path):
        """A hard-coded renderer whose runs differ by themselves is judged; one whose runs agree is told."""
        program = f'"{sys.executable}" "{HERE / "pfm_renderer.py"}" {{output}} 1'
        case = judged(program + " 5", spp=None)
        assert case.verdict is Outcome.FAIL
        assert "without {seed} in the command runs must differ by themselves" in case.reason


class TestOtherRenderers:
    """Programs that share nothing with oneray or raycheck."""

    pfm = f'"{sys.executable}" "{HERE / "pfm_renderer.py"}" {{output}} {{spp}} {{seed}}'
    mitsuba = f'"{sys.executable}" "{HERE / "mitsuba_renderer.py"}" {{scene}} {{output}} {{spp}} {{seed}}'

    def test_plain_python_with_pfm(self):
        assert judged(self.pfm, spp=1).verdict is Outcome.PASS

    def test_plain_python_without_its_cosine(self):
        case = judged(self.pfm + " forget-cosine", spp=1)
        assert case.verdict is Outcome.FAIL
        assert "tiles differ" in case.reason

    def test_mitsuba(self):
        assert judged(self.mitsuba, "area-light", spp=16).verdict is not Outcome.FAIL

    def test_mitsuba_twice_too_bright(self):
        case = judged(self.mitsuba + " factor=2", "area-light")
        assert case.verdict is Outcome.FAIL
        assert "times as bright as it should be, a factor of 2" in case.reason
        assert case.images < 10

    @pytest.mark.parametrize(("depth", "fails"), [("10", False), ("9", True)])
    def test_mitsuba_depth(self, depth, fails):
        """One bounce less in the furnace; in this process, as a Python callable."""
        from mitsuba_renderer import render

        case = judged(lambda *a: render(*a, {"max_depth": depth}), "furnace", spp=32)
        assert (case.verdict is Outcome.FAIL) == fails


class TestImages:
    """Pictures that are already rendered."""

    def files(self, folder, mean, count, noise, spp=1, write=write_pfm, suffix=".pfm"):
        for index in range(count):
            write(folder / f"mine-{index}{suffix}", noisy(mean, noise)(None, spp, index))
        return str(folder / f"mine-*{suffix}")

    def test_many(self, truth, tmp_path):
        glob = self.files(tmp_path, truth, 70, 0.2)
        [case] = raycheck.verify(scenes=[SCENE], images=glob).cases
        assert case.verdict is Outcome.PASS

    @pytest.mark.parametrize("count", [1, 3, 40])
    def test_few(self, truth, tmp_path, count):
        glob = self.files(tmp_path, truth, count, 0.05)
        [case] = raycheck.verify(scenes=[SCENE], images=glob).cases
        assert case.verdict is Outcome.PASS
        assert "noise measured between pixels" in case.reason

    def test_a_single_noisy_one_says_how_many_more(self, truth, tmp_path):
        glob = self.files(tmp_path, truth, 1, 2.0)
        [case] = raycheck.verify(scenes=[SCENE], images=glob).cases
        assert case.verdict is Outcome.INCONCLUSIVE
        assert "from 1 image" in case.reason and "more images" in case.reason

    def test_a_single_wrong_one(self, truth, tmp_path):
        glob = self.files(tmp_path, truth[::-1], 1, 0.1)
        [case] = raycheck.verify(scenes=[SCENE], images=glob).cases
        assert case.verdict is Outcome.FAIL and "upside down" in case.reason

    def test_8_bit_never_passes(self, truth, tmp_path):
        def write(path, pixels):
            write_png(path, np.round(255 * encode_srgb(pixels)).astype(np.uint8))

        right = self.files(tmp_path, truth / truth.max(), 64, 0.1, write=write, suffix=".png")
        assert load_image(right.replace("*", "0")).precision == "8-bit"
        [case] = raycheck.verify(scenes=[SCENE], images=right).cases
        assert case.verdict is not Outcome.PASS

    def test_half(self, truth, tmp_path):
        def write(path, pixels):
            write_exr(path, {c: pixels[..., i] for i, c in enumerate("RGB")}, half=True)

        glob = self.files(tmp_path, truth, 64, 0.2, write=write, suffix=".exr")
        [case] = raycheck.verify(scenes=[SCENE], images=glob).cases
        assert case.verdict is Outcome.PASS and "half" in case.reason

    def test_no_match(self):
        with pytest.raises(NotFound, match="no file matches"):
            raycheck.verify(scenes=[SCENE], images="/no/such/*.exr")

    def test_copies_are_seen(self, truth, tmp_path):
        for index in range(3):
            write_pfm(tmp_path / f"mine-{index}.pfm", truth)
        [case] = raycheck.verify(scenes=[SCENE], images=str(tmp_path / "mine-*.pfm")).cases
        assert case.verdict is Outcome.FAIL and "identical" in case.reason


class TestRun:
    def test_json(self, truth):
        result = raycheck.verify(noisy(truth), [SCENE], spp=4)
        found = json.loads(result.to_json())
        assert {"raycheck", "machine", "totals", "cases"} <= found.keys()
        keys = "scene technique verdict bias bias_low bias_high mde_image mde_tile_p90 spp seconds reason"
        assert set(keys.split()) <= found["cases"][0].keys()

    @pytest.mark.parametrize(("outcomes", "status"), [("P", 0), ("PI", 3), ("PIF", 1), ("PF", 1), ("", 0)])
    def test_exit_status(self, outcomes, status):
        full = {o.value[0]: o for o in Outcome}
        cases = [raycheck.Case("s", "t", full[o], "") for o in outcomes]
        assert raycheck.Verification(cases).exit_status == status

    def test_unknown_scene_or_technique(self, tmp_path):
        with pytest.raises(ReferenceError_, match="no scene 'nowhere'; there are"):
            raycheck.verify(lambda *a: None, ["nowhere"])
        (tmp_path / "mine.xml").write_text("<scene/>")
        with pytest.raises(ReferenceError_, match=r"no reference for mine.*raycheck reference"):
            raycheck.verify(lambda *a: None, [tmp_path / "mine.xml"])
        with pytest.raises(NotFound, match="walk-cosine"):
            technique("walk")

    def test_scene_by_path(self, truth, scene):
        assert judged(noisy(truth), str(scene(SCENE))).scene == SCENE

    def test_techniques_fit_the_scenes(self, scene):
        names = {s: {t.name for t in applicable(read_content(scene(s)))} for s in variants.scene_names()}
        assert names["point-light"] == {"nee", "mis-power", "mis-sobol", "light"}
        assert "nee-uniform-choice" in names["many-lights"]
        assert "nee-uniform-choice" not in names["area-light"]
        assert set().union(*names.values()) == {t.name for t in TECHNIQUES}

    def test_oneray(self, oneray, monkeypatch):
        monkeypatch.setenv("ONERAY", str(oneray))
        [case] = raycheck.verify(scenes=["area-light"], techniques=["mis-power"], spp=16).cases
        assert case.verdict is not Outcome.FAIL

    @pytest.mark.parametrize("scene", [SCENE, "open-sky"])
    def test_sobol_points(self, oneray, monkeypatch, scene):
        """Judged by the spread between seeds; a plan of fewer samples than the pilot's, from which it cannot
        know the noise of fewer, is not followed.
        """
        monkeypatch.setenv("ONERAY", str(oneray))
        [case] = raycheck.verify(scenes=[scene], techniques=["mis-sobol"]).cases
        assert case.verdict is Outcome.PASS
        assert case.spp >= PILOT_SPP

    def test_resumed(self, truth, monkeypatch):
        """A verdict stands while renderer, settings and reference are the same, else it falls."""
        calls = []

        def counting(mean):
            return lambda scene, spp, seed: calls.append(seed) or noisy(mean)(scene, spp, seed)

        first = judged(counting(truth))
        assert len(calls) > 64
        calls.clear()
        assert judged(counting(truth), earlier=[first]) == first and len(calls) == 1
        assert judged(counting(1.03 * truth), earlier=[first]).verdict is Outcome.FAIL
        assert judged(counting(truth), earlier=[first], seed=1).fingerprint != first.fingerprint
        monkeypatch.setattr(judge_renderer, "METHOD", judge_renderer.METHOD + 1)
        assert judged(counting(truth), earlier=[first]).fingerprint != first.fingerprint

    def test_runs_without_oneray_and_mitsuba(self, tmp_path):
        """A student's machine: no compiler, no oneray, no Mitsuba."""
        program = """
import sys
sys.modules["mitsuba"] = None
import numpy as np
import raycheck.cli
from raycheck.truth import references

try:
    raycheck.verify()
except raycheck.NotFound as error:
    assert "--renderer" in str(error)
else:
    raise AssertionError("oneray was found")
mean = references.load_reference("point-light").best()[0]

def render(scene, spp, seed):
    return mean * np.random.default_rng(seed).gamma(25 * spp, 1 / (25 * spp), (64, 64, 1))

assert raycheck.verify(render, ["point-light"], spp=4).exit_status == 0
"""
        environment = {k: v for k, v in os.environ.items() if k != "ONERAY"} | {
            "ONERAY": str(tmp_path / "none")
        }
        done = subprocess.run(
            [sys.executable, "-c", program], env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
