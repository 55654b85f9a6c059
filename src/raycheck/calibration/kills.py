"""Kill rate: what raycheck and the other rules say of programs with one mistake each, on the same images.

Each is judged on the scene and with the technique that its patch names. The same mistake is then weakened:
the images are mixed with those of the correct program from the same seeds, which gives any size of effect.
"""

import functools
import json
import platform
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from raycheck.base.arrays import Array
from raycheck.base.errors import NotFound
from raycheck.calibration import checkout, mutants, rivals, trials
from raycheck.calibration.checkout import Checkout
from raycheck.calibration.lines import append_lines, read_lines
from raycheck.calibration.mutants import Mutant
from raycheck.judging.settings import PILOT_IMAGES
from raycheck.renderers import workers
from raycheck.renderers.pools import Pool
from raycheck.stats.tiles import region_means
from raycheck.truth import provenance
from raycheck.truth.expected import Truth

METHOD = 1
"""Version of how mistakes are judged, see truth.provenance."""
SPP = 8
MIXES = tuple(4.0**-k for k in range(1, 9))
WEAKEST, STRONGEST = 0.1, 16.0
"""Effects of mixed images, in detectable biases, that say anything."""
CLASSES = ((0.0, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 4.0), (4.0, np.inf))
"""Effects by which the kill rate is told, in detectable biases of the tile where it shows."""


@dataclass(frozen=True)
class Kill:
    """The verdicts on one mistake at one strength."""

    name: str
    kind: str
    """"mistake", "variant" or "equivalent"."""
    strength: float
    """1, or the share of the mistake's image in a mixture."""
    effect: float | None
    """Largest bias of a region over what is noticed there with 90 % probability; None without images."""
    rejected: dict[str, bool]
    """Whether each rule rejects it."""
    reason: str
    digest: str
    """Digest of the pictures and the method: what has it need not be judged again."""


def kind(mutant: Mutant) -> str:
    return "equivalent" if mutant.equivalent else "variant" if mutant.variant else "mistake"


def rests_on(mutant: Mutant) -> list[str]:
    """The pictures that are judged, the correct ones, and the reference."""
    return [f"mutant {mutant.name}", f"{mutant.scene} {mutant.shows} double", f"reference {mutant.scene}"]


def digest(mutant: Mutant) -> str:
    return provenance.digest(METHOD, rests_on(mutant))


def judge_mutant(mutant: Mutant, program: Path, correct: Path, truth: Truth) -> list[Kill]:
    """The mistake as it is, and weakened."""

    def kill(strength: float, effect: float | None, rejected: dict[str, bool], reason: str = "") -> Kill:
        return Kill(mutant.name, kind(mutant), strength, effect, rejected, reason, digest(mutant))

    trial = trials.try_program(trials.Program(program, mutant.shows), mutant.scene, truth, SPP)
    if trial.images is None or trial.pilot_images is None:
        return [kill(1.0, None, dict.fromkeys(rivals.NAMES, True), trial.reason)]
    right = _images(correct, mutant.scene, mutant.shows, tuple(trial.requests))
    pilot, images = right[1 : 1 + PILOT_IMAGES], right[1 + PILOT_IMAGES :]
    found = [kill(1.0, _effect(images, pilot, trial.images, truth), trial.rejected, trial.reason)]
    if mutant.equivalent:
        return found
    for mix in MIXES:
        effect = mix * (found[0].effect or 0.0)
        if WEAKEST <= effect <= STRONGEST:
            mixed = images + mix * (trial.images - images)
            mixed_pilot = pilot + mix * (trial.pilot_images - pilot)
            fails = trials.judge_images(mixed, mixed_pilot, truth, SPP).fails
            found.append(kill(mix, effect, {"raycheck": fails, **rivals.judge(mixed, SPP, truth)}))
    return found


