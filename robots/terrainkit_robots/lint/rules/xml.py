"""What is written: rules on the text of the file. The readers found it; here it gets its name."""

from collections.abc import Iterator

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.fix import Fix, RemoveAttribute, RemoveElement, SetAttribute
from terrainkit_robots.description.model import Problem
from terrainkit_robots.description.xml.document import without_mark
from terrainkit_robots.lint.rule import Severity, Violation, rule


def _problems(robot: Facts, code: str) -> Iterator[Problem]:
    return (problem for problem in robot.model.problems if problem.code == code)


def _defect(
    robot: Facts, problem: Problem, fix: Fix | None = None, severity: Severity | None = None
) -> Violation:
    return Violation(
        subject=problem.subject or robot.model.name or problem.source.file.name,
        source=problem.source,
        message=problem.message,
        severity=severity,
        fix=fix,
    )


@rule("XML001", "malformed-xml", "error")
def malformed_xml(robot: Facts) -> Iterator[Violation]:
    """The file is not well-formed XML.

    Readers differ in what they make of a broken file: some stop, some lose every element after the
    mistake without a word. What can be recovered is checked all the same, so that one missing
    bracket does not hide the rest.

    Fix:
        Repair the XML at the line given; an editor that knows XML shows the same place.

    Source:
        XML 1.0, section 2.1; the message is libxml2's.
    """
    for problem in _problems(robot, "XML001"):
        yield _defect(robot, problem)


@rule("XML002", "unknown-root", "error")
def unknown_root(robot: Facts) -> Iterator[Violation]:
    """The root element is neither <robot> nor <mujoco>.

    The file is something else (SDF, a launch file, a scene), or its root was lost. Nothing in it is
    read as a robot.

    Fix:
        Give the URDF, xacro or MJCF file of the robot. SDF has to be converted first.

    Source:
        The URDF specification (wiki.ros.org/urdf/XML) and MuJoCo's XML reference.
    """
    for problem in _problems(robot, "XML002"):
        yield _defect(robot, problem)


@rule("XML003", "unnamed-robot", "warning", fixes="safe")
def unnamed_robot(robot: Facts) -> Iterator[Violation]:
    """The robot has no name.

    URDF requires one: urdfdom and everything built on it refuse a <robot> without a name, other
    readers invent one.

    Fix:
        Add a name attribute to <robot>.

    Source:
        wiki.ros.org/urdf/XML/robot: the attribute `name` is required.
    """
    for problem in _problems(robot, "XML003"):
        name = "".join(c if c.isalnum() and c.isascii() else "_" for c in robot.model.file.stem)
        name = name if name[:1].isalpha() else f"robot_{name}"
        edit = SetAttribute(source=problem.source, name="name", value=name)
        fix = Fix(safety="safe", description=f"Call it {name}, after its file.", edits=(edit,))
        yield _defect(robot, problem, fix if problem.source.element is not None else None)


@rule("XML004", "unexpanded-xacro", "error")
def unexpanded_xacro(robot: Facts) -> Iterator[Violation]:
    """Xacro was left in a file that is read as plain URDF.

    To a URDF reader a macro is an unknown element that is skipped, and `${length}` is no number:
    whole legs vanish, or sizes become zero.

    Fix:
        Call the file .xacro and check that, or expand it: xacro robot.xacro > robot.urdf.

    Source:
        wiki.ros.org/xacro: expansion is a step of its own, before the file is a URDF.
    """
    for problem in _problems(robot, "XML004"):
        yield _defect(robot, problem)


@rule("XML005", "xacro-failed", "error")
def xacro_failed(robot: Facts) -> Iterator[Violation]:
    """The xacro file could not be expanded.

    An argument has no value, a package is not on this machine, or an expression fails. Without
    expansion there is no robot to check.

    Fix:
        Give the argument with --xacro-arg name:=value, the package with --package name=folder.

    Source:
        wiki.ros.org/xacro; the message is that of the xacro package.
    """
    for problem in _problems(robot, "XML005"):
        yield _defect(robot, problem)


@rule("XML006", "invalid-number", "error", fixes="safe")
def invalid_number(robot: Facts) -> Iterator[Violation]:
    """A number is not a number, or there are too few or too many of them.

    Readers take what they can: "0,5" is 0 to one and an error to another, a missing third
    coordinate is zero or what was there before, and NaN spreads through the whole simulation.

    Fix:
        Write plain numbers with a decimal point and spaces between them.

    Source:
        urdfdom parses in the C locale; MuJoCo: `bad format in attribute`, `does not have enough
        data`.
    """
    for problem in _problems(robot, "XML006"):
        meant, name = problem.details.get("repaired", ""), problem.details.get("attribute", "")
        fix = None
        if meant and problem.source.element is not None:
            edit = SetAttribute(source=problem.source, name=name, value=meant)
            fix = Fix(safety="safe", description=f'Write {name}="{meant}".', edits=(edit,))
        yield _defect(robot, problem, fix)


