"""The one reader and writer of scene files: Mitsuba's XML as a tree, by the rules of Mitsuba and oneray.

`<default name= value=>` gives $name its value from where it stands, unless a parameter (-D) gives another; of
the names that a text may begin with the longest counts, and a backslash before $ keeps it.
`<include filename=>` stands for the elements of another file. Names of files are relative to the folder of
the scene file, or to one that a `<path value=>` names; of an include also to that of its own file. In files
of a version below 2 the names of properties are those of Mitsuba 0: "toWorld" is read as "to_world".
"""

import copy
import os
import re
import xml.etree.ElementTree as ElementTree
import xml.parsers.expat as expat
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from raycheck.base.errors import ReferenceError_

Element = ElementTree.Element


class _Placed(Element):
    """An element that knows where it stands."""

    place = ""

    def __deepcopy__(self, memo: dict[int, object]) -> "_Placed":
        twin = _Placed(self.tag, dict(self.attrib))
        twin.text, twin.tail, twin.place = self.text, self.tail, self.place
        twin.extend(copy.deepcopy(child, memo) for child in self)
        return twin


_TAGS = {"lookAt": "lookat"}
"""What Mitsuba 3 has for elements that it refuses."""
MOST_INCLUDED = 64
"""Files that a scene may include: one that includes itself would have no end."""


@dataclass(frozen=True)
class Document:
    """A scene file with the values of its parameters."""

    path: Path
    root: Element
    """As written, but with the parameters for the values of its defaults, and what it includes in place."""
    included: tuple[str, ...] = ()
    """Names of the files that it includes."""

    @property
    def folders(self) -> list[Path]:
        """Where the files may be that it names, the first that has one before the others."""
        added = [self.path.parent / element.attrib["value"] for element in self.root.findall("path")]
        return [*reversed(added), self.path.parent]

    def file(self, name: str) -> Path:
        """Where the file is that it calls so."""
        return self.path.parent / _found(name, self.folders)

    @property
    def defaults(self) -> dict[str, str]:
        """The values of all $names."""
        *_, (_, known) = self._walk(self.root)
        return known

    def resolved(self) -> Element:
        """A copy with the values in place of all $names."""
        root = copy.deepcopy(self.root)
        for element, known in self._walk(root):
            for key, text in element.attrib.items():
                element.set(key, _filled(text, known, self.path))
        for element in [one for one in root.iter() if one is not root and "type" in one.attrib]:
            for default in element.findall("default"):
                element.remove(default)  # whose value is in its places now
        return root

    def names(self) -> list[str]:
        """The names of files that it needs besides itself: what it includes, then others in their order."""
        return [*self.included, *(name for _, _, name in self._named(self.root))]

    def files(self) -> list[Path]:
        """Where the files that it needs are."""
        return [self.path.parent / name for name in self.names()]

    def moved(self, place: Callable[[Path], str]) -> Element:
        """A copy that names its files as `place` says."""
        root = copy.deepcopy(self.root)
        for element in root.findall("path"):
            root.remove(element)
        for element, key, name in list(self._named(root)):
            element.set(key, place(self.path.parent / name).replace("$", "\\$"))
        return root

    def _named(self, root: Element) -> Iterator[tuple[Element, str, str]]:
        """The elements that name files: meshes, pictures, spectra; the attribute that does, and the name."""
        for element, known in self._walk(root):
            key = "value" if element.tag == "string" and element.get("name") == "filename" else "filename"
            if key in element.attrib:
                yield element, key, _found(_filled(element.attrib[key], known, self.path), self.folders)

    def _walk(self, root: Element) -> Iterator[tuple[Element, dict[str, str]]]:
        """The elements in their order, with the values of the $names that hold there."""
        known: dict[str, str] = {}
        for element in root.iter():
            yield element, known
            if element.tag == "default":
                known.setdefault(element.attrib["name"], _filled(element.attrib["value"], known, self.path))


def read(path: Path, parameters: Mapping[str, str] | None = None, *, comments: bool = False) -> Document:
    """ReferenceError_ where it cannot be read, or has no parameter of a name that is given."""
    root = _parsed(path, comments)
    included = tuple(_include(root, path, [path.parent], dict(parameters or {}), []))
    names = []
    for default in root.iter("default"):
        for key in ("name", "value"):
            if key not in default.attrib:
                raise ReferenceError_(f'{place(default)}: a default lacks its attribute "{key}"')
        names.append(default.attrib["name"])
        if parameters and names[-1] in parameters:  # what is given is taken as it is
            default.set("value", parameters[names[-1]].replace("$", "\\$"))
    for name in parameters or ():
        if name not in names:
            raise ReferenceError_(f"{path.stem} has no parameter {name} ({', '.join(names) or 'none'})")
    return Document(path, root, included)


def comments(path: Path) -> list[str]:
    """The texts of all comments, also of those around the scene."""
    found: list[str] = []
    parser = expat.ParserCreate()
    parser.CommentHandler = found.append
    try:
        parser.Parse(path.read_bytes(), True)
    except expat.ExpatError as error:
        raise ReferenceError_(f"{path}: {error}") from None
    return found


def sensor(root: Element) -> Element | None:
    """The first of a scene's sensors, or what refers to one: the one that renderers take."""
    by_id = {element.get("id"): element for element in root.iter("sensor")}
    for child in root:
        found = by_id.get(child.get("id")) if child.tag == "ref" else child
        if found is not None and found.tag == "sensor":
            return found
    return None


