"""Rules on names and references of links and joints."""

from collections.abc import Mapping, Sequence

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Joint, Link
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule
from terrainkit_robots.text import group, names


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