@rule("XML007", "unknown-tag", "warning")
def unknown_tag(robot: Facts) -> Iterator[Violation]:
    """A tag or attribute looks like a misspelt one.

    URDF readers skip what they do not know. A <colision> is no collision shape, and a limit with
    an attribute `uper` has an upper limit of 0, without a word from anyone. MuJoCo refuses a MJCF
    file with such a word, which is an error.

    Fix:
        Write the tag or attribute that is named; extensions of your own are best given a name that
        is not like a standard one.

    Source:
        wiki.ros.org/urdf/XML, from link to safety_controller; MuJoCo's XML reference.
    """
    for problem in _problems(robot, "XML007"):
        refused = problem.details.get("refused") == "mujoco"
        yield _defect(robot, problem, severity="error" if refused else None)


@rule("XML008", "duplicate-material", "error", fixes="safe")
def duplicate_material(robot: Facts) -> Iterator[Violation]:
    """A visual or collision has two materials.

    MuJoCo refuses the whole file: `repeated element: 'material'`. Other readers take the first.

    Fix:
        Keep the first material.

    Source:
        Seen in MuJoCo 4.0; wiki.ros.org/urdf/XML/link allows one.
    """
    for problem in _problems(robot, "XML008"):
        fix = None
        if problem.source.element is not None:
            edit = RemoveElement(source=problem.source)
            fix = Fix(safety="safe", description="Take the second material away.", edits=(edit,))
        yield _defect(robot, problem, fix)


@rule("XML009", "byte-order-mark", "error", fixes="safe")
def byte_order_mark(robot: Facts) -> Iterator[Violation]:
    """Something invisible stands before the XML.

    A byte order mark, or a blank line before <?xml ...?>, comes from an editor. Strict readers
    refuse the file with an error that points at nothing to be seen.

    Fix:
        Save the file as UTF-8 without a byte order mark, with <?xml ...?> or <robot> right at its
        start.

    Source:
        XML 1.0, section 2.8: the declaration has to come first. lxml refuses text with a mark that
        was decoded as such, and so do readers that pass strings.
    """
    for problem in _problems(robot, "XML009"):
        yield _defect(robot, problem, without_mark(problem))


@rule("XML010", "entity-declarations", "error")
def entity_declarations(robot: Facts) -> Iterator[Violation]:
    """The file declares entities of its own.

    An entity can pull in another file, or grow to gigabytes. Most readers of robots do not resolve
    them, so that what they stand for is missing; here they are never resolved.

    Fix:
        Write out what the entities stand for, or use xacro properties.

    Source:
        OWASP on XML external entities; tinyxml2, which urdfdom and MuJoCo use, has no entities.
    """
    for problem in _problems(robot, "XML010"):
        yield _defect(robot, problem)


@rule("XML011", "mjcf-parse-error", "error")
def mjcf_parse_error(robot: Facts) -> Iterator[Violation]:
    """MuJoCo's own parser refuses the file.

    The message is MuJoCo's. The element was left out, and the rest is checked.

    Fix:
        Repair the element as MuJoCo's XML reference describes it.

    Source:
        mujoco.MjSpec.from_string, the parser behind every MuJoCo loader.
    """
    for problem in _problems(robot, "XML011"):
        yield _defect(robot, problem)


@rule("XML012", "invalid-include", "error")
def invalid_include(robot: Facts) -> Iterator[Violation]:
    """An included file is missing, includes itself, or cannot be read.

    MuJoCo refuses the whole model for it. What is not in that file is checked.

    Fix:
        Put the file where the include says, relative to the folder of the main file.

    Source:
        MuJoCo's XML reference, `include`.
    """
    for problem in _problems(robot, "XML012"):
        yield _defect(robot, problem)


@rule("XML013", "missing-attribute", "error")
def missing_attribute(robot: Facts) -> Iterator[Violation]:
    """An element lacks what it cannot do without.

    A link without a name, a mesh without a file or a box without a size: readers refuse it, or take
    an empty name and a size of zero.

    Fix:
        Add the attribute or element that is named.

    Source:
        wiki.ros.org/urdf/XML: what is marked as required there.
    """
    for problem in _problems(robot, "XML013"):
        yield _defect(robot, problem)


@rule("XML014", "unsupported-quaternion", "error", fixes="unsafe")
def unsupported_quaternion(robot: Facts) -> Iterator[Violation]:
    """A rotation is written as a quaternion, which simulators skip.

    `quat_xyzw` came with URDF 1.1. MuJoCo and yourdfpy take such an origin for one that is not
    turned, without a word: links and joints point another way than in the tool that wrote the file.
    Readers of URDF 1.0 skip it too, or refuse the file for its version.

    Fix:
        Write the same rotation as roll, pitch and yaw, with which the file may be of version 1.0.
        `terrainkit onboard` does so, too.

    Source:
        Pull requests 194 and 235 of urdfdom; seen skipped by MuJoCo 4.0 and yourdfpy 0.0.60.
    """
    for problem in _problems(robot, "XML014"):
        fix = None
        if problem.source.element is not None:
            rpy = problem.details["rpy"]
            edits = (
                SetAttribute(source=problem.source, name="rpy", value=rpy),
                RemoveAttribute(source=problem.source, name="quat_xyzw"),
            )
            fix = Fix(safety="unsafe", description=f'Write rpy="{rpy}".', edits=edits)
        yield _defect(robot, problem, fix)