@functools.lru_cache(maxsize=2)
def _images(program: Path, scene: str, shows: str, requests: tuple[tuple[int, int], ...]) -> Array:
    return trials.Program(program, shows).images(scene, requests)


def _effect(images: Array, pilot: Array, broken: Array, truth: Truth) -> float:
    """The largest bias over what is noticed, from images of the same seeds: their noise is nearly the same,
    and what is left is the mistake.
    """
    sets = trials.judge_images(images, pilot, truth, SPP)
    bias = np.abs(region_means((broken - images).mean(axis=0)[None], sets.regions)[0])
    mde = sets.detectable()
    return float(np.max(np.where(mde > 0, bias / np.where(mde > 0, mde, 1.0), np.where(bias > 0, np.inf, 0))))


def one_mutant(name: str, program: str, build: Checkout) -> bytes:
    """`judge_mutant` as JSON: a piece of `measure_kills`. `program` names the mutant's program."""
    checkout.require(build)
    mutant = mutants.read(mutants.FOLDER / f"{name}.patch")
    if mutants.program_path(mutant).parent.name != program:
        raise NotFound(f"{mutant.patch} on {platform.node()} is another patch: the same checkout is needed")
    truth = trials.load_truth(mutant.scene)
    found = judge_mutant(mutant, mutants.program(mutant), mutants.program(None), truth)
    return json.dumps([asdict(one) for one in found]).encode()


def measure_kills(file: Path, wanted: Sequence[Mutant], pool: Pool | None = None) -> Iterator[list[Kill]]:
    """What `file` has of the same pictures is kept, the others are added to it as they come."""
    done = {(line["name"], line["digest"]) for line in read_lines(file)}
    build = checkout.of_checkout()
    pieces = [
        (mutant.name, mutants.program_path(mutant).parent.name, build)
        for mutant in sorted(wanted, key=_images_of)
        if (mutant.name, digest(mutant)) not in done
    ]
    for _, data in workers.run(pool, one_mutant, pieces):
        found = json.loads(data)
        append_lines(file, found)
        yield [Kill(**one) for one in found]


def _images_of(mutant: Mutant) -> tuple[str, str]:
    """Mutants that are compared with the same correct images come one after another."""
    return mutant.scene, mutant.shows


def summary(file: Path, wanted: Sequence[Mutant]) -> dict[str, object]:
    """Kill rates by rule, as they are and by effect; the survivors; what is said of equivalents."""
    current = {mutant.name: digest(mutant) for mutant in wanted}
    lines = [line for line in read_lines(file) if line["digest"] == current.get(line["name"])]
    lines.sort(key=lambda line: (line["name"], line["strength"]))
    whole = [line for line in lines if line["strength"] == 1]
    broken = [line for line in whole if line["kind"] != "equivalent"]
    right = [line for line in whole if line["kind"] == "equivalent"]
    by_effect = []
    for low, high in CLASSES:
        these = [x for x in lines if x["effect"] is not None and low <= x["effect"] < high]
        these = [x for x in these if x["kind"] != "equivalent" and x["effect"] > 0]
        killed = {rule: sum(x["rejected"][rule] for x in these) for rule in rivals.NAMES}
        by_effect.append({"from": low, "to": high if high < np.inf else None, "of": len(these)} | killed)
    rests = {picture for mutant in wanted for picture in rests_on(mutant)}
    return {
        "provenance": provenance.provenance(METHOD, rests),
        "spp": 64 * SPP,
        "mutants": len(whole),
        "not_equivalent": len(broken),
        "killed": {rule: sum(line["rejected"][rule] for line in broken) for rule in rivals.NAMES},
        "equivalent": len(right),
        "equivalent_rejected": {rule: sum(line["rejected"][rule] for line in right) for rule in rivals.NAMES},
        "by_effect": by_effect,
        "survivors": {
            line["name"]: None if line["effect"] is None else round(line["effect"], 3)
            for line in broken
            if not line["rejected"]["raycheck"]
        },
    }
