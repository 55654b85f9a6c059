"""Limits of all processes of a jail together, by the kernel: control groups, where they may be made.

They may be made in the old hierarchies (version 1) by root, and in the new one (version 2) where a subtree is
this process's own: a container's root, or what systemd has delegated (systemd-run --user --scope -p
Delegate=yes). Elsewhere rlimits and a look twenty times a second do what they can.
Sources: Linux's Documentation/admin-guide/cgroup-v1/memory.rst and cgroup-v2.rst, and systemd's
CGROUP_DELEGATION.md.
"""

import contextlib
import functools
import itertools
import os
import re
import subprocess
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

OURS = "raycheck"
"""The group into which the grader itself moves: in version 2 no group has both processes and subgroups."""
WANTED = ("memory", "pids", "cpu")
"""The last has no limit: each group gets its share of the processors, however many processes it has."""
REMOVE_SECONDS = 2.0
"""How long the last process, which is dead, may take to leave its group."""
MOVES = 100
"""Times that the processes of a group are moved out: more may be started meanwhile."""
_numbers = itertools.count()


@dataclass(frozen=True)
class Place:
    """A folder of the kernel where groups can be made that limit something."""

    folder: Path
    controllers: tuple[str, ...]
    version: int


class Group:
    """The control group of one jail; a context. Without places it limits nothing. OSError where it cannot be
    made.
    """

    def __init__(self, places: Sequence[Place], memory_bytes: int, processes: int) -> None:
        self.memory_bytes, self.processes = memory_bytes, processes
        name = f"{OURS}-{os.getpid()}-{next(_numbers)}"
        self.folders = {place.folder / name: place for place in places}

    def __enter__(self) -> "Group":
        with contextlib.ExitStack() as made:
            for folder, place in self.folders.items():
                folder.mkdir(exist_ok=True)  # left by another process that had this id
                made.callback(_remove, folder)
                for name, value in self._limits(folder, place):
                    (folder / name).write_text(str(value))
            made.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        for folder in self.folders:
            _remove(folder)

    def _limits(self, folder: Path, place: Place) -> Iterator[tuple[str, int]]:
        """What is written into which files; nothing may go to swap, where that can be forbidden."""
        if "memory" in place.controllers and place.version == 2:
            yield "memory.max", self.memory_bytes
            swap, most = "memory.swap.max", 0
        elif "memory" in place.controllers:
            yield "memory.limit_in_bytes", self.memory_bytes
            swap, most = "memory.memsw.limit_in_bytes", self.memory_bytes
        if "memory" in place.controllers and (folder / swap).exists():
            yield swap, most
        if "pids" in place.controllers:
            yield "pids.max", self.processes

    @property
    def doors(self) -> list[str]:
        """Files to which a process writes 0 that is to belong to the group, with all that it will start."""
        return [str(folder / "cgroup.procs") for folder in self.folders]

    @property
    def swelled(self) -> bool:
        """Whether a process was killed since all together took too much memory."""
        for folder, place in self.folders.items():
            if "memory" in place.controllers:
                file = folder / ("memory.events" if place.version == 2 else "memory.oom_control")
                counts = dict(line.split() for line in file.read_text().splitlines())
                if int(counts.get("oom_kill", 0)) > 0:
                    return True
        return False


def _remove(folder: Path) -> None:
    until = time.perf_counter() + REMOVE_SECONDS
    while folder.is_dir():
        try:
            folder.rmdir()
        except OSError:
            if time.perf_counter() > until:
                return
            time.sleep(0.001)


@functools.cache
def places() -> tuple[Place, ...]:
    """The places where this process can make groups; none where it may not."""
    found = []
    with contextlib.suppress(OSError):  # a kernel without control groups
        for controllers, folder in _memberships():
            with contextlib.suppress(OSError):
                if controllers:
                    place = Place(folder, tuple(name for name in WANTED if name in controllers), 1)
                else:
                    place = Place(*_delegated(folder), 2)
                if place.controllers and os.access(place.folder, os.W_OK) and _works(place):
                    _sweep(place.folder)
                    found.append(place)
    return tuple(found)


def _works(place: Place) -> bool:
    """Whether a process can enter a group there."""
    with Group([place], 1 << 30, 64) as group:
        [door] = group.doors
        enter = ["/bin/sh", "-c", 'echo 0 >"$1"', "sh", door]
        return subprocess.run(enter, stderr=subprocess.DEVNULL, check=False).returncode == 0


def _sweep(folder: Path) -> None:
    """Remove the groups of graders that were killed."""
    for left in folder.glob(f"{OURS}-*"):
        found = re.fullmatch(rf"{OURS}-(\d+)-\d+", left.name)
        if found and not Path(f"/proc/{found[1]}").exists():
            with contextlib.suppress(OSError):
                left.rmdir()


def _memberships() -> Iterator[tuple[list[str], Path]]:
    """Controllers (none: version 2) and this process's group, where the hierarchy is mounted as a whole."""
    mounts: dict[str, Path] = {}
    for line in Path("/proc/self/mountinfo").read_text().splitlines():
        own, _, rest = line.partition(" - ")
        kind, _, options = rest.split(" ", 2)
        root, point = own.split()[3:5]
        if root == "/" and kind == "cgroup2":
            mounts[""] = Path(point)
        elif root == "/" and kind == "cgroup":
            mounts |= dict.fromkeys(set(options.split(",")) & set(WANTED), Path(point))
    for line in Path("/proc/self/cgroup").read_text().splitlines():
        _, names, path = line.split(":", 2)
        controllers = names.split(",") if names else []
        mount = next((mounts[name] for name in controllers or [""] if name in mounts), None)
        if mount:
            yield controllers, mount / path.lstrip("/")


def _delegated(folder: Path) -> tuple[Path, tuple[str, ...]]:
    """The place where groups of version 2 can be made, given this process's own; OSError where none."""
    base = folder.parent if folder.name == OURS else folder
    usable = tuple(name for name in WANTED if name in (base / "cgroup.controllers").read_text().split())
    of_the_kernel = not (base / "cgroup.type").exists()  # the root of all, where processes may be
    if not usable or not (of_the_kernel or folder.name == OURS or _is_ours(base)):
        return base, ()
    if not of_the_kernel:
        _move_out(base)
    (base / "cgroup.subtree_control").write_text(" ".join(f"+{name}" for name in usable))
    return base, usable


def _move_out(base: Path) -> None:
    """All processes of a group into a subgroup; OSError where one cannot be moved."""
    (base / OURS).mkdir(exist_ok=True)
    for _ in range(MOVES):
        members = (base / "cgroup.procs").read_text().split()
        if not members:
            return
        for pid in members:
            with contextlib.suppress(ProcessLookupError):
                (base / OURS / "cgroup.procs").write_text(pid)
    raise OSError(f"{base} does not get empty")


def _is_ours(base: Path) -> bool:
    """Whether it is the root of a container's groups, or was delegated by systemd."""
    if base.is_mount():
        return True
    names = set(os.listxattr(base)) & {"user.delegate", "trusted.delegate"}
    return any(os.getxattr(base, name) == b"1" for name in names)
