"""Rules on the XML document: syntax, root element, xacro and included files."""

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import rule


@rule("XML001", "malformed-xml", "error", fixes="safe", is_fatal=True)
def malformed_xml(robot: Facts) -> None:
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


@rule("XML009", "byte-order-mark", "warning", fixes="safe")
def byte_order_mark(robot: Facts) -> None:
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


@rule("XML010", "entity-declarations", "error")
def entity_declarations(robot: Facts) -> None:
    """The file declares its own XML entities.

    An entity can include another file or expand to gigabytes. Most robot readers do not resolve
    entities, so their content is missing. check-robot never resolves them.

    Fix:
        Replace the entities by their content, or use xacro properties.

    Source:
        OWASP on XML external entities; tinyxml2, which urdfdom and MuJoCo use, does not support
        entities.
    """


@rule("XML011", "mjcf-parse-error", "error", is_fatal=True)
def mjcf_parse_error(robot: Facts) -> None:
    """MuJoCo cannot parse the MJCF file.

    The message is from MuJoCo. check-robot skips the element and checks the rest.

    Fix:
        Correct the element according to MuJoCo's XML reference.

    Source:
        mujoco.MjSpec.from_string, the parser behind every MuJoCo loader.
    """


@rule("XML002", "unknown-root", "error", is_fatal=True)
def unknown_root(robot: Facts) -> None:
    """The file is neither URDF, xacro nor MJCF.

    The file is in another format, such as SDF, USD or a launch file, or its root element is
    missing. No robot can be read from it.

    Fix:
        Pass the URDF, xacro or MJCF file of the robot. Convert SDF or USD to one of these first.

    Source:
        The URDF specification (wiki.ros.org/urdf/XML) and MuJoCo's XML reference.
    """


@rule("XML003", "unnamed-robot", "warning", fixes="safe")
def unnamed_robot(robot: Facts) -> None:
    """The robot has no name.

    URDF requires a name. urdfdom and the tools built on it reject a <robot> without a name. Other
    readers make one up.

    Fix:
        Add a `name` attribute to <robot>.

    Source:
        wiki.ros.org/urdf/XML/robot: the attribute `name` is required.
    """


@rule("XML004", "unexpanded-xacro", "error")
def unexpanded_xacro(robot: Facts) -> None:
    """A plain URDF file contains xacro.

    A URDF reader skips macros as unknown elements and cannot parse `${length}` as a number. Whole
    legs disappear, or sizes become zero.

    Fix:
        Rename the file to .xacro, or expand it: xacro robot.xacro > robot.urdf.

    Source:
        wiki.ros.org/xacro: xacro is expanded before the file is read as URDF.
    """


@rule("XML005", "xacro-failed", "error", is_fatal=True)
def xacro_failed(robot: Facts) -> None:
    """The xacro file cannot be expanded.

    An argument has no value, a package is not found, or an expression is invalid. Without the
    expanded file there is no robot to check.

    Fix:
        Set the argument with --xacro-arg name:=value, or the package with --package NAME=DIR.

    Source:
        wiki.ros.org/xacro. The message is from the xacro package.
    """


@rule("XML012", "invalid-include", "error")
def invalid_include(robot: Facts) -> None:
    """An included file is missing, includes itself, or cannot be read.

    MuJoCo rejects the whole model. check-robot checks the other files.

    Fix:
        Put the file at the included path, which is relative to the folder of the main file.

    Source:
        MuJoCo's XML reference, `include`.
    """
