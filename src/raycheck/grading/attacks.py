"""The grader's own test: hostile submissions, between two honest ones, must get no points for a plain reason.

The programs are in tests/attacks of a checkout. Archives that lead out of their folder are made here.
"""

import io
import re
import stat
import tarfile
import tomllib
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from raycheck.base import data
from raycheck.base.data import ROOT
from raycheck.base.errors import NotFound
from raycheck.grading import course
from raycheck.grading.assignment import read_assignment
from raycheck.grading.jail.sandbox import FIRST_USER, GRADING, USERS, Tier
from raycheck.grading.judge import Grader
from raycheck.grading.keys import digest_of
from raycheck.grading.results import StudentResult
from raycheck.grading.submission import MOST_ENTRIES
from raycheck.renderers.pools import Here

FOLDER = ROOT / "tests/attacks"
ASSIGNMENT = """\
name = "attacks"
delta = 0.05
[limits]
build_seconds = 20
picture_seconds = 3
task_seconds = 120
memory_mb = 512
processes = 32
output_mb = 4
[[task]]
id = "L1"
scenes = ["point-light"]
points = 10
spp = 4
hidden = 1
"""
HONEST_RUN = "./floor honest {spp} {seed} {output} {json}"
HONEST_BUILD = "gcc -O1 -o floor floor.c -lm"

ARCHIVES = {
    "climbs-out": "leads out of the submission", "zip-bomb": "unpacks to more than", "zip-link": "is a link",
    "tar-link": "is a link or a device", "tar-device": "is a link or a device",
    "cut-short": "neither a folder nor", "zip-deep": "nested more than", "zip-folders": "files and folders",
    "manifest-nested": "raycheck.toml: a number has too many digits, or lists",
}  # fmt: skip
"""What `hostile_archives` makes, and the words of the reasons."""


@dataclass(frozen=True)
class Attack:
    name: str
    reason: str
    """Regular expression that the reason for no points must match."""
    files: Sequence[str] = ()
    build: str = ""
    run: str = ""
    open_reason: str = ""
    """The same in the jail that leaves files open which every user may read; empty if it is no other."""


@dataclass(frozen=True)
class Survived:
    """What became of an attack."""

    name: str
    reason: str
    problem: str
    """Why it was not survived; empty if it was."""


def read_attacks(folder: Path = FOLDER) -> list[Attack]:
    """The attacks in tests/attacks; NotFound outside a checkout."""
    path = folder / "attacks.toml"
    if not path.is_file():
        raise NotFound(f"{path} is missing: the attacks need a checkout of the sources")
    return [Attack(**table) for table in tomllib.loads(path.read_text(encoding="utf-8"))["attack"]]


def survive(
    attacks: Sequence[Attack], work: Path, tier: Tier, on_result: Callable[[StudentResult], None]
) -> list[Survived]:  # fmt: skip
    """Grade the attacks, and an honest program before and after them, in the empty folder `work`."""
    (work / "class").mkdir()
    assignment = work / "attacks.toml"
    assignment.write_text(ASSIGNMENT, encoding="utf-8")
    honest = Attack("honest", "", ("floor.c",), HONEST_BUILD, HONEST_RUN)
    for one in (*attacks, Attack("0-before", "", *_rest(honest)), Attack("~after", "", *_rest(honest))):
        hand_in(one, work / "class" / one.name)
    archives = hostile_archives(work / "class")
    before = _outside(work)
    grader = Grader.prepare(read_assignment(assignment), tier)
    found = course.entries(work / "class", [])
    results = {r.student: r for r in course.grade_class(grader, found, work / "out", Here(1), on_result)}
    files_open = grader.tier is Tier.USER
    expected = {one.name: one.open_reason * files_open or one.reason for one in attacks} | archives
    answers = [_judge(name, reason, results[name]) for name, reason in expected.items()]
    answers += [_honest(results[name]) for name in ("0-before", "~after")]
    return [*answers, _unchanged(before, _outside(work)), _nothing_left(len(found))]


