"""Rules on names and references of links and joints."""

import re
from collections.abc import Mapping, Sequence

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.symmetry.mirror import swap_sides
from terrainkit_robots.description.model import Joint, Link
from terrainkit_robots.lint.rule import Part, Violation, Violations, findings_of, rule
from terrainkit_robots.text import group, names

_NUMBER = re.compile(r"\d+")

_MAX_LEFT_OUT = 2
"""Number of joints that a list may lack by mistake. More are passive by design."""


def _duplicates(items: Sequence[Link] | Sequence[Joint]) -> Mapping[str, list[Link | Joint]]:
    """Return the items that share a name. XML013 reports missing names."""
    by_name = group((item.name, item) for item in items if item.name)
    return {name: same for name, same in by_name.items() if len(same) > 1}


@rule("TRE001", "duplicate-name", "error")
def duplicate_name(robot: Facts) -> Violations:
    """Two links or two joints have the same name.

    Names identify links and joints. urdfdom rejects the file. MuJoCo accepts a second joint of the
    same name, but silently drops its limits. The rest of this report uses the first one.

    Fix:
        Give each a unique name and update the references to the second one.

    Source:
        urdfdom: `joint '...' is not unique`; MuJoCo: `repeated URDF name`, for links only.
    """
    model = robot.model
    for what, items in (
        ("links", [link for link in model.links if not link.virtual]),
        ("joints", model.joints),
    ):
        for name, same in _duplicates(items).items():
            lines = names(str(item.source.line) for item in same)
            yield Violation(
                element=Part(name, same[1].source),
                message=f"name {truncate(name)}: used by {len(same)} {what}, on lines {lines}; "
                "expected unique names",
                measured={"count": len(same)},
            )


@rule("TRE010", "invalid-reference", "warning")
def invalid_reference(robot: Facts) -> None:
    """A tag for another tool names a link or joint that does not exist.

    The names in <gazebo>, <transmission>, <sensor> and <ros2_control> were not changed when a link
    or joint was renamed, removed or copied. A sensor, the friction of a foot or a motor is then
    missing in that tool, or its controllers do not start. Two simple transmissions of the same
    joint are also reported, since another joint then has none.

    Fix:
        Correct the name, or remove the element.

    Source:
        wiki.ros.org/urdf/XML: gazebo, transmission and sensor.
    """


@rule("TRE014", "incomplete-list", "warning", certainty="likely")
def incomplete_list(robot: Facts) -> Violations:
    """All joints but one or two have a transmission or a command interface.

    The list of the controllers has the joint's mirror image, or joints with the same name and other
    numbers. The joint itself was forgotten, and is limp in Gazebo and on the real robot.

    Fix:
        Add the joint to the <transmission> elements, or to <ros2_control>. A joint without a motor
        gets another name than the joints with one.

    Source:
        wiki.ros.org/urdf/XML/Transmission; the documentation of ros2_control.
    """
    if any(findings_of(robot, "TRE010")):
        return  # the joint may be the one with a wrong name
    driven = {joint.name for joint in robot.joints if joint.name in robot.model.driven}
    free = [joint for joint in robot.joints if joint.mimic is None and joint.name not in driven]
    numbered = {_NUMBER.sub("#", name) for name in driven}
    for joint in free if len(free) <= _MAX_LEFT_OUT and len(free) < len(driven) else ():
        same = {swap_sides(joint.name)} & driven or {_NUMBER.sub("#", joint.name)} & numbered
        if same:
            yield Violation(
                element=joint,
                message=f"transmission or command interface of joint {truncate(joint.name)}: got "
                f"none; expected one, as the {len(driven)} other joints have",
                measured={"others": len(driven)},
            )
