"""XML: rules on the text of the file. The readers detect these problems while parsing."""

from collections.abc import Iterator

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.fix import Fix, RemoveAttribute, RemoveElement, SetAttribute
from terrainkit_robots.description.model import Problem
from terrainkit_robots.description.xml.document import leading_bytes_fix, version_fix
from terrainkit_robots.lint.rule import Severity, Violation, rule


def _problems(robot: Facts, code: str) -> Iterator[Problem]:
    return (problem for problem in robot.model.problems if problem.code == code)


def _violation(
    robot: Facts, problem: Problem, fix: Fix | None = None, severity: Severity | None = None
) -> Violation:
    return Violation(
        subject=problem.subject or robot.model.name or problem.source.file.name,
        source=problem.source,
        message=problem.message,
        severity=severity,
        fix=fix,
    )


@rule("XML001", "malformed-xml", "error", fixes="safe")
def malformed_xml(robot: Facts) -> Iterator[Violation]:
    """The file is not well-formed XML.

    Readers handle malformed XML differently: some stop, others silently drop every element after
    the error. Elements that can be recovered are still checked, so that one missing bracket does
    not hide other problems. A version other than 1.0 in <?xml?> is a warning, since MuJoCo and
    urdfdom do not read it.

    Fix:
        Correct the XML at the reported line. An editor with XML support highlights it. The safe fix
        sets the version.

    Source:
        XML 1.0, section 2.1. The message is from libxml2.
    """
    for problem in _problems(robot, "XML001"):
        fix = version_fix(problem)
        yield _violation(robot, problem, fix, "warning" if fix is not None else None)


@rule("XML002", "unknown-root", "error")
def unknown_root(robot: Facts) -> Iterator[Violation]:
    """The root element is neither <robot> nor <mujoco>.

    The file is in another format, such as SDF or a launch file, or its root element is missing.
    No robot can be read from it.

    Fix:
        Pass the URDF, xacro or MJCF file of the robot. Convert SDF to one of these first.

    Source:
        The URDF specification (wiki.ros.org/urdf/XML) and MuJoCo's XML reference.
    """
    for problem in _problems(robot, "XML002"):
        yield _violation(robot, problem)


@rule("XML003", "unnamed-robot", "warning", fixes="safe")
def unnamed_robot(robot: Facts) -> Iterator[Violation]:
    """The robot has no name.

    URDF requires a name. urdfdom and the tools built on it reject a <robot> without a name. Other
    readers make one up.

    Fix:
        Add a `name` attribute to <robot>.

    Source:
        wiki.ros.org/urdf/XML/robot: the attribute `name` is required.
    """
    for problem in _problems(robot, "XML003"):
        name = "".join(c if c.isalnum() and c.isascii() else "_" for c in robot.model.file.stem)
        name = name if name[:1].isalpha() else f"robot_{name}"
        edit = SetAttribute(source=problem.source, name="name", value=name)
        fix = Fix(
            safety="safe", description=f'Add name="{name}", from the file name.', edits=(edit,)
        )
        yield _violation(robot, problem, fix if problem.source.element is not None else None)


@rule("XML004", "unexpanded-xacro", "error")
def unexpanded_xacro(robot: Facts) -> Iterator[Violation]:
    """A plain URDF file contains xacro.

    A URDF reader skips macros as unknown elements and cannot parse `${length}` as a number. Whole
    legs disappear, or sizes become zero.

    Fix:
        Rename the file to .xacro, or expand it: xacro robot.xacro > robot.urdf.

    Source:
        wiki.ros.org/xacro: xacro is expanded before the file is read as URDF.
    """
    for problem in _problems(robot, "XML004"):
        yield _violation(robot, problem)


@rule("XML005", "xacro-failed", "error")
def xacro_failed(robot: Facts) -> Iterator[Violation]:
    """The xacro file cannot be expanded.

    An argument has no value, a package is not found, or an expression is invalid. Without the
    expanded file there is no robot to check.

    Fix:
        Set the argument with --xacro-arg name:=value, or the package with --package NAME=DIR.

    Source:
        wiki.ros.org/xacro. The message is from the xacro package.
    """
    for problem in _problems(robot, "XML005"):
        yield _violation(robot, problem)


