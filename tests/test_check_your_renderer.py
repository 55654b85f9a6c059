"""The page docs/check-your-renderer.md does what it says: its programs write, its commands print, its
examples run.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from junitparser import JUnitXml
from test_pytest_plugin import plugin_words

from raycheck.base.images import load_image, write_pfm
from raycheck.judging.settings import PILOT_SPP, case_seeds
from raycheck.truth import references

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/check-your-renderer.md").read_text(encoding="utf-8")
NUMBERS = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12.5]

CPP_MAIN = """
int main(int, char **words)
{
    return !write_pfm(words[1], 2, 2, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12.5});
}
"""
RUST_MAIN = """
fn main() -> Result<()> {
    let path = std::env::args().nth(1).unwrap();
    write_pfm(&path, 2, 2, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.5])
}
"""
PYTHON_MAIN = f"""
import sys
write_pfm(sys.argv[1], 2, 2, {NUMBERS})
"""
MINE = """
import numpy as np
from raycheck.truth import references


def render(scene, spp, seed):
    mean = references.load_reference(scene.stem).best()[0]
    return mean * np.random.default_rng(seed).gamma(4 * spp, 1 / (4 * spp), (*mean.shape[:2], 1))
"""


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def written(command: list[str], folder: Path) -> list[float]:
    """What the program wrote, read back, row by row from the top."""
    subprocess.run([*command, folder / "out.pfm"], check=True)
    return load_image(folder / "out.pfm").pixels.ravel().tolist()


class TestPfmWriters:
    def test_cpp(self, tmp_path):
        (tmp_path / "main.cpp").write_text(blocks("cpp")[0] + CPP_MAIN)
        words = ["c++", "-Wall", "-Wextra", "-Werror", "-o", tmp_path / "a.out", tmp_path / "main.cpp"]
        subprocess.run(words, check=True)
        assert written([tmp_path / "a.out"], tmp_path) == NUMBERS

    @pytest.mark.skipif(not shutil.which("rustc"), reason="rustc is not installed")
    def test_rust(self, tmp_path):
        (tmp_path / "main.rs").write_text(blocks("rust")[0] + RUST_MAIN)
        subprocess.run(
            ["rustc", "-D", "warnings", "-o", tmp_path / "a.out", tmp_path / "main.rs"], check=True
        )
        assert written([tmp_path / "a.out"], tmp_path) == NUMBERS

    def test_python(self, tmp_path):
        (tmp_path / "main.py").write_text(blocks("python")[0] + PYTHON_MAIN)
        assert written([sys.executable, tmp_path / "main.py"], tmp_path) == NUMBERS


def shown() -> list[tuple[str, str]]:
    """The page's commands and what they print."""
    return re.findall(r"^    \$ (raycheck .*)\n((?:    .*\n|\n)+)", PAGE, re.MULTILINE)


def plain(text: str) -> str:
    """Without seconds, which differ, and without the table's spaces, which go with their width."""
    text = re.sub(r"\d+(\.\d+)? (s|minutes)\b", "TIME", text)
    return re.sub(r"[ \n]+", " ", re.sub(r"\d+\.\d$", "TIME", text, flags=re.MULTILINE)).strip()