def integrator(element: Element | None) -> Element | None:
    """The one that makes a picture's means: of `aov` and `moment` that inside; None: there is none."""
    while element is not None and element.get("type") in ("aov", "moment"):
        element = element.find("integrator")
    return element


def write(root: Element, path: Path) -> None:
    """A tree as a file."""
    path.write_bytes(text(root).encode())


def text(root: Element) -> str:
    """A tree as XML."""
    return ElementTree.tostring(root, encoding="unicode")


def place(element: Element) -> str:
    """FILE:LINE where it stands, for a message."""
    return str(getattr(element, "place", ""))


def _parsed(path: Path, comments: bool) -> Element:
    builder = ElementTree.TreeBuilder(element_factory=_Placed, insert_comments=comments)
    parser = expat.ParserCreate()

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = builder.start(_TAGS.get(tag, tag), attributes)
        assert isinstance(element, _Placed)
        element.place = f"{path}:{parser.CurrentLineNumber}"

    def doctype(*_: object) -> None:
        raise ReferenceError_(f"{path}:{parser.CurrentLineNumber}: a DOCTYPE is not supported")

    def end(tag: str) -> None:
        builder.end(_TAGS.get(tag, tag))

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.CommentHandler = builder.data, builder.comment
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(path.read_bytes(), True)
    except ReferenceError_:
        raise
    except OSError as error:
        raise ReferenceError_(f"{path}: {error.strerror}") from None
    except (expat.ExpatError, ValueError) as error:
        raise ReferenceError_(f"{path}: {error}") from None
    root = builder.close()
    if re.match(r"[01]\.", root.get("version", "3.")):
        _rename(root)
    return root


def _rename(root: Element) -> None:
    """Give the properties of a file of version 0 the names that Mitsuba has for them today."""
    for parent in root.iter():
        for child in parent:
            name = child.get("name")
            if name is None or child.tag == "default":
                continue
            words = re.sub(r"(?<=[a-z])[A-Z]+", lambda found: "_" + found[0].lower(), name)
            diffuse = parent.get("type") == "diffuse" and words == "diffuse_reflectance"
            child.set("name", "reflectance" if diffuse else words)
        _upgrade_to_uv(parent)


_OFFSETS = {"uoffset": ("translate", "x"), "voffset": ("translate", "y")}
_SCALES = {"uscale": ("scale", "x"), "vscale": ("scale", "y")}


def _upgrade_to_uv(parent: Element) -> None:
    """Offsets and scales of texture coordinates in version 0 are steps of "to_uv" today, in this order."""
    numbers = [child for child in parent if child.tag in ("float", "integer")]
    said = [child for child in numbers if child.get("name") in {**_OFFSETS, **_SCALES}]
    if not said:
        return
    to_uv = _Placed("transform", {"name": "to_uv"})
    for child in sorted(said, key=lambda child: child.get("name") in _SCALES):
        step, axis = {**_OFFSETS, **_SCALES}[child.attrib["name"]]
        made = _Placed(step, {axis: child.get("value", "")})
        to_uv.place = made.place = place(child)
        to_uv.append(made)
        parent.remove(child)
    parent.append(to_uv)


def _found(name: str, folders: list[Path]) -> str:
    """A file's name, relative to the last of the folders, in the first that has it."""
    for folder in folders[:-1]:
        if (folder / name).exists():
            return os.path.relpath(folder / name, folders[-1])
    return name


def _include(
    parent: Element, path: Path, folders: list[Path], known: dict[str, str], found: list[str]
) -> list[str]:
    """Put the elements of other files in their places; what these are called is added to `found`. `path`: the
    file that `parent` stands in.
    """
    at = 0
    while at < len(parent):
        element = parent[at]
        if element.tag == "default" and {"name", "value"} <= element.attrib.keys():
            known.setdefault(element.attrib["name"], _filled(element.attrib["value"], known, path))
        if element.tag == "path" and "value" in element.attrib:
            folders = [path.parent / _filled(element.attrib["value"], known, path), *folders]
            if not folders[0].exists():
                raise ReferenceError_(f"{place(element)}: <path>: there is no folder {folders[0]}")
        if element.tag != "include":
            _include(element, path, folders, known, found)
            at += 1
            continue
        name = _found(_filled(element.get("filename", ""), known, path), [path.parent, *folders])
        if len(found) == MOST_INCLUDED:
            raise ReferenceError_(f"{path}: it includes more than {MOST_INCLUDED} files, or includes itself")
        found.append(name)
        inner = _parsed(folders[-1] / name, False)
        whole = Element("scene")
        whole.extend(inner if inner.tag == "scene" else [inner])
        _include(whole, folders[-1] / name, folders, known, found)
        if inner.tag != "scene":
            inner.attrib.pop("version", None)
            inner.attrib.update({"name": element.attrib["name"]} if "name" in element.attrib else {})
        parent[at : at + 1] = [child for child in whole if child.tag != "path"]
        at += len(whole) - sum(child.tag == "path" for child in whole)
    return found


def _filled(given: str, known: Mapping[str, str], path: Path) -> str:
    """A text with the values of the $names in it."""

    def value(found: re.Match[str]) -> str:
        if found[0] == "\\$":
            return "$"
        name = max((name for name in known if found[1].startswith(name)), key=len, default=None)
        if name is None:
            listed = ", ".join(known) or "none"
            raise ReferenceError_(f"{path}: undefined parameter {found[0]} (defaults before it: {listed})")
        return known[name] + found[1][len(name) :]

    return re.sub(r"\\\$|\$(\w*)", value, given, flags=re.ASCII) if "$" in given else given
