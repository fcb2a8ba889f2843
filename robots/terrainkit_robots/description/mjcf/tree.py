"""Read an MJCF document and the files it includes into one tree.

MuJoCo reports the line of an element, but not its file, and opens every file that is named.
Includes are resolved here, elements that would open files or allocate much memory are removed, and
the tree is written with one element per line, so that a line identifies an element.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from lxml import etree

from terrainkit_robots.description.fix import Fix
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
"""Maximum number of elements; MuJoCo's parser needs quadratic time, seconds for this many."""

_MAX_DEPTH = 400
"""Maximum depth of nested elements; MuJoCo's parser stops at 500."""

MAX_FILES = 200
"""Maximum number of files of a model."""

_CHARS_PER_ELEMENT = 1000
"""Number of characters of attributes that count as one element."""

_EXCLUDED_ATTRIBUTES = {
    "*": {"user"},
    "hfield": {"nrow", "ncol", "elevation"},
    "mesh": {"builtin", "params"},
    "numeric": {"size"},
}
"""Attributes that make MuJoCo's parser allocate memory, and do not describe the robot."""

_UNREAD_SECTIONS = ("deformable", "extension", "custom")
"""Sections whose elements no robot has. Sensors are generated."""

_EXCLUDED_TAGS = frozenset({"flexcomp", "deformable", "skin", "extension"})
"""Elements that are skipped: soft bodies, skins, and plugins that may not be installed."""


@dataclass(eq=False, slots=True)
class Node:
    """An element of the tree; elements that MuJoCo rejects are removed."""

    tag: str
    source: Source
    folder: Path
    """Folder of the model that the element belongs to; mesh files are relative to it."""

    parent: "Node | None" = None
    attributes: dict[str, str] = field(default_factory=dict)
    """Attributes that are passed to MuJoCo."""

    written: Mapping[str, str] = field(default_factory=dict)
    """Attributes as written in the file."""

    children: list["Node"] = field(default_factory=list)

    def walk(self) -> Iterator["Node"]:
        """Yield the node and its descendants in document order."""
        stack = [self]
        while stack:
            node = stack.pop()
            yield node
            stack.extend(reversed(node.children))

    def elements(self) -> Iterator["Node"]:
        """Yield the elements of a body, including elements in frames."""
        for child in self.children:
            yield child
            if child.tag in ("frame", "replicate"):
                yield from child.elements()

    def remove(self) -> bool:
        """Remove the node from the tree; return False if it is the root."""
        if self.parent is None:
            return False
        self.parent.children.remove(self)
        self.parent = None
        return True

    default_name: str = ""
    """Generated name of a body that has none."""

    @property
    def name(self) -> str:
        """Return the name of the node, or its generated name."""
        return self.written.get("name", "") or self.default_name

    @property
    def owner(self) -> str:
        """Return the name of the nearest named element, starting at the node itself."""
        node: Node | None = self
        while node is not None and not node.name:
            node = node.parent
        return "" if node is None else node.name


@dataclass(eq=False)
class MjcfTree:
    """Trees of a model and of the models that it attaches."""

    root: Node
    attached: dict[str, Node] = field(default_factory=dict)
    """Attached models by the file name that `model` elements refer to."""

    problems: list[Problem] = field(default_factory=list)
    sources: list[Path] = field(default_factory=list)
    """Every file that was read."""

    unread: Counter[str] = field(default_factory=Counter)
    """Number of elements of each section that is not read, by tag."""

    complete: bool = True
    """Whether the trees contain the whole file; False if elements were skipped."""

    def add_problem(
        self,
        node: Node,
        code: str,
        message: str,
        *,
        subject: str | None = None,
        attribute: str = "",
        severity: Literal["error"] | None = None,
        fix: Fix | None = None,
    ) -> None:
        """Add a problem at a node; its subject is the owner of the node unless it is given."""
        self.problems.append(
            Problem(
                code=code,
                message=message,
                source=node.source,
                subject=node.owner if subject is None else subject,
                attribute=attribute,
                severity=severity,
                fix=fix,
            )
        )

    def nodes(self) -> Iterator[Node]:
        """Yield all nodes of the model and the attached models."""
        for root in (self.root, *self.attached.values()):
            yield from root.walk()

    def write(self) -> tuple[str, dict[str, bytes], list[Node]]:
        """Return the text of the model, the files of attached models, and the node of each line.

        The models are concatenated, so that each line number identifies one element.
        """
        lines: list[Node] = []
        text = _to_text(self.root, lines)
        attached = {
            name: ("\n" * len(lines) + _to_text(root, lines)).encode()
            for name, root in self.attached.items()
        }
        return text, attached, lines


