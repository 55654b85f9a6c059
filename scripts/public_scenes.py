"""Scene files that people have published: does oneray render them as they are, and what Mitsuba renders?

    python scripts/public_scenes.py LIST FOLDER [--check] [--json FILE]

LIST has a line for each file, its repository and its path with a tab between; the files are in FOLDER, as
OWNER+NAME/PATH. `oneray --check` reads each as it is. What has no errors is rendered by oneray and by Mitsuba
(pip install mitsuba) from one copy with a small film of box-filtered pixels, and `raycheck compare` judges
the two, with more samples until it would see a bias of 1 % of the image, or the time for a file is up. What
the JSON file has a verdict of is not rendered again, but for what is UNDECIDED. Where pictures differ and
oneray warns that surfaces in one place face the same way, a renderer may show either: the file is ILL-POSED.
Exit status 1 if another picture differs.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from raycheck.base.errors import PlainError
from raycheck.base.files import write_whole
from raycheck.base.images import write_exr
from raycheck.base.machine import machine, raycheck_version
from raycheck.judging.compare import Comparison, compare
from raycheck.measuring.contestants import Mitsuba
from raycheck.renderers.oneray import oneray_path
from raycheck.scene import document
from raycheck.scene.document import Element
from raycheck.scene.variants import Variant
from raycheck.stats.verdict import Outcome
from raycheck.truth.mitsuba import choose_variant

PIXELS = 24 * 24
"""About so many has a small film."""
BATCHES = 16
MOST_SAID = 3
"""Errors of no kind that are kept of a file."""
DETECTABLE = 0.01
"""A PASS is one where a bias of this share of the image would be seen."""
KINDS = ("materials", "textures", "environment", "media", "missing files", "other plugins", "other")
TAGS = {"bsdf": "materials", "texture": "textures", "medium": "media", "volume": "media", "phase": "media"}
LACKED = re.compile(
    r"<(shape|emitter|integrator|sensor|film|rfilter|subsurface|spectrum)\b[^>]*> "
    r"(is not supported|needs|weighs)"
    r"|<scene> needs a <sensor|<ref [^>]*>: that is a <shape>"
)
"""One of the other plugins of Mitsuba is not here."""
EITHER = b"are in one place, face the same way and differ"
"""What oneray warns of where it depends on the renderer which surface is seen."""
RULE = """\
Whole scenes (a sensor and a shape, included files counted) whose files are all there, well formed, of
plugins and properties that Mitsuba 0.6, 2 or 3 has; of version 2 on, those that Mitsuba 3.9.1 loads; of equal
ones one; of a repository the first 25 by path. Of the repositories that were looked at, 318 more are whole,
but lack meshes or textures."""
"""What stands in references/public_scenes.tsv."""
MITSUBAS = ("path", "direct", "volpath", "volpathmis", "prb", "prbvolpath")
"""Integrators that it has, whose properties it knows."""
SKIES = ("envmap", "sunsky", "sky", "sun")


def kind_of(error: str, elements: dict[str, list[Element]]) -> str:
    """Which of KINDS an error of oneray is: by the element that it names, else by those in its line."""
    place, _, text = error.partition(": ")
    if "No such file" in error or "there is no such folder" in error:
        return "missing files"
    named = re.match(r'<(\w+)(?: type="([^"]*)")?>', text)
    meant = re.search(r"that is a <(\w+)>, and", text)
    if meant and meant[1] in TAGS:
        return TAGS[meant[1]]
    if named and named[1] != "ref":
        around = [Element(named[1], type=named[2] or "")]
    else:
        around = elements.get(place, [])
    for element in around:
        if element.tag in TAGS:
            return TAGS[element.tag]
        if element.tag == "spectrum" and element.get("type") == "bitmap":
            return "textures"
        if element.tag == "emitter" and element.get("type") in SKIES:
            return "environment"
    return "other plugins" if LACKED.match(text) else "other"


def elements_by_place(path: Path) -> dict[str, list[Element]]:
    """What stands in each line, FILE:LINE, and around it; nothing of a file that cannot be read."""
    found: dict[str, list[Element]] = {}

    def add(element: Element, around: list[Element]) -> None:
        found.setdefault(document.place(element), []).extend([element, *around])
        for child in element:
            add(child, [element, *around])

    try:
        root = document.read(path).root
    except PlainError:
        return {}
    add(root, [])
    return found


def check(path: Path, timeout: float) -> dict[str, Any]:
    """What `oneray --check` says of a file."""
    command = [str(oneray_path()), str(path), "--check"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=timeout)
    except subprocess.TimeoutExpired:
        return {"errors": {"other": 1}, "other": [f"no answer in {timeout:.0f} s"], "warnings": 0}
    lines = [line.replace(str(path.parent) + "/", "") for line in done.stderr.splitlines()]
    warnings = [line for line in lines if line.startswith("oneray: warning: ")]
    if not done.returncode:
        return {"errors": {}, "other": [], "warnings": len(warnings)}
    elements = {place.replace(str(path.parent) + "/", ""): e for place, e in elements_by_place(path).items()}
    said = [line for line in lines if line not in warnings]
    kinds = [kind_of(line, elements) for line in said]
    other = [line for line, kind in zip(said, kinds, strict=True) if kind == "other"]
    return {"errors": dict(Counter(kinds)), "other": other[:MOST_SAID], "warnings": len(warnings)}


def small(path: Path, to: Path) -> None:
    """A copy of a scene file with a small film, in Mitsuba's words, that names its files where they are."""
    document.write(document.read(path).moved(lambda file: str(file.resolve())), to)
    root = document.read(to).resolved()
    outer = root.find("integrator")
    inner = document.integrator(outer)
    if outer is not None:
        root.remove(outer)
    if inner is None or inner.get("type") not in MITSUBAS:
        said = () if inner is None else inner
        inner = Element("integrator", type="path")
        inner.extend(c for c in said if c.get("name") in ("max_depth", "rr_depth", "hide_emitters"))
    for child in inner.findall("./*[@name='strict_normals']"):
        inner.remove(child)
    root.insert(0, inner)
    for spectrum in root.iter("spectrum"):
        if (
            ":" not in spectrum.get("value", ":")
            and len(re.findall(r"[^ ,]+", spectrum.attrib["value"])) == 3
        ):
            spectrum.tag = "rgb"
    for said in root.iter("string"):
        if said.get("name") in ("filter_type", "filterType") and said.get("value") == "trilinear":
            said.set("value", "bilinear")  # as oneray reads it
    films = {element.get("id"): element for element in root.iter("film") if "id" in element.attrib}
    samplers = [element.get("id") for element in root.iter("sampler") if "id" in element.attrib]
    for sensor in root.iter("sensor"):
        film = None
        for child in list(sensor):
            if child.tag == "film" or (child.tag == "ref" and child.get("id") in films):
                film = films.get(child.get("id"), child)
            elif child.tag != "sampler" and not (child.tag == "ref" and child.get("id") in samplers):
                continue
            sensor.remove(child)
        sensor.append(small_film(film))
    document.write(root, to)


