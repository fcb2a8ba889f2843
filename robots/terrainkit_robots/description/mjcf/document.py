"""MJCF documents: the file and what it includes, as one tree that MuJoCo's parser may be given.

MuJoCo tells the line of an element, but not the file, and opens what it is told to. So includes are
put in here, what would open a file or fill the memory is left out, and the tree is written with
each element on a line of its own: the line says which element it is, wherever it came from.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lxml import etree

from terrainkit_robots.description.model import Problem, Source
from terrainkit_robots.description.package_resolver import exists
from terrainkit_robots.description.xml.document import (
    MAX_BYTES,
    RobotFileError,
    XmlDocument,
    parse_xml,
    read_bytes,
)

MAX_ELEMENTS = 8_000
"""MuJoCo's parser takes time with the square of the elements: seconds for these."""

_MOST_DEPTH = 400
"""MuJoCo's parser stops at 500."""

_MOST_FILES = 200
"""So many files are read for one model."""

_ARRAYS = 1000
"""So many characters of attributes count as one more element."""

_LEFT_OUT = {
    "*": {"user"},
    "hfield": {"nrow", "ncol", "elevation"},
    "mesh": {"builtin", "params", "vertex", "normal", "texcoord", "face"},
    "numeric": {"size"},
}
"""Attributes that make MuJoCo's parser allocate or compute, and say nothing of the robot."""

_SOFT = frozenset({"flexcomp", "deformable", "skin", "extension"})
"""Elements that are left out: soft bodies and skins, and plugins that may not be installed."""


@dataclass(eq=False, slots=True)
class Node:
    """An element of the tree. What MuJoCo refuses is taken out of it, so that it reads the rest."""

    tag: str
    source: Source
    folder: Path
    """Where the model starts that it is a part of: mesh files are looked for from there."""

    parent: "Node | None" = None
    attributes: dict[str, str] = field(default_factory=dict)
    """As MuJoCo is given them."""

    written: Mapping[str, str] = field(default_factory=dict)
    """As they are in the file."""

    children: list["Node"] = field(default_factory=list)

    def walk(self) -> Iterator["Node"]:
        """Yield the node and all below it, in the order of the file."""
        stack = [self]
        while stack:
            node = stack.pop()
            yield node
            stack.extend(reversed(node.children))

    def remove(self) -> None:
        """Take it out of the tree."""
        if self.parent is not None:
            self.parent.children.remove(self)
            self.parent = None

    invented: str = ""
    """Name of a body that has none."""

    placeholders: set[str] = field(default_factory=set)
    """Attributes that stand for missing ones."""

    @property
    def name(self) -> str:
        """Return its name, or that which was made up for it."""
        return self.written.get("name", "") or self.invented

    @property
    def owner(self) -> str:
        """Return the name of the nearest element that has one, itself first."""
        node: Node | None = self
        while node is not None and not node.name:
            node = node.parent
        return "" if node is None else node.name


@dataclass(eq=False)
class MjcfDocument:
    """A model as trees: its own, and those of the models that it attaches."""

    root: Node
    attached: dict[str, Node]
    """By the name that `model` elements have for them in the text."""

    problems: list[Problem]
    sources: tuple[Path, ...]
    """Every file that was read."""

    whole: bool = True
    """Whether everything in the file is in the trees; not so where soft bodies were left out."""

    def roots(self) -> list[Node]:
        """Return the tree of the model and those that it attaches."""
        return [self.root, *self.attached.values()]

    def nodes(self) -> Iterator[Node]:
        """Yield every node."""
        for root in self.roots():
            yield from root.walk()

    def write(self) -> tuple[str, dict[str, bytes], list[Node]]:
        """Return the text of the model, those of what it attaches, and the node of each line.

        The lines of an attached model follow those of the one before, so that a line is only one
        element.
        """
        lines: list[Node] = []
        text = _text(self.root, lines)
        attached = {
            name: ("\n" * len(lines) + _text(root, lines)).encode()
            for name, root in self.attached.items()
        }
        return text, attached, lines


def read_document(document: XmlDocument, contents: Mapping[Path, bytes]) -> MjcfDocument:
    """Return a document with what it includes and attaches.

    Args:
        document: The main file; it has a root.
        contents: What to read instead of the files of these paths.
    """
    reader = _Reader(contents)
    reader.problems += document.problems
    root = reader.tree(document)
    if root.tag != "mujoco":
        message = f"the root element is <{root.tag}>, a part of a model; wanted <mujoco>"
        reader.problems.append(Problem(code="XML002", message=message, source=root.source))
        root.tag = "mujoco"
    whole = MjcfDocument(
        root=root,
        attached=reader.attached,
        problems=reader.problems,
        sources=tuple(reader.files),
        whole=reader.whole,
    )
    bound(whole)
    return whole


def harmless(tag: str, attribute: str = "") -> bool:
    """Return whether an element or an attribute of it may be given to MuJoCo's parser."""
    if tag in _SOFT | {"include", "model", "plugin"}:
        return False
    return attribute not in _left_out(tag)