@pytest.mark.parametrize(("index", "status"), [(0, 0), (1, 1), (2, 0)])
def test_outputs(index, status, oneray):
    """Passing, failing and skipping, as printed on the page."""
    command, output = shown()[index]
    words = command.replace("raycheck", f"{sys.executable} -m raycheck", 1).replace(
        '"python', f'"{sys.executable}'
    )
    done = subprocess.run(words, shell=True, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == status, done.stderr
    assert plain(done.stdout) == plain(output)


def test_pytest_example(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "test_mine.py").write_text(blocks("python")[1])
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", tmp_path, tmp_path]
    words += plugin_words()

    def tested(*more):
        done = subprocess.run([*words, *more], cwd=tmp_path, capture_output=True, text=True)
        return done.stdout + done.stderr

    assert "2 skipped" in tested()
    assert "2 passed" in tested("--raycheck")
    (tmp_path / "mine.py").write_text(MINE.replace("return mean", "return 1.05 * mean"))
    output = tested("--raycheck")
    assert "2 failed" in output and "too bright" in output


def prerender(scene: str, factor: float, folder: Path) -> None:
    """SCENE-SPP-SEED.pfm, all that verify will ask for with --spp 8."""
    reference = references.load_reference(scene)
    mean = factor * reference.best()[0]
    first, count = reference.entry["seeds"]
    seeds = case_seeds(scene, "renderer", 0, range(first, first + count))
    for spp, some in ((1, seeds[:1]), (PILOT_SPP, seeds[1:]), (8, seeds[1:])):
        for seed in some:
            noise = np.random.default_rng(seed).gamma(4 * spp, 1 / (4 * spp), (*mean.shape[:2], 1))
            write_pfm(folder / f"{scene}-{spp}-{seed}.pfm", mean * noise)


def action(tmp_path, factors, **inputs):
    """Runs the verify step of action.yml as the workflow on the page does, as a shell on GitHub would."""
    workflow = yaml.safe_load(blocks("yaml")[0])
    [asked] = [s["with"] for s in workflow["jobs"]["verify"]["steps"] if s.get("uses") == "./raycheck"]
    whole = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    assert set(asked) <= set(whole["inputs"])
    given = {name: one.get("default") for name, one in whole["inputs"].items()} | asked | inputs
    [step] = [s for s in whole["runs"]["steps"] if s.get("id") == "verify"]
    environment = {
        name: str(given[re.fullmatch(r"\$\{\{ inputs\.(.*) \}\}", value)[1]])
        for name, value in step["env"].items()
    }
    for scene, factor in factors.items():
        prerender(scene, factor, tmp_path)
    (tmp_path / "mine").write_text("""#!/bin/sh
scene=$(basename "$1" .xml)
file=$scene-$3-$5.pfm
[ -f "$file" ] || file=$(ls "$scene-8-"* | head -1)  # others are rendered for their time alone
cp "$file" "$7"
""")
    (tmp_path / "mine").chmod(0o755)
    script = step["run"].replace("raycheck verify", f'"{sys.executable}" -m raycheck verify', 1)
    script = script.replace('--seconds "$BUDGET"', "--spp 8")  # decided by samples: the same everywhere
    files = {name: str(tmp_path / name) for name in ("GITHUB_STEP_SUMMARY", "GITHUB_OUTPUT")}
    words = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script]
    done = subprocess.run(
        words, cwd=tmp_path, env=os.environ | environment | files, capture_output=True, text=True
    )
    summary = tmp_path / "GITHUB_STEP_SUMMARY"
    said = summary.read_text(encoding="utf-8") if summary.exists() else ""
    return done, said, (tmp_path / "GITHUB_OUTPUT").read_text()


def test_workflow_example(tmp_path):
    """On a renderer that is right on one scene of two."""
    done, summary, output = action(tmp_path, {"point-light": 1, "area-light": 2})
    assert (done.returncode, output) == (1, "status=1\n"), done.stdout + done.stderr
    assert "| point-light | renderer | PASS |" in summary
    assert "| area-light | renderer | **FAIL** |" in summary
    assert "- **area-light**: " in summary and "a factor of 2" in summary
    results = tmp_path / "raycheck-results"
    [suite] = JUnitXml.fromfile(str(results / "raycheck.xml"))
    found = {case.classname: case for case in suite}
    assert found["point-light"].is_passed and found["area-light"].is_failure
    assert (results / "index.html").is_file()
    assert (results / "pictures/area-light-renderer-error.png").is_file()


@pytest.mark.parametrize(("inconclusive", "status"), [("pass", 0), ("fail", 3)])
def test_inconclusive_on_github(tmp_path, inconclusive, status):
    own = {"scenes": "point-light", "inconclusive": inconclusive, "options": "--delta 0.0001"}
    done, _, output = action(tmp_path, {"point-light": 1}, **own)
    assert (done.returncode, output) == (status, "status=3\n"), done.stdout + done.stderr


def test_a_command_that_is_wrong_on_github(tmp_path):
    done, summary, output = action(tmp_path, {}, renderer="./mine")
    assert (done.returncode, summary, output) == (2, "", "status=2\n")


def test_githubs_schemas(tmp_path):
    """The action, and the workflow on the page."""
    (tmp_path / "workflow.yml").write_text(blocks("yaml")[0])
    broken = (ROOT / "action.yml").read_text(encoding="utf-8").replace("using: composite", "using: nothing")
    (tmp_path / "action.yml").write_text(broken)
    check = [sys.executable, "-m", "check_jsonschema", "--builtin-schema"]
    for schema, file, right in (
        ("vendor.github-actions", ROOT / "action.yml", True),
        ("vendor.github-actions", tmp_path / "action.yml", False),
        ("vendor.github-workflows", tmp_path / "workflow.yml", True),
    ):
        done = subprocess.run([*check, schema, file], capture_output=True, text=True)
        assert (done.returncode == 0) == right, done.stdout + done.stderr


def test_nothing_is_left_of_the_template():
    assert np.all([word not in PAGE for word in ("PASSING", "FAILING")])
