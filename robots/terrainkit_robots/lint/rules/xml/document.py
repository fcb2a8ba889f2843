"""Rules on the XML document: syntax, root element, xacro and included files."""

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.fix import SetAttribute, make_fix
from terrainkit_robots.description.xml.document import leading_bytes_fix, version_fix
from terrainkit_robots.lint.problems import problem_violation, problem_violations, problems
from terrainkit_robots.lint.rule import Severity, Violations, rule


@rule("XML001", "malformed-xml", "error", fixes="safe", is_fatal=True)
def malformed_xml(robot: Facts) -> Violations:
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
    for problem in problems(robot, "XML001"):
        fix = version_fix(problem)
        yield problem_violation(robot, problem, fix, "warning" if fix is not None else None)


@rule("XML009", "byte-order-mark", "warning", fixes="safe")
def byte_order_mark(robot: Facts) -> Violations:
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
    for problem in problems(robot, "XML009"):
        severity: Severity | None = "error" if "text" in problem.details else None
        yield problem_violation(robot, problem, leading_bytes_fix(problem), severity)


@rule("XML010", "entity-declarations", "error")
def entity_declarations(robot: Facts) -> Violations:
    """The file declares its own XML entities.

    An entity can include another file or expand to gigabytes. Most robot readers do not resolve
    entities, so their content is missing. check-robot never resolves them.

    Fix:
        Replace the entities by their content, or use xacro properties.

    Source:
        OWASP on XML external entities; tinyxml2, which urdfdom and MuJoCo use, does not support
        entities.
    """
    return problem_violations(robot, "XML010")


@rule("XML011", "mjcf-parse-error", "error", is_fatal=True)
def mjcf_parse_error(robot: Facts) -> Violations:
    """MuJoCo cannot parse the MJCF file.

    The message is from MuJoCo. check-robot skips the element and checks the rest.

    Fix:
        Correct the element according to MuJoCo's XML reference.

    Source:
        mujoco.MjSpec.from_string, the parser behind every MuJoCo loader.
    """
    return problem_violations(robot, "XML011")


@rule("XML002", "unknown-root", "error", is_fatal=True)
def unknown_root(robot: Facts) -> Violations:
    """The file is neither URDF, xacro nor MJCF.

    The file is in another format, such as SDF, USD or a launch file, or its root element is
    missing. No robot can be read from it.

    Fix:
        Pass the URDF, xacro or MJCF file of the robot. Convert SDF or USD to one of these first.

    Source:
        The URDF specification (wiki.ros.org/urdf/XML) and MuJoCo's XML reference.
    """
    return problem_violations(robot, "XML002")


@rule("XML003", "unnamed-robot", "warning", fixes="safe")
def unnamed_robot(robot: Facts) -> Violations:
    """The robot has no name.

    URDF requires a name. urdfdom and the tools built on it reject a <robot> without a name. Other
    readers make one up.

    Fix:
        Add a `name` attribute to <robot>.

    Source:
        wiki.ros.org/urdf/XML/robot: the attribute `name` is required.
    """
    for problem in problems(robot, "XML003"):
        name = "".join(c if c.isalnum() and c.isascii() else "_" for c in robot.model.file.stem)
        name = name if name[:1].isalpha() else f"robot_{name}"
        edit = SetAttribute(source=problem.source, name="name", value=name)
        fix = make_fix("safe", f'Add name="{name}", from the file name.', [edit])
        yield problem_violation(robot, problem, fix)


@rule("XML004", "unexpanded-xacro", "error")
def unexpanded_xacro(robot: Facts) -> Violations:
    """A plain URDF file contains xacro.

    A URDF reader skips macros as unknown elements and cannot parse `${length}` as a number. Whole
    legs disappear, or sizes become zero.

    Fix:
        Rename the file to .xacro, or expand it: xacro robot.xacro > robot.urdf.

    Source:
        wiki.ros.org/xacro: xacro is expanded before the file is read as URDF.
    """
    return problem_violations(robot, "XML004")


@rule("XML005", "xacro-failed", "error", is_fatal=True)
def xacro_failed(robot: Facts) -> Violations:
    """The xacro file cannot be expanded.

    An argument has no value, a package is not found, or an expression is invalid. Without the
    expanded file there is no robot to check.

    Fix:
        Set the argument with --xacro-arg name:=value, or the package with --package NAME=DIR.

    Source:
        wiki.ros.org/xacro. The message is from the xacro package.
    """
    return problem_violations(robot, "XML005")


@rule("XML012", "invalid-include", "error")
def invalid_include(robot: Facts) -> Violations:
    """An included file is missing, includes itself, or cannot be read.

    MuJoCo rejects the whole model. check-robot checks the other files.

    Fix:
        Put the file at the included path, which is relative to the folder of the main file.

    Source:
        MuJoCo's XML reference, `include`.
    """
    return problem_violations(robot, "XML012")