def small_film(film: Element | None) -> Element:
    """Of about the same shape, with few pixels, in whole tiles of 8 by 8."""
    sides = {"width": 768, "height": 576}
    for child in film if film is not None else ():
        if child.get("name") in sides:
            sides[child.attrib["name"]] = int(child.attrib["value"])
    factor = min(1.0, math.sqrt(PIXELS / (sides["width"] * sides["height"])))
    made = Element("film", type="hdrfilm")
    for name, side in sides.items():
        made.append(Element("integer", name=name, value=str(8 * max(1, round(side * factor / 8)))))
    made.append(Element("string", name="pixel_format", value="rgb"))
    made.append(Element("rfilter", type="box"))
    return made


def judge(path: Path, variant: str, seconds: float) -> dict[str, Any]:
    """Both pictures of a file, and the verdict."""
    start = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="raycheck-") as name:
        scene, first, second = (Path(name) / part for part in ("scene.xml", "mitsuba.exr", "oneray.exr"))
        small(path, scene)
        mitsuba = Mitsuba("mitsuba", "", variant, Variant(scene))
        batches: list[Any] = []
        found: Comparison | None = None
        try:
            mitsuba.open()
            spp = 512
            while found is None or time.monotonic() - start < seconds:
                batches += [
                    mitsuba.render(spp, len(batches) + k + 1).image for k in range(len(batches) or BATCHES)
                ]
                mean = np.mean(batches, axis=0)
                error = np.std(batches, axis=0, ddof=1) / math.sqrt(len(batches))
                planes = {c: mean[..., i] for i, c in enumerate("RGB")}
                write_exr(first, planes | {f"stderr.{c}": error[..., i] for i, c in enumerate("RGB")})
                command = [str(oneray_path()), str(scene), "-o", str(second), "--quiet"]
                options = ["--spp", str(spp * len(batches)), "--seed", str(len(batches))]
                try:
                    said = subprocess.run(
                        [*command, *options], check=True, capture_output=True, timeout=seconds
                    ).stderr
                except subprocess.TimeoutExpired:
                    if found is None:
                        raise
                    break
                found = compare(first, second)
                if found.verdict is Outcome.FAIL or seen(found):
                    break
        finally:
            mitsuba.close()
    verdict = str(found.verdict) if seen(found) or found.verdict is Outcome.FAIL else "UNDECIDED"
    if found.verdict is Outcome.FAIL and EITHER in said:
        verdict = "ILL-POSED"
    return {
        "verdict": verdict,
        "detectable": found.mde_image, "bias": found.bias, "reason": found.reason.replace(name + "/", ""),
        "samples": spp * len(batches), "size": list(mean.shape[1::-1]),
    }  # fmt: skip