def read_tree(doc: XmlDocument, contents: Mapping[Path, bytes]) -> MjcfTree:
    """Return a document with the files that it includes and attaches.

    Args:
        doc: The main file; it has a root element.
        contents: File contents by path, which are used instead of the files on disk.
    """
    root = Node(tag="", source=doc.source(doc.required_root), folder=doc.file.parent)
    mjcf = MjcfTree(root=root, problems=list(doc.problems))
    reader = _TreeReader(mjcf, contents)
    mjcf.root = reader.tree(doc)
    if mjcf.root.tag != "mujoco":
        message = f"root element: got <{mjcf.root.tag}>, a part of a model; expected <mujoco>"
        mjcf.add_problem(mjcf.root, "XML002", message, subject="")
        mjcf.root.tag = "mujoco"
    if reader.too_deep:
        message = f"elements are nested more than {_MAX_DEPTH} deep; MuJoCo rejects the file"
        mjcf.problems.append(Problem(code="XML011", message=message, source=reader.too_deep[0]))
        mjcf.complete = False
    limit_size(mjcf)
    return mjcf


def is_allowed(tag: str, attribute: str = "") -> bool:
    """Return whether an element or attribute may be passed to MuJoCo's parser."""
    if tag in _EXCLUDED_TAGS | {"include", "model", "plugin"}:
        return False
    return attribute not in _excluded_attributes(tag)


def _excluded_attributes(tag: str) -> set[str]:
    return _EXCLUDED_ATTRIBUTES["*"] | _EXCLUDED_ATTRIBUTES.get(tag, set())


class _TreeReader:
    """Read the files of a model into a tree."""

    def __init__(self, mjcf: MjcfTree, contents: Mapping[Path, bytes]) -> None:
        self._mjcf = mjcf
        self._contents = contents
        self._bytes = 0
        self._count = 0
        self._unnamed = 0
        self.too_deep: list[Source] = []
        """Elements that are not read, since they are nested too deeply."""

    def tree(self, main: XmlDocument, parents: tuple[Path, ...] = ()) -> Node:
        """Return the tree of a model; `parents` are the files of the models that attach it."""
        self._mjcf.sources.append(main.file)
        folder = main.file.parent
        included: dict[Path, tuple[Path, ...]] = {main.file: ()}
        top = Node(tag="", source=main.source(main.required_root), folder=folder)
        stack: list[tuple[etree._Element, XmlDocument, Node, int]] = [
            (main.required_root, main, top, 0)
        ]
        while stack and self._count <= MAX_ELEMENTS:
            element, doc, parent, depth = stack.pop()
            source = doc.source(element)
            if depth > _MAX_DEPTH:
                self.too_deep.append(source)
                continue
            try:
                if element.tag == "include":
                    part = self._load_include(element, doc, folder, included)
                    inner = part.required_root.iterchildren(etree.Element, reversed=True)
                    stack += [(child, part, parent, depth) for child in inner]
                    continue
                node = self._node(element, source, parent, folder)
                if node is not None and node.tag == "model":
                    self._load_attached(node, (*parents, main.file))
            except RobotFileError as error:
                self._report(source, str(error), (element.get("file") or "").strip())
                continue
            if node is not None:
                parent.children.append(node)
                self._count += 1
                children = element.iterchildren(etree.Element, reversed=True)
                stack += [(child, doc, node, depth + 1) for child in children]
        root = top.children[0]
        root.parent = None
        return root

    def _node(
        self, element: "etree._Element", source: Source, parent: Node, folder: Path
    ) -> Node | None:
        """Return the node of an element without excluded attributes, or None."""
        tag = _prefixed_name(element.tag, element)
        written = {_prefixed_name(name, element): value for name, value in element.attrib.items()}
        node = Node(tag=tag, source=source, folder=folder, parent=parent, written=written)
        node.attributes = {
            # without folders, because MuJoCo's parser checks whether files exist
            k: re.split(r"[/\\]", v)[-1] or v if k.startswith("file") and tag != "model" else v
            for k, v in written.items()
            if k not in _excluded_attributes(tag)
        }
        if tag == "body" and not node.name:
            self._unnamed += 1
            node.default_name = f"unnamed_body_{self._unnamed}"
        if tag in _UNREAD_SECTIONS and len(element):
            self._mjcf.unread[tag] += len(element)
        if tag in _EXCLUDED_TAGS:
            self._mjcf.complete = self._mjcf.complete and tag != "flexcomp"
            return None
        if tag == "plugin" and parent.tag == "actuator":
            node.tag = "general"  # it acts on a joint like any other actuator
            node.attributes = {
                k: v for k, v in node.attributes.items() if k not in ("plugin", "instance")
            }
        elif tag == "plugin" or (tag == "config" and parent.written.get("plugin") is not None):
            return None
        return node

    def _load_include(
        self,
        element: "etree._Element",
        doc: XmlDocument,
        folder: Path,
        included: dict[Path, tuple[Path, ...]],
    ) -> XmlDocument:
        """Return the document of an <include>.

        Raises:
            RobotFileError: If it cannot be included.
        """
        name = (element.get("file") or "").strip()
        chain = (*included[doc.file], _real_path(doc.file))
        if len(element):
            message = f"<include file={name!r}> has children; MuJoCo rejects the file"
            self._report(doc.source(element), message, name)
        path = folder / name
        sibling = doc.file.parent / name
        if not self._exists(path) and self._exists(sibling):
            path = sibling
        is_cyclic = _real_path(path) in chain
        if is_cyclic or path in included:  # MuJoCo includes one file by several links
            how = "by itself" if is_cyclic else "twice"
            raise RobotFileError(f"{name} is included {how}; MuJoCo rejects the file")
        part = self._read(path, name, "include")
        included[path] = chain
        self._mjcf.sources.append(path)
        if not len(part.required_root):
            raise RobotFileError(f"{name} is empty; expected elements to include")
        return part

    def _exists(self, path: Path) -> bool:
        return path in self._contents or exists(path)

    def _read(self, path: Path, name: str, tag: str) -> XmlDocument:
        """Return a document with a root that an element names.

        Raises:
            RobotFileError: If it cannot be read.
        """
        if not name:
            raise RobotFileError(f"<{tag}> has no file")
        if len(self._mjcf.sources) >= MAX_FILES or self._bytes > MAX_BYTES:
            raise RobotFileError(f"{name} is not read: too many included files, or too much data")
        try:
            data = self._contents[path] if path in self._contents else read_bytes(path)
        except RobotFileError as error:
            self._mjcf.complete = False
            raise RobotFileError(f"{name}: {error}") from None
        self._bytes += len(data)
        part = parse_xml(path, data)
        self._mjcf.problems += part.problems
        if part.root is None:
            raise RobotFileError(f"{name} could not be parsed")
        return part

    def _load_attached(self, node: Node, parents: tuple[Path, ...]) -> None:
        """Read the model of a <model> element.

        Raises:
            RobotFileError: If it cannot be attached.
        """
        name = node.written.get("file", "")
        path = node.folder / name
        if name and _real_path(path) in map(_real_path, parents):
            raise RobotFileError(f"{name} attaches itself")
        part = self._read(path, name, "model")
        tag = part.required_root.tag
        if tag != "mujoco":
            raise RobotFileError(f"root element of {name}: got <{tag}>; expected <mujoco>")
        key = f"attached_{len(self._mjcf.attached)}.xml"
        self._mjcf.attached[key] = Node(tag="mujoco", source=node.source, folder=path.parent)
        node.attributes["file"] = key
        self._mjcf.attached[key] = self.tree(part, parents)

    def _report(self, source: Source, message: str, subject: str) -> None:
        self._mjcf.problems.append(
            Problem(code="XML012", message=message, source=source, subject=subject)
        )