def _left_out(tag: str) -> set[str]:
    return _LEFT_OUT["*"] | _LEFT_OUT.get(tag, set())


class _Reader:
    """One walk through a model's files; its problems are gathered on the way."""

    def __init__(self, contents: Mapping[Path, bytes]) -> None:
        self._contents = contents
        self._bytes = 0
        self._count = 0
        self._unnamed = 0
        self.files: list[Path] = []
        self.problems: list[Problem] = []
        self.attached: dict[str, Node] = {}
        self.whole = True
        self._deep = False

    def tree(self, main: XmlDocument, above: tuple[Path, ...] = ()) -> Node:
        """Return the tree of a model; `above` are the models that attach it."""
        assert main.root is not None
        self.files.append(main.file)
        folder = main.file.parent
        included: dict[Path, tuple[Path, ...]] = {_same(main.file): ()}
        top = Node(tag="", source=main.source(main.root), folder=folder)
        stack: list[tuple[etree._Element, XmlDocument, Node, int]] = [(main.root, main, top, 0)]
        while stack and self._count <= MAX_ELEMENTS:
            element, document, parent, depth = stack.pop()
            source = document.source(element)
            if element.tag == "include":
                part = self._included(element, document, folder, included)
                if part is not None and part.root is not None:
                    inner = reversed(list(part.root.iterchildren(etree.Element)))
                    stack += [(child, part, parent, depth) for child in inner]
                continue
            if depth > _MOST_DEPTH:
                self._too_deep(source)
                continue
            node = self._node(element, source, parent, folder)
            if node is None or not self._attaches(node, (*above, main.file)):
                continue
            parent.children.append(node)
            self._count += 1
            children = reversed(list(element.iterchildren(etree.Element)))
            stack += [(child, document, node, depth + 1) for child in children]
        root = top.children[0]
        root.parent = None
        return root

    def _node(
        self, element: "etree._Element", source: Source, parent: Node, folder: Path
    ) -> Node | None:
        """Return an element without what MuJoCo's parser should not see; None for such a one."""
        tag = _plain(element.tag, element)
        written = {_plain(name, element): value for name, value in element.attrib.items()}
        node = Node(tag=tag, source=source, folder=folder, parent=parent, written=written)
        node.attributes = {
            k: _bare(v) if k.startswith("file") and tag != "model" else v
            for k, v in written.items()
            if k not in _left_out(tag)
        }
        if tag == "body" and not node.name:
            self._unnamed += 1
            node.invented = f"unnamed_body_{self._unnamed}"
        if tag in _SOFT:
            self.whole = self.whole and tag != "flexcomp"
            return None
        if tag == "plugin" and parent.tag == "actuator":
            node.tag = "general"  # it drives a joint like any other
            node.attributes = {
                k: v for k, v in node.attributes.items() if k not in ("plugin", "instance")
            }
        elif tag == "plugin" or (tag == "config" and parent.written.get("plugin") is not None):
            return None
        return node

    def _included(
        self,
        element: "etree._Element",
        document: XmlDocument,
        folder: Path,
        included: dict[Path, tuple[Path, ...]],
    ) -> XmlDocument | None:
        """Return what an include names, or None and tell why not."""
        source, name = document.source(element), (element.get("file") or "").strip()
        chain = (*included[_same(document.file)], _same(document.file))
        if not name:
            self._tell(source, "<include> has no file", "")
            return None
        if len(element):
            self._tell(source, f"<include file={name!r}> has children; MuJoCo refuses that", name)
        path = folder / name
        beside = document.file.parent / name
        if not self._exists(path) and self._exists(beside):
            path = beside
        if _same(path) in included:
            how = "from within itself" if _same(path) in chain else "a second time"
            self._tell(source, f"{name} is included {how}; MuJoCo refuses that", name)
            return None
        part = self._read(path, source, name)
        if part is not None and part.root is not None:
            included[_same(path)] = chain
            self.files.append(path)
            if not len(part.root):
                self._tell(source, f"{name} has nothing in it to include", name)
        return part

    def _exists(self, path: Path) -> bool:
        return path in self._contents or exists(path)

    def _read(self, path: Path, source: Source, name: str) -> XmlDocument | None:
        if len(self.files) >= _MOST_FILES or self._bytes > MAX_BYTES:
            self._tell(source, f"{name} is not read: too many or too large files", name)
            return None
        try:
            data = self._contents[path] if path in self._contents else read_bytes(path)
        except RobotFileError as error:
            self._tell(source, f"{name}: {error}", name)
            return None
        self._bytes += len(data)
        part = parse_xml(path, data)
        self.problems += part.problems
        if part.root is None:
            self._tell(source, f"{name} could not be read", name)
            return None
        return part

    def _attaches(self, node: Node, above: tuple[Path, ...]) -> bool:
        """Read the model that a <model> element names; False if the element has no use."""
        if node.tag != "model":
            return True
        name = node.written.get("file", "")
        if not name:
            self._tell(node.source, "<model> has no file", "")
            return False
        path = node.folder / name
        if _same(path) in map(_same, above):
            self._tell(node.source, f"{name} attaches itself", name)
            return False
        part = self._read(path, node.source, name)
        if part is None or part.root is None:
            return False
        if part.root.tag != "mujoco":
            message = f"{name} is a <{part.root.tag}>, and only a <mujoco> is attached here"
            self._tell(node.source, message, name)
            return False
        key = f"attached_{len(self.attached)}.xml"
        self.attached[key] = Node(tag="mujoco", source=node.source, folder=path.parent)
        node.attributes["file"] = key
        self.attached[key] = self.tree(part, above)
        return True

    def _tell(self, source: Source, message: str, subject: str) -> None:
        self.problems.append(
            Problem(code="XML012", message=message, source=source, subject=subject)
        )

    def _too_deep(self, source: Source) -> None:
        if not self._deep:
            message = f"elements are nested more than {_MOST_DEPTH} deep; MuJoCo refuses that"
            self.problems.append(Problem(code="XML011", message=message, source=source))
        self._deep, self.whole = True, False