def seen(found: Comparison) -> bool:
    return found.verdict is Outcome.PASS and (found.mde_image or 0) <= DETECTABLE


def rows(results: Iterable[dict[str, Any]]) -> list[str]:
    """The table, in Markdown."""
    done = list(results)
    clean = [r for r in done if not r["errors"]]
    rest = [r for r in done if r["errors"]]
    beside = [sum(not r["errors"].keys() & set(kinds) for r in rest) for kinds in (KINDS[-2:], KINDS[-1:])]
    verdicts = Counter(r["verdict"] for r in clean if "verdict" in r)
    lines = [
        ("files", len(done)),
        ("repositories", len({r["repository"] for r in done})),
        ("rendered as they are", len(clean)),
        ("of these with warnings", sum(r["warnings"] > 0 for r in clean)),
        *((f"with errors of {kind}", sum(kind in r["errors"] for r in rest)) for kind in KINDS),
        ("with errors, but of materials, textures, environment, media and missing files alone",
         beside[0]),
        ("with errors, but of these and other plugins alone", beside[1]),
        *((name, count) for name, count in sorted(verdicts.items())),
    ]  # fmt: skip
    return ["| | files |", "| --- | --- |", *(f"| {name} | {count} |" for name, count in lines)]


def markdown(results: Iterable[dict[str, Any]]) -> str:
    """What README says of the list."""
    return "\n".join((RULE, "", *rows(results)))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("list", type=Path, metavar="LIST", help="repository, tab, path in each line")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="where OWNER+NAME/PATH are")
    parser.add_argument("--check", action="store_true", help="render nothing")
    parser.add_argument("--json", type=Path, metavar="FILE", help="the results; those there are kept")
    parser.add_argument("--seconds", type=float, default=120, help="for a file (default %(default)s)")
    parser.add_argument("--memory", type=float, default=16, help="GiB for a process (default %(default)s)")
    options = parser.parse_args()
    most = int(options.memory * 2**30)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    variant = "" if options.check else choose_variant()
    kept: dict[tuple[str, str], dict[str, Any]] = {}
    if options.json and options.json.exists():
        for one in json.loads(options.json.read_text(encoding="utf-8"))["files"]:
            kept[one["repository"], one["path"]] = one
    results = []
    for line in options.list.read_text(encoding="utf-8").splitlines():
        repository, name = line.split("\t")
        path = options.folder / repository.replace("/", "+") / name
        before = kept.get((repository, name), {})
        result = {"repository": repository, "path": name} | check(path, options.seconds)
        if not result["errors"] and (options.check or before.get("verdict", "UNDECIDED") != "UNDECIDED"):
            result |= {key: before[key] for key in before if key not in result}
        elif not result["errors"] and not options.check:
            try:
                result |= judge(path, variant, options.seconds)
            except subprocess.TimeoutExpired:
                result |= {"verdict": "UNDECIDED", "reason": f"no picture in {options.seconds:.0f} s"}
            except (PlainError, subprocess.SubprocessError, OSError, ValueError) as error:
                result |= {"verdict": "UNDECIDED", "reason": str(error)[:300]}
        results.append(result)
        print(result.get("verdict", "ok" if not result["errors"] else "errors"), repository, name,
              result.get("reason", ""), *result["other"], sep="  ", flush=True)  # fmt: skip
        if options.json:
            command = "python scripts/public_scenes.py LIST FOLDER --json references/public_scenes.json"
            header = {"raycheck": raycheck_version(), "machine": machine(), "command": command}
            text = json.dumps(header | {"files": results}, indent=1, ensure_ascii=False)
            write_whole(options.json, text + "\n")
    print("\n".join(rows(results)))
    return int(any(r.get("verdict") == "FAIL" for r in results))


if __name__ == "__main__":
    sys.exit(main())
