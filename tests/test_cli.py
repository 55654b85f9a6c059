"""The command line of raycheck: exit statuses, tables in pipes, messages of one line."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from raycheck.base.images import write_exr, write_pfm

HERE = Path(__file__).parent
PFM = f'"{sys.executable}" "{HERE / "pfm_renderer.py"}" {{output}} {{spp}} {{seed}}'


def raycheck(*words):
    done = subprocess.run(
        [sys.executable, "-m", "raycheck", *map(str, words)],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
    )
    assert "Traceback" not in done.stderr
    return done


def test_bare_prints_the_commands_that_matter():
    done = raycheck()
    assert done.returncode == 0
    assert done.stdout.count("\n  raycheck ") == 5
    assert "--renderer" in done.stdout and "--images" in done.stdout and "compare A.exr B.exr" in done.stdout


def test_version_and_help():
    assert raycheck("--version").stdout.startswith("raycheck ")
    for command in ("verify", "compare", "report", "diagnose", "calibrate"):
        assert raycheck(command, "--help").returncode == 0


def test_verify_right_and_wrong(tmp_path):
    found = tmp_path / "found.json"
    done = raycheck("verify", "point-light", "--renderer", PFM, "--spp", 1, "--json", found)
    assert done.returncode == 0, done.stdout
    assert done.stderr == ""  # no progress bar in a pipe
    assert "PASS" in done.stdout and "would have been noticed" in done.stdout
    assert "Judged against closed forms: point-light." in done.stdout
    assert all(len(line) <= 140 for line in done.stdout.splitlines())
    assert json.loads(found.read_text())["cases"][0]["verdict"] == "PASS"

    done = raycheck("verify", "point-light", "--renderer", PFM + " forget-cosine", "--spp", 1)
    assert done.returncode == 1
    assert "FAIL" in done.stdout and "tiles differ, most of all rows" in done.stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["verify", "nowhere"], "raycheck: no scene 'nowhere'; there are"),
        (["verify", "--renderer", "render"], "raycheck: the renderer command has no {output}"),
        (["verify", "--renderer", "render {output}"], "raycheck: the renderer command has no {scene}"),
        (["verify", "point-light", "--images", "/none/*"], "raycheck: --images '/none/*': no file matches"),
        (["verify", "--images", "x"], "raycheck: --images needs one SCENE"),
        (["verify", "point-light", "--renderer", "/none {output}"], "raycheck: /none: cannot be started"),
        (
            ["verify", "--technique", "nee", "--renderer", "x {output} {scene}"],
            "raycheck: --technique chooses among",
        ),
        (["verify", "--json", "/no/such/folder/x.json"], "raycheck: /no/such/folder/x.json"),
        (["verify", "--junit", "/no/such/folder/x.xml"], "raycheck: /no/such/folder/x.xml"),
        (["verify", "--thorough", "--seconds", "5"], "raycheck: --seconds is the budget of a quick run"),
        (["diagnose"], "raycheck: diagnose needs either IMAGE files or --renderer CMD"),
        (["diagnose", "/none.pfm"], "raycheck: /none.pfm: No such file"),
        (["calibrate", "mutants", "nobody"], "raycheck: there is no mutant nobody"),
        (["compare", "/none.exr", "/none.exr"], "raycheck: /none.exr: No such file"),
        (["report", "--verification", "/none.json"], "raycheck: /none.json"),
    ],
)
def test_what_cannot_run_says_so_in_a_line(words, message):
    done = raycheck(*words)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith(message)
    assert done.stderr.count("\n") == 1


class TestCompare:
    def image(self, path, mean, error=0.02, seed=1, stderr=True):
        pixels = mean + error * np.random.default_rng(seed).standard_normal((32, 32, 3))
        channels = {c: pixels[..., i] for i, c in enumerate("RGB")}
        if stderr:
            channels |= {f"stderr.{c}": np.full((32, 32), error) for c in "RGB"}
        write_exr(path, channels)
        return path

    def test_same(self, tmp_path):
        a, b = self.image(tmp_path / "a b.exr", 0.5), self.image(tmp_path / "b.exr", 0.5, seed=2)
        done = raycheck("compare", a, b, "--json", tmp_path / "x.json")
        assert done.returncode == 0
        assert done.stdout.startswith("PASS the same")
        assert json.loads((tmp_path / "x.json").read_text())["verdict"] == "PASS"

    def test_different(self, tmp_path):
        other = np.full((32, 32, 1), 0.5)
        other[8:16, 24:] *= 1.1
        a, b = self.image(tmp_path / "a.exr", 0.5), self.image(tmp_path / "b.exr", other, seed=2)
        done = raycheck("compare", a, b)
        assert done.returncode == 1
        assert "rows 8–15, columns 24–31" in done.stdout

    def test_too_noisy(self, tmp_path):
        a, b = (self.image(tmp_path / f"{s}.exr", 0.5, error=0.4, seed=s) for s in (1, 2))
        done = raycheck("compare", a, b)
        assert done.returncode == 3
        assert "too noisy to say" in done.stdout

    def test_without_standard_errors(self, tmp_path):
        a, b = self.image(tmp_path / "a.exr", 0.5), self.image(tmp_path / "b.exr", 0.5, stderr=False)
        done = raycheck("compare", a, b)
        assert done.returncode == 2
        assert "b.exr: no channels stderr.R, stderr.G, stderr.B" in done.stderr
        write_pfm(tmp_path / "c.pfm", np.ones((32, 32, 3)))
        assert raycheck("compare", a, tmp_path / "c.pfm").returncode == 2

    def test_sobol_points(self, tmp_path, oneray):
        """They have no standard errors by design: the line says so, and what to do."""
        a, b = tmp_path / "a.exr", self.image(tmp_path / "b.exr", 0.5)
        scene = HERE.parent / "scenes/furnace.xml"
        subprocess.run([oneray, scene, "-o", a, "--spp", "4", "--sampler", "sobol"], check=True)
        done = raycheck("compare", b, a)
        assert done.returncode == 2 and done.stderr.count("\n") == 1
        assert "a.exr: made with --sampler sobol, whose noise only other seeds show" in done.stderr

    def test_other_size(self, tmp_path):
        a = self.image(tmp_path / "a.exr", 0.5)
        channels = {f"{p}{c}": np.ones((4, 4)) for p in ("", "stderr.") for c in "RGB"}
        write_exr(tmp_path / "b.exr", channels)
        done = raycheck("compare", a, tmp_path / "b.exr")
        assert done.returncode == 1
        assert "4×4 pixels, the scene asks for 32×32" in done.stdout