def _rest(attack: Attack) -> tuple[Sequence[str], str, str]:
    return attack.files, attack.build, attack.run


def hand_in(attack: Attack, folder: Path) -> None:
    """An attack as a submission, in a new folder."""
    folder.mkdir(parents=True)
    for name in (*attack.files, "attack.sh"):
        (folder / name).write_bytes((FOLDER / name).read_bytes())
    run = attack.run or f"sh attack.sh {attack.name} {{output}}"
    manifest = f'build = "{attack.build}"\ncommand = "{run}"\n'
    (folder / "raycheck.toml").write_text(manifest, encoding="utf-8")


def hostile_archives(folder: Path) -> dict[str, str]:
    """Archives that attack whoever unpacks them, and the reasons that are expected."""
    with zipfile.ZipFile(folder / "climbs-out.zip", "w") as archive:
        archive.writestr("../../escaped.txt", "escaped")
    with zipfile.ZipFile(folder / "zip-bomb.zip", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("zeros", bytes(220 << 20))
    with zipfile.ZipFile(folder / "zip-link.zip", "w") as archive:
        info = zipfile.ZipInfo("raycheck.toml")
        info.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(info, "/etc/passwd")
    for name, kind in (("tar-link.tar", tarfile.SYMTYPE), ("tar-device.tar", tarfile.CHRTYPE)):
        with tarfile.open(folder / name, "w") as archive:
            member = tarfile.TarInfo("raycheck.toml")
            member.type, member.linkname = kind, "/etc/passwd"
            archive.addfile(member)
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w") as archive:
        archive.writestr("raycheck.toml", 'command = "x {output}"')
    (folder / "cut-short.zip").write_bytes(whole.getvalue()[:-30])
    with zipfile.ZipFile(folder / "zip-deep.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a/" * 1700 + "raycheck.toml", "")
    with zipfile.ZipFile(folder / "zip-folders.zip", "w") as archive:
        for number in range(MOST_ENTRIES + 1):
            archive.writestr(f"{number}/", "")
    with zipfile.ZipFile(folder / "manifest-nested.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("raycheck.toml", "command = " + "[" * 5000)
    return ARCHIVES


def _judge(name: str, expected: str, result: StudentResult) -> Survived:
    reasons = [result.problem, *(scene.reason for task in result.tasks for scene in task.scenes)]
    reason = next((r for r in reasons if r), "")
    if result.total or result.pending:
        return Survived(name, reason, f"it got {result.total} points, {result.pending} are open")
    if not re.search(expected, reason):
        return Survived(name, reason, f"the reason does not say {expected!r}: {reason}")
    return Survived(name, reason, "")


def _honest(result: StudentResult) -> Survived:
    problem = "" if result.total == result.most else f"the honest program got {result.total} of {result.most}"
    return Survived(f"honest program {result.student}", "", problem)


def _outside(work: Path) -> str:
    """A digest of what no attack may change: the references, the attacks themselves, and the class folder."""
    return " ".join(digest_of(folder) for folder in (data.references_dir(), FOLDER, work / "class"))


def _unchanged(before: str, after: str) -> Survived:
    return Survived("files outside", "", "" if before == after else "files outside the jail have changed")


def _nothing_left(jails: int) -> Survived:
    """No process of a jail lives on. As an ordinary user jails have no user id of their own to be found by;
    that their first process is dead, and so all of its name space, was waited for.
    """
    users = {FIRST_USER + (GRADING + slot) % USERS for slot in range(jails)}
    left = [p for p in Path("/proc").glob("[0-9]*") if _owner(p) in users]
    return Survived("processes", "", f"{len(left)} processes of the jail live on" if left else "")


def _owner(process: Path) -> int:
    """The user of a process, −1 where it is dead."""
    try:
        alive = process.joinpath("stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
        return process.stat().st_uid if alive else -1
    except OSError:
        return -1