@rule("XML006", "invalid-number", "error", fixes="safe")
def invalid_number(robot: Facts) -> Iterator[Violation]:
    """An attribute is not a number, or has too few or too many numbers.

    Readers disagree about invalid numbers: "0,5" is 0 or an error, and a missing third coordinate
    is 0 or undefined. NaN spreads through the whole simulation.

    Fix:
        Write numbers with a decimal point, separated by spaces.

    Source:
        urdfdom parses numbers in the C locale; MuJoCo: `bad format in attribute`, `does not have
        enough data`.
    """
    for problem in _problems(robot, "XML006"):
        value, name = problem.details.get("repaired", ""), problem.details.get("attribute", "")
        fix = None
        if value and problem.source.element is not None:
            edit = SetAttribute(source=problem.source, name=name, value=value)
            fix = Fix(safety="safe", description=f'Set {name}="{value}".', edits=(edit,))
        yield _violation(robot, problem, fix)


@rule("XML007", "unknown-tag", "warning")
def unknown_tag(robot: Facts) -> Iterator[Violation]:
    """A tag or attribute is unknown and similar to a standard one.

    URDF readers silently skip unknown names. A <colision> adds no collision shape, and a limit with
    an attribute `uper` has an upper limit of 0. MuJoCo rejects an MJCF file with an unknown name,
    so there it is an error.

    Fix:
        Correct the spelling. Rename your own extensions if they resemble standard names.

    Source:
        wiki.ros.org/urdf/XML, from link to safety_controller; MuJoCo's XML reference.
    """
    for problem in _problems(robot, "XML007"):
        is_rejected = problem.details.get("refused") == "mujoco"
        yield _violation(robot, problem, severity="error" if is_rejected else None)


@rule("XML008", "duplicate-material", "error", fixes="safe")
def duplicate_material(robot: Facts) -> Iterator[Violation]:
    """A visual or collision has two materials.

    MuJoCo rejects the whole file: `repeated element: 'material'`. Other readers use the first one.

    Fix:
        Remove all materials but the first.

    Source:
        Observed in MuJoCo 4.0; wiki.ros.org/urdf/XML/link allows one material.
    """
    for problem in _problems(robot, "XML008"):
        fix = None
        if problem.source.element is not None:
            edit = RemoveElement(source=problem.source)
            fix = Fix(safety="safe", description="Remove the second material.", edits=(edit,))
        yield _violation(robot, problem, fix)


@rule("XML009", "byte-order-mark", "warning", fixes="safe")
def byte_order_mark(robot: Facts) -> Iterator[Violation]:
    """There are invisible characters before the XML, or the file is UTF-16.

    Some editors write a byte order mark or a blank line before <?xml ...?>. Strict readers reject
    the file, with an error message that points at nothing visible. MuJoCo and urdfdom skip them,
    but cannot read UTF-16 and UTF-32 at all, which is an error.

    Fix:
        Save the file as UTF-8 without a byte order mark, starting with <?xml ...?> or <robot>.

    Source:
        XML 1.0, section 2.8: the declaration must come first. lxml and other readers reject strings
        that start with a byte order mark. MuJoCo 4.0: `XML_ERROR_PARSING`.
    """
    for problem in _problems(robot, "XML009"):
        severity: Severity | None = "error" if "text" in problem.details else None
        yield _violation(robot, problem, leading_bytes_fix(problem), severity)


@rule("XML010", "entity-declarations", "error")
def entity_declarations(robot: Facts) -> Iterator[Violation]:
    """The file declares its own XML entities.

    An entity can include another file or expand to gigabytes. Most robot readers do not resolve
    entities, so their content is missing. check-robot never resolves them.

    Fix:
        Replace the entities by their content, or use xacro properties.

    Source:
        OWASP on XML external entities; tinyxml2, which urdfdom and MuJoCo use, does not support
        entities.
    """
    for problem in _problems(robot, "XML010"):
        yield _violation(robot, problem)


@rule("XML011", "mjcf-parse-error", "error")
def mjcf_parse_error(robot: Facts) -> Iterator[Violation]:
    """MuJoCo cannot parse the MJCF file.

    The message is from MuJoCo. check-robot skips the element and checks the rest.

    Fix:
        Correct the element according to MuJoCo's XML reference.

    Source:
        mujoco.MjSpec.from_string, the parser behind every MuJoCo loader.
    """
    for problem in _problems(robot, "XML011"):
        yield _violation(robot, problem)


@rule("XML012", "invalid-include", "error")
def invalid_include(robot: Facts) -> Iterator[Violation]:
    """An included file is missing, includes itself, or cannot be read.

    MuJoCo rejects the whole model. check-robot checks the other files.

    Fix:
        Put the file at the included path, which is relative to the folder of the main file.

    Source:
        MuJoCo's XML reference, `include`.
    """
    for problem in _problems(robot, "XML012"):
        yield _violation(robot, problem)


