"""The page docs/judge-pictures.md says what happens, and how many more pictures would decide is right."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

import raycheck
from raycheck.base.images import Image
from raycheck.judging.judge_images import images_needed, judge_pictures
from raycheck.scene.variants import variant
from raycheck.stats.verdict import Limits, Outcome
from raycheck.truth import references
from raycheck.truth.expected import truth_of

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/judge-pictures.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory, oneray: Path) -> Path:
    folder = tmp_path_factory.mktemp("pictures")
    pictures = [(16, seed, folder / f"mine-{seed}.exr") for seed in range(1, 65)]
    for spp, seed, path in (*pictures, (256, 1, folder / "one.exr")):
        options = ("-o", path, "--spp", spp, "--seed", seed, "--quiet")
        subprocess.run([oneray, ROOT / "scenes/area-light.xml", *map(str, options)], check=True)
    (folder / "same-1.exr").write_bytes((folder / "one.exr").read_bytes())
    (folder / "same-2.exr").write_bytes((folder / "one.exr").read_bytes())
    return folder


@pytest.mark.parametrize(("index", "glob"), [(0, "mine-*.exr"), (1, "same-*.exr"), (2, "one.exr")])
def test_the_page_says_what_is_found(rendered: Path, index: int, glob: str) -> None:
    verdict, reason = re.findall(r"^    area-light, images: (\w+) (.*)\.$", PAGE, re.MULTILINE)[index]
    [case] = raycheck.verify(scenes="area-light", images=str(rendered / glob)).cases
    assert (case.verdict.value, case.reason[:1].upper() + case.reason[1:]) == (verdict, reason)


@pytest.mark.parametrize("name", ["area-light", "furnace", "spherical-light"])
@pytest.mark.parametrize("count", [1, 2, 4, 8, 40])
def test_so_many_more_pictures_decide_and_half_of_them_do_not(name: str, count: int) -> None:
    of = variant(name)
    truth = truth_of(references.load_reference(of))
    deviation = np.sqrt(truth.sample_variance / 24)

    def images(number: int) -> list[Image]:
        rng = np.random.default_rng(7)
        return [Image(truth.mean + deviation * rng.standard_normal(truth.mean.shape)) for _ in range(number)]

    def judged(number: int) -> Outcome:
        return judge_pictures(of, images(number), [str(i) for i in range(number)], Limits()).verdict

    residuals = np.stack([image.pixels for image in images(count)]) - truth.mean
    needed = images_needed(residuals, truth, Limits())
    assert needed and needed > count
    assert judged(2 * needed) is Outcome.PASS
    assert needed // 2 <= count or judged(needed // 2) is Outcome.INCONCLUSIVE
