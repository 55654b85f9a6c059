"""The catalogue of mistakes: patches of oneray, `tests/mutants/NAME.patch`, and the programs that they make.

A patch stands under a header: the lecture's technique, the mistake in a student's words, its symptom, and a
scene and technique of oneray that show it. `Equivalent: reason` marks one that changes no mean, a negative
control. `Variant: NAME` marks another patch, or another strength, of a catalogued mistake: it is held out to
measure how well mistakes are named. Programs are built once for each state of the sources and kept under
build/mutants.
"""

import functools
import hashlib
import os
import re
import shlex
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

from raycheck.base.data import ROOT
from raycheck.base.errors import NotFound, PatchError
from raycheck.base.files import one_process

FOLDER = ROOT / "tests/mutants"
SOURCES = "src/oneray"
HEADERS = ("Technique", "Mistake", "Symptom", "Shows")
OPTIONAL_HEADERS = ("Equivalent", "Variant")


@dataclass(frozen=True)
class Mutant:
    """A mistake, and the patch that makes it."""

    name: str
    patch: Path
    technique: str
    """The lecture's, "L10 next event estimation", or what else it belongs to: sampling, film, camera."""
    mistake: str
    symptom: str
    scene: str
    """The canonical scene that shows it."""
    shows: str
    """The technique of oneray that shows it there."""
    equivalent: str | None = None
    """Why no mean changes."""
    variant: str | None = None
    """The catalogued mistake of which it is another form."""

    @property
    def catalogued(self) -> bool:
        """A mistake that can be named."""
        return self.equivalent is None and self.variant is None


def header(patch: Path) -> dict[str, str]:
    """The lines above the patch, by name."""
    lines = patch.read_text(encoding="utf-8").split("\n---")[0].splitlines()
    return dict(line.split(": ", 1) for line in lines if ": " in line)


def read(patch: Path) -> Mutant:
    """PatchError where a line of the header is missing."""
    lines = header(patch)
    missing = [name for name in HEADERS if not lines.get(name)]
    unknown = [name for name in lines if name not in HEADERS + OPTIONAL_HEADERS]
    if missing or unknown or len(lines["Shows"].split()) != 2:
        raise PatchError(f"{patch}: the header needs {', '.join(HEADERS)} and may have Equivalent or Variant")
    scene, shows = lines["Shows"].split()
    return Mutant(
        patch.stem, patch, lines["Technique"], lines["Mistake"], lines["Symptom"], scene, shows,
        lines.get("Equivalent"), lines.get("Variant"),
    )  # fmt: skip


def catalogue(folder: Path = FOLDER) -> list[Mutant]:
    """All mutants, by name; NotFound outside a checkout, which alone has them."""
    patches = sorted(folder.glob("*.patch"))
    if not patches:
        raise NotFound(f"{folder}: there are no patches; calibration needs a checkout of the sources")
    return [read(patch) for patch in patches]


def settings() -> list[str]:
    """What `make` is told: one generic kernel in double precision, as wide as this machine, with few
    optimisations, which halves the time to build, and without warnings. The compiler writes down beside each
    object, NAME.d, what went into it.
    """
    info = Path("/proc/cpuinfo")
    wide = info.is_file() and "avx2" in info.read_text()
    return [f"KERNEL_LIST={'double:4:1' if wide else 'double:2:0'}", "CFLAGS=-O1 -MMD", "WARN=", "LDFLAGS=-s"]


OPTIONS = ("--precision", "double")
"""What a mutant's command needs: it has no other kernel."""


MANY_SEEDS = "many_seeds.o"


def program(mutant: Mutant | None, cache: Path = ROOT / "build/mutants") -> Path:
    """The program with this mistake, or with none; built where it is not there yet. Beside it is
    `many-seeds`, which renders many images in one process.
    """
    base = program_path(None, cache).parent.parent
    if not (base / "build/libraries").is_file():
        with one_process(cache):
            _build_base(base, cache)
    found = program_path(mutant, cache)
    target = found.parent
    if mutant and not target.is_dir():
        with tempfile.TemporaryDirectory(prefix="building-", dir=cache) as folder:
            oneray = build(mutant, Path(folder) / "copy", base)
            kept = Path(folder) / "kept"
            kept.mkdir()
            for path in (oneray, oneray.with_name("many-seeds")):
                path.replace(kept / path.name)
            try:
                kept.replace(target)
            except OSError:  # another process was first
                if not target.is_dir():
                    raise
    return found


def _build_base(base: Path, cache: Path) -> None:
    if (base / "build/libraries").is_file():
        return
    with tempfile.TemporaryDirectory(prefix="building-", dir=cache) as folder:
        build(None, Path(folder) / "copy")
        shutil.rmtree(base, ignore_errors=True)
        (Path(folder) / "copy").replace(base)


def program_path(mutant: Mutant | None, cache: Path = ROOT / "build/mutants") -> Path:
    """Where `program` has it, or would."""
    if not mutant:
        return cache / f"oneray-{_digest(None)}" / "build/oneray"
    return cache / f"{mutant.name}-{_digest(mutant)}" / "oneray"


