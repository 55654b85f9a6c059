"""What is judged against: closed forms before references, and references that belong to their scene."""

import json
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from raycheck.base.errors import ReferenceError_
from raycheck.scene.variants import Variant, scene_hash
from raycheck.stats.tiles import Tile
from raycheck.truth import making, references
from raycheck.truth.expected import truth_of
from raycheck.truth.references import CHANNELS, Reference

RNG = np.random.default_rng(1)
MEAN, VARIANCE = RNG.uniform(1, 2, (8, 16, 3)), RNG.uniform(1, 2, (8, 16, 3))


def reference(known: int) -> Reference:
    """With a closed form of 3 in the first columns, 64 batches of 256 samples."""
    exact = np.full(MEAN.shape, np.nan)
    exact[:, :known] = 3.0
    return Reference("a", {}, MEAN, VARIANCE, 64, 256, {}, {8: np.zeros((1, 2, 3))}, exact)


def test_a_closed_form_outranks_the_reference_where_it_is_known() -> None:
    truth = truth_of(reference(4))
    for mean, variance in (reference(4).best(), (truth.mean, truth.variance)):
        assert np.all(mean[:, :4] == 3) and np.all(variance[:, :4] == 0)
        assert np.all(mean[:, 4:] == MEAN[:, 4:]) and np.all(variance[:, 4:] == VARIANCE[:, 4:])
    assert [truth_of(reference(known)).closed_form for known in (1, 14, 15, 16)] == [False, False, True, True]


def test_a_sample_is_as_noisy_as_all_samples_make_it() -> None:
    """The variance of a mean of 64 · 256 samples; a batch of 4 has a quarter of a sample's."""
    truth = truth_of(reference(4))
    np.testing.assert_allclose(truth.sample_variance, VARIANCE * 64 * 256)
    [one] = truth.expected([Tile(0, 8, 8, 8)], 4).batch_variance
    np.testing.assert_allclose(one, VARIANCE[:, 8:].sum(axis=(0, 1)) / 64**2 * 64 * 256 / 4)
    [mean] = truth.expected([Tile(0, 8, 8, 8)], 4).variance
    np.testing.assert_allclose(mean, VARIANCE[:, 8:].sum(axis=(0, 1)) / 64**2)


# ---- files ----


@pytest.fixture
def scene(tmp_path: Path) -> Variant:
    """A scene of one's own with its reference."""
    of = Variant(tmp_path / "mine.xml")
    of.path.write_text('<scene version="3.0.0"/>', encoding="utf-8")
    entry = {"hash": scene_hash(of.path), "height": 8, "width": 16, "batches": 64, "spp": 256, "skewness": {}}
    references.write_reference(of, MEAN, VARIANCE, entry)
    return of


def test_a_reference_is_read_back(scene: Variant) -> None:
    found = references.load_reference(scene)
    np.testing.assert_allclose(found.mean, MEAN, rtol=1e-6)
    np.testing.assert_allclose(found.variance_of_mean, VARIANCE, rtol=1e-6)
    assert (found.batches, found.spp_per_batch, found.closed_form) == (64, 256, None)


def test_a_changed_scene_makes_it_stale(scene: Variant) -> None:
    assert references.is_fresh(scene)
    scene.path.write_text('<scene version="3.0.0"> </scene>', encoding="utf-8")
    assert not references.is_fresh(scene)
    with pytest.raises(ReferenceError_, match="mine is stale"):
        references.load_reference(scene)


def test_an_entry_without_its_picture_is_no_reference(scene: Variant) -> None:
    (scene.folder / "mine.exr").unlink()
    with pytest.raises(ReferenceError_, match="no reference for mine"):
        references.load_reference(scene)


def test_a_picture_of_another_size_is_no_reference(scene: Variant) -> None:
    listing = scene.folder / "manifest.json"
    listing.write_text(listing.read_text().replace('"width": 16', '"width": 8'), encoding="utf-8")
    assert json.loads(listing.read_text())["mine"]["width"] == 8
    with pytest.raises(ReferenceError_, match="not the image that the manifest describes"):
        references.load_reference(scene)


def test_channels_go_by_their_names(scene: Variant) -> None:
    """Whatever else is in the file, and wherever."""
    names = ["alpha", *CHANNELS]
    pixels = np.concatenate([np.zeros((8, 16, 1)), MEAN, VARIANCE], axis=-1).astype(np.float32)
    path = scene.folder / "mine.exr"
    spec = oiio.ImageSpec(16, 8, 7, oiio.FLOAT)
    spec.channelnames = names
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), spec) and file.write_image(pixels) and file.close()
    np.testing.assert_allclose(references.read_exr(path), pixels[..., 1:])


def test_a_variant_has_a_closed_form_of_its_own_and_nobody_changes_it_for_others() -> None:
    shallow, deep = references.closed_form("furnace", {"depth": "2"}), references.closed_form("furnace")
    assert shallow is not None and deep is not None and not np.allclose(shallow, deep, equal_nan=True)
    kept = deep.copy()
    deep[:] = 0
    again = references.closed_form("furnace")
    assert again is not None and np.array_equal(again, kept, equal_nan=True)


# ---- making ----


def test_batches_are_averaged_with_the_variance_of_their_mean() -> None:
    images = RNG.random((5, 8, 16, 3))
    mean, variance, count = making.accumulate(iter(images))
    np.testing.assert_allclose(mean, images.mean(axis=0))
    np.testing.assert_allclose(variance, images.var(axis=0, ddof=1) / 5)
    assert count == 5


def test_skewness_is_that_of_one_sample() -> None:
    """One batch of four is bright: (1 − 2p)/√(p(1 − p)) = 1.155, a third of it of 9 samples."""
    images = np.repeat([1.0, 0.0, 0.0, 0.0], 8)[:, None, None, None] * np.ones((8, 8, 3))
    assert making.skewness_tables(images, 9)[8] == [[[3.464] * 3]]


def test_a_third_of_the_error_takes_nine_times_the_samples() -> None:
    """Batches of 4 samples whose image has an error of 1 %."""
    images = np.repeat([0.99, 1.01], 8)[:, None, None, None] * np.ones((8, 8, 3))
    for share in (1, 3):
        goal = making.Goal(image=0.01 / share, tile=1.0)
        assert making.samples_needed(images, 4, goal, checked=False) == pytest.approx(4 * share**2, abs=1)


def test_errors_of_a_reference() -> None:
    """256 pixels of mean 2 and variance 4: 1/16 of the image, 1/8 of a tile of 64."""
    shape = (16, 16, 3)
    found = making.relative_errors(np.full(shape, 2.0), np.full(shape, 4.0))
    assert found == pytest.approx((1 / 16, 1 / 8))
