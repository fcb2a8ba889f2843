"""Rules on elements and their attributes."""

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.lint.rule import rule


@rule("XML006", "invalid-number", "error", fixes="safe")
def invalid_number(robot: Facts) -> None:
    """An attribute is not a number, or has too few or too many numbers.

    Readers disagree about invalid numbers: "0,5" is 0 or an error, and a missing third coordinate
    is 0 or undefined. NaN spreads through the whole simulation. A version of <robot> other than 1.0
    to 1.2, which urdfdom rejects, is a warning.

    Fix:
        Write numbers with a decimal point, separated by spaces.

    Source:
        urdfdom parses numbers in the C locale; MuJoCo: `bad format in attribute`, `does not have
        enough data`.
    """


@rule("XML007", "unknown-tag", "warning")
def unknown_tag(robot: Facts) -> None:
    """A tag or attribute is unknown and similar to a standard one.

    URDF readers silently skip unknown names. A <colision> adds no collision shape, and a limit with
    an attribute `uper` has an upper limit of 0. MuJoCo rejects an MJCF file with an unknown name,
    so there it is an error.

    Fix:
        Correct the spelling. Rename your own extensions if they resemble standard names.

    Source:
        wiki.ros.org/urdf/XML, from link to safety_controller; MuJoCo's XML reference.
    """


@rule("XML019", "unread-element", "warning")
def unread_element(robot: Facts) -> None:
    """An element is in a place where it is not read, or belongs to another format.

    URDF readers silently skip a <ros2_control> or a <transmission> inside of <gazebo>, and a link
    inside of another one. They skip <pose> of SDF as well, so that a joint without an <origin>
    lies in the frame of its parent. Damping as an attribute of <limit> or as an element in
    <dynamics>, an <origin> of a link, and an element of another name with the attributes of
    <dynamics> have no effect either. A joint of SDF inside of <gazebo> closes a loop; it is
    reported if it cannot.

    Fix:
        Make the element a child of <robot>, or write what the message names.

    Source:
        Issue 1602 of ros2_control, issue 2 of botanbot_sim, issue 1469 of bullet3 and issue 18796
        of drake; wiki.ros.org/urdf/XML. The contents of plugins, sensors and other extensions, and
        links of SDF inside of <gazebo>, are not checked.
    """


@rule("XML013", "missing-attribute", "error", fixes="safe")
def missing_attribute(robot: Facts) -> None:
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


@rule("XML015", "repeated-element", "error", fixes="safe")
def repeated_element(robot: Facts) -> None:
    """An element that may occur once occurs twice.

    Examples are two <inertial> in a link and two <axis> in a joint, often left behind when a file
    was merged. MuJoCo rejects most of them; other readers silently take the first or the last.

    Fix:
        Remove the wrong element. The safe fix removes an exact copy.

    Source:
        wiki.ros.org/urdf/XML; MuJoCo 4.0: "repeated element".
    """


@rule("XML008", "duplicate-material", "error", fixes="safe")
def duplicate_material(robot: Facts) -> None:
    """A visual or collision has two materials.

    MuJoCo rejects the whole file: `repeated element: 'material'`. Other readers use the first one.

    Fix:
        Remove all materials but the first.

    Source:
        Observed in MuJoCo 4.0; wiki.ros.org/urdf/XML/link allows one material.
    """


@rule("XML016", "undefined-material", "warning")
def undefined_material(robot: Facts) -> None:
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


@rule("XML014", "unsupported-quaternion", "error", fixes="unsafe", onboarding="converts")
def unsupported_quaternion(robot: Facts) -> None:
    """A rotation is given as a quaternion, which simulators ignore.

    URDF 1.1 introduced `quat_xyzw`. MuJoCo silently ignores it, so links and joints have another
    orientation than in the tool that wrote the file. Readers of URDF 1.0 ignore it as well, or
    reject the file because of its version.

    Fix:
        Write the same rotation as `rpy`; the file can then be version 1.0. `terrainkit onboard`
        converts it, too.

    Source:
        Pull requests 194 and 235 of urdfdom; MuJoCo 4.0 ignores it.
    """


@rule("XML018", "rotation-in-degrees", "warning")
def rotation_in_degrees(robot: Facts) -> None:
    """A rotation is in degrees, but is read as radians.

    An angle of 90 is read as 14 turns and 117 degrees. The part points in a direction that looks
    random.

    Fix:
        Write the angles in radians: 90 degrees are 1.5708. MJCF with <compiler angle="degree"/>
        takes degrees.

    Source:
        http://wiki.ros.org/urdf/XML/link: rpy in radians. Angles of more than a turn are reported,
        unless they are multiples of 7.5 degrees.
    """