@functools.lru_cache(maxsize=256)
def _digest(mutant: Mutant | None) -> str:
    """A digest of the sources, the patch and the way in which they are built."""
    if not (ROOT / "Makefile").is_file():
        raise NotFound(f"{ROOT}: there are no sources; calibration needs a checkout of them")
    digest = hashlib.sha256("\n".join(settings()).encode())
    for path in (
        ROOT / "Makefile",
        Path(__file__).with_name("many_seeds.c"),
        *sorted(path for path in (ROOT / SOURCES).rglob("*") if path.is_file()),
    ):
        digest.update(f"{path.relative_to(ROOT)}\n".encode() + path.read_bytes())
    if mutant:
        digest.update(mutant.patch.read_bytes().split(b"\n---", 1)[1])
    return digest.hexdigest()[:24]


def build(mutant: Mutant | None, folder: Path, base: Path | None = None) -> Path:
    """A copy of the sources in `folder`, patched and built; PatchError where that fails. What the patch does
    not touch is taken from a `base` that is already built, and make's commands too.
    """
    shutil.copytree(ROOT / SOURCES, folder / SOURCES)
    shutil.copy(ROOT / "Makefile", folder)
    touched = apply(mutant, folder) if mutant else set()
    if not base:
        _make(folder)
        base = folder
    (folder / "build").mkdir(exist_ok=True)
    if base is not folder:
        _link_headers(base / "build", folder / "build")
        compiled = _compile(mutant, touched, folder, base)
        if mutant and not compiled:
            raise PatchError(f"{mutant.name}: nothing that is compiled includes {', '.join(sorted(touched))}")
    objects = [str(o) for o in sorted((folder / "build").glob("*.o")) if o.name not in ("main.o", MANY_SEEDS)]
    libraries = (base / "build/libraries").read_text(encoding="utf-8").split()
    for main in ("main.o", MANY_SEEDS):
        program = folder / "build" / ("oneray" if main == "main.o" else "many-seeds")
        first = folder / "build/main.o" if main == "main.o" else base / "build" / main
        _run(mutant, ["cc", "-s", "-o", str(program), str(first), *objects, *libraries], folder)
    return folder / "build/oneray"


def _link_headers(base: Path, build: Path) -> None:
    """Headers that make wrote, and folders of them."""
    for header in base.rglob("*.h"):
        target = build / header.relative_to(base)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.symlink_to(header)


def _compile(mutant: Mutant | None, touched: set[str], folder: Path, base: Path) -> list[str]:
    """The objects that something touched went into; of the others there are links to those of the base."""
    compiled = []
    commands = (base / "build/commands").read_text(encoding="utf-8").replace("\\\n", " ")
    for command in commands.splitlines():
        if " -c " not in command or " -o " not in command:
            continue
        words = shlex.split(command)
        target = Path(words[words.index("-o") + 1])
        if _prerequisites(base / target.with_suffix(".d")) & touched:
            _run(mutant, words, folder)
            compiled.append(target.name)
        else:
            (folder / target).symlink_to(base / target)
    return compiled


def _prerequisites(file: Path) -> set[str]:
    """What went into an object, as the compiler has written it down: paths in the copy of the sources."""
    first = file.read_text(encoding="utf-8").replace("\\\n", " ").splitlines()[0]
    return {os.path.normpath(name) for name in first.partition(":")[2].split()}


def _make(folder: Path) -> None:
    """Build the sources as they are, and keep what is needed to build others: make's commands, the libraries
    and the object of `many-seeds`.
    """
    variables = ["BUILD=build", *settings()]
    command = ["make", "-s", "-B", "-n", "V=1", *variables, "all"]
    commands = _run(None, command, folder)
    link = next(line for line in commands.splitlines() if "-o build/oneray " in line)
    libraries = " ".join(word for word in link.split() if word.startswith(("-l", "-L")))
    _run(None, ["make", *variables, "all"], folder)
    (folder / "build/commands").write_text(commands, encoding="utf-8")
    (folder / "build/libraries").write_text(libraries, encoding="utf-8")
    source = Path(__file__).with_name("many_seeds.c")
    words = ["cc", "-std=c99", "-D_XOPEN_SOURCE=700", "-O1", f"-I{SOURCES}", "-Ibuild", "-c", str(source)]
    _run(None, [*words, "-o", f"build/{MANY_SEEDS}"], folder)


def _run(mutant: Mutant | None, words: list[str], folder: Path) -> str:
    """What a command prints; PatchError with its last words where it fails."""
    environment = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, env=environment, check=False)
    if done.returncode:
        raise PatchError(f"{mutant.name if mutant else 'oneray'}: cannot be built: {done.stderr[-800:]}")
    return done.stdout


def apply(mutant: Mutant, folder: Path) -> set[str]:
    """Patch the copy of the sources in `folder`: the paths there of the files that change. Their context may
    have changed since the patch was made, what it replaces may not.
    """
    command = ["patch", "-p1", "--fuzz=1", "--no-backup-if-mismatch", "-i", str(mutant.patch)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        said = " ".join((done.stdout + done.stderr).split())
        raise PatchError(f"{mutant.patch.name} no longer applies: {said}")
    return set(re.findall(rf"^\+\+\+ b/({SOURCES}/\S+)", mutant.patch.read_text(), re.MULTILINE))