@rule("XML013", "missing-attribute", "error", fixes="safe")
def missing_attribute(robot: Facts) -> Iterator[Violation]:
    """A required attribute or element is missing.

    Examples are a link without a name, a mesh without a file, a box without a size and an inertia
    without its products. Readers reject them, or use an empty name and zeros.

    Fix:
        Add the attribute or element that the message names. Products of inertia are 0 for a body
        that is symmetric about the axes of its <inertial>.

    Source:
        wiki.ros.org/urdf/XML: the attributes marked as required; MuJoCo 4.0: `required attribute
        missing: 'ixy'`.
    """
    for problem in _problems(robot, "XML013"):
        products = problem.details.get("attributes", "").split()
        fix = None
        if products and problem.source.element is not None:
            edits = tuple(SetAttribute(source=problem.source, name=n, value="0") for n in products)
            description = f"Set {', '.join(products)} to 0, which lenient readers assume."
            fix = Fix(safety="safe", description=description, edits=edits)
        yield _violation(robot, problem, fix)


@rule("XML014", "unsupported-quaternion", "error", fixes="unsafe")
def unsupported_quaternion(robot: Facts) -> Iterator[Violation]:
    """A rotation is given as a quaternion, which simulators ignore.

    URDF 1.1 introduced `quat_xyzw`. MuJoCo and yourdfpy silently ignore it, so links and joints
    have another orientation than in the tool that wrote the file. Readers of URDF 1.0 ignore it
    as well, or reject the file because of its version.

    Fix:
        Write the same rotation as `rpy`; the file can then be version 1.0. `terrainkit onboard`
        converts it, too.

    Source:
        Pull requests 194 and 235 of urdfdom; MuJoCo 4.0 and yourdfpy 0.0.60 ignore it.
    """
    for problem in _problems(robot, "XML014"):
        fix = None
        if problem.source.element is not None:
            rpy = problem.details["rpy"]
            edits = (
                SetAttribute(source=problem.source, name="rpy", value=rpy),
                RemoveAttribute(source=problem.source, name="quat_xyzw"),
            )
            fix = Fix(safety="unsafe", description=f'Set rpy="{rpy}".', edits=edits)
        yield _violation(robot, problem, fix)


@rule("XML015", "repeated-element", "error", fixes="safe")
def repeated_element(robot: Facts) -> Iterator[Violation]:
    """An element that may occur once occurs twice.

    Examples are two <inertial> in a link and two <axis> in a joint, often left behind when a file
    was merged. MuJoCo rejects most of them; other readers silently take the first or the last.

    Fix:
        Remove the one that is wrong. The safe fix removes an exact copy.

    Source:
        wiki.ros.org/urdf/XML; MuJoCo 4.0: "repeated element".
    """
    for problem in _problems(robot, "XML015"):
        fix = None
        if problem.details.get("copy") and problem.source.element is not None:
            edit = RemoveElement(source=problem.source)
            fix = Fix(safety="safe", description="Remove the copy.", edits=(edit,))
        yield _violation(robot, problem, fix)


@rule("XML016", "undefined-material", "warning")
def undefined_material(robot: Facts) -> Iterator[Violation]:
    """A visual names a material that is not defined.

    A <material> with a name only refers to one with a <color> or a <texture>. urdfdom rejects the
    whole file without one, and so do the ROS tools that use it. Others draw the link in a default
    color.

    Fix:
        Give the material a <color>, or correct its name. A <material> of the robot element is
        valid for all links.

    Source:
        urdfdom: `link '...' material '...' undefined`; wiki.ros.org/urdf/XML/link.
    """
    for problem in _problems(robot, "XML016"):
        yield _violation(robot, problem)


@rule("XML018", "rotation-in-degrees", "warning")
def rotation_in_degrees(robot: Facts) -> Iterator[Violation]:
    """A rotation is in degrees, but is read as radians.

    An angle of 90 is read as 14 turns and 117 degrees. The part points in a direction that looks
    random.

    Fix:
        Write the angles in radians: 90 degrees are 1.5708. MJCF with <compiler angle="degree"/>
        takes degrees.

    Source:
        http://wiki.ros.org/urdf/XML/link: rpy in radians. Angles of more than a turn are reported,
        unless they are whole quarter turns.
    """
    for problem in _problems(robot, "XML018"):
        yield _violation(robot, problem)