def _bare(file: str) -> str:
    """Return the name of a file without folders: MuJoCo's parser looks whether it is there."""
    return re.split(r"[/\\]", file)[-1] or file


def _plain(name: str, element: "etree._Element") -> str:
    """Return a name as it is written, with the prefix of its namespace."""
    if not name.startswith("{"):
        return name
    namespace, _, local = name[1:].partition("}")
    prefixes = {uri: prefix for prefix, uri in element.nsmap.items()}
    prefix = prefixes.get(namespace)
    return f"{prefix}:{local}" if prefix else local


def _same(path: Path) -> Path:
    """Return one path for each file."""
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError):  # a loop of links, a NUL character
        return path


def bound(document: MjcfDocument) -> None:
    """See to it that the model stays small: replicas are not made, or nothing is read at all."""
    if sum(1 for _ in document.nodes()) <= MAX_ELEMENTS:
        if _cost(document) <= MAX_ELEMENTS:
            return
        replicas = [node for node in document.nodes() if node.tag == "replicate"]
        for node in replicas:
            node.attributes["count"] = "1"
        if replicas and _cost(document) <= MAX_ELEMENTS:
            _tell_size(document, replicas[0], "no replicas are made")
            document.whole = False
            return
    _tell_size(document, document.root, "nothing of the model is read")
    document.root.children.clear()
    document.attached.clear()
    document.whole = False


def _tell_size(document: MjcfDocument, node: Node, what: str) -> None:
    message = (
        f"{what}: it has more than {MAX_ELEMENTS} elements, long attributes counted as several, "
        "and MuJoCo's parser takes the square of that in time"
    )
    document.problems.append(
        Problem(code="XML011", message=message, source=node.source, subject=node.owner)
    )


def _cost(document: MjcfDocument) -> int:
    """Return the number of elements once all replicas are made; what is attached counts each time.

    Long attributes count as further elements.
    """
    costs: dict[str, int] = {}
    for key in reversed(document.attached):  # an attached model comes after the one that names it
        costs[key] = _cost_of(document, document.attached[key], costs)
    return _cost_of(document, document.root, costs)


def _cost_of(document: MjcfDocument, root: Node, models: Mapping[str, int]) -> int:
    nodes = list(root.walk())
    files = {
        node.attributes.get("name") or document.attached[file].attributes.get("model", ""): file
        for node in nodes
        if node.tag == "model" and (file := node.attributes.get("file")) in document.attached
    }
    costs: dict[Node, int] = {}
    for node in reversed(nodes):  # children before their parents
        cost = sum(costs.pop(child) for child in node.children)
        if node.tag == "replicate":
            count = re.fullmatch(r"\s*\+?([0-9]{1,30})\s*", node.attributes.get("count", ""))
            cost *= int(count[1]) if count else 1
        elif node.tag == "attach":
            cost += models.get(files.get(node.attributes.get("model", ""), ""), 0)
        costs[node] = 1 + cost + sum(map(len, node.attributes.values())) // _ARRAYS
    return costs[root]


def _text(root: Node, lines: list[Node]) -> str:
    """Return a tree as text, one element on each line, and add the node of each to `lines`."""
    from xml.sax.saxutils import quoteattr  # it brings urllib along

    parts: list[str] = []
    stack: list[Node | str] = [root]
    while stack:
        node = stack.pop()
        if isinstance(node, str):
            parts.append(node)
            continue
        lines.append(node)
        attributes = "".join(f" {k}={quoteattr(v)}" for k, v in node.attributes.items())
        parts.append(f"{chr(10) if parts else ''}<{node.tag}{attributes}>")
        stack.append(f"</{node.tag}>")
        stack.extend(reversed(node.children))
    return "".join(parts)