def _prefixed_name(name: str, element: "etree._Element") -> str:
    """Return a name as written, with its namespace prefix."""
    if not name.startswith("{"):
        return name
    namespace, _, local = name[1:].partition("}")
    prefixes = {uri: prefix for prefix, uri in element.nsmap.items()}
    prefix = prefixes.get(namespace)
    return f"{prefix}:{local}" if prefix else local


def _real_path(path: Path) -> Path:
    """Return the real path, which is the same for all names of a file."""
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError):  # a cycle of symbolic links, a NUL character
        return path


def limit_size(tree: MjcfTree) -> None:
    """Keep the model small: remove replicas or, if that is not enough, everything."""
    if _total_size(tree) <= MAX_ELEMENTS:
        return
    replicas = [node for node in tree.nodes() if node.tag == "replicate"]
    for node in replicas:
        node.attributes["count"] = "1"
    if replicas and _total_size(tree) <= MAX_ELEMENTS:
        node, what = replicas[0], "replicas are not created"
    else:
        node, what = tree.root, "the model is not read"
        tree.root.children.clear()
        tree.attached.clear()
    tree.complete = False
    message = (
        f"number of elements: more than {MAX_ELEMENTS}, long attributes count as several; {what}, "
        "because MuJoCo's parser needs quadratic time"
    )
    tree.add_problem(node, "XML011", message)


def _total_size(tree: MjcfTree) -> int:
    """Return the number of elements, or after replication with each attached copy if it is more.

    Long attributes count as further elements.
    """
    sizes: dict[str, int] = {}
    # attached models follow the models that name them
    for key, root in reversed([("", tree.root), *tree.attached.items()]):
        sizes[key] = _tree_size(tree, root, sizes)
    return max(sizes[""], sum(1 for _ in tree.nodes()))


def _tree_size(tree: MjcfTree, root: Node, models: Mapping[str, int]) -> int:
    nodes = list(root.walk())
    files = {
        node.attributes.get("name") or tree.attached[file].attributes.get("model", ""): file
        for node in nodes
        if node.tag == "model" and (file := node.attributes.get("file")) in tree.attached
    }
    sizes: dict[Node, int] = {}
    for node in reversed(nodes):  # children before their parents
        size = sum(sizes.pop(child) for child in node.children)
        if node.tag == "replicate":
            count = re.fullmatch(r"\s*\+?([0-9]{1,30})\s*", node.attributes.get("count", ""))
            size *= int(count[1]) if count else 1
        elif node.tag == "attach":
            size += models.get(files.get(node.attributes.get("model", ""), ""), 0)
        sizes[node] = 1 + size + sum(map(len, node.attributes.values())) // _CHARS_PER_ELEMENT
    return sizes[root]


def _to_text(root: Node, lines: list[Node]) -> str:
    """Return a tree as text with one element per line, and append the nodes to `lines`."""
    from xml.sax.saxutils import quoteattr  # imports urllib

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
