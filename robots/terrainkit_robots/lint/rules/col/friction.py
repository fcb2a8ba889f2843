"""Rule on the friction of feet."""

from terrainkit_robots.analysis.bodies.shapes import has_bounds, min_height
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Geometry
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule

_MIN_FRICTION, _MAX_FRICTION = 0.1, 10.0
"""Plausible sliding friction of a foot: ice and rubber, with a margin for models with sticky
feet."""


@rule("COL008", "foot-friction", "warning", needs=("legs",), certainty="likely")
def foot_friction(robot: Facts) -> Violations:
    """The friction of a foot is implausible, or differs from the other feet.

    MuJoCo uses the friction of the geom with the higher priority, or the larger friction if both
    priorities are equal. The same holds for condim, which is 1 for contacts without friction. A
    foot without friction slides. A foot with a friction of 100 never slips, and a policy that
    relies on it falls on real ground.

    Fix:
        Give the geoms of all feet the same sliding friction, between 0.4 and 1.2.

    Source:
        MuJoCo's documentation, contact parameters. Published legged robots have 0.4 to 2.
    """
    if robot.model.kind != "mjcf":
        return
    feet = dict[str, tuple[float, Geometry]]()
    for leg in robot.legs:
        body = robot.bodies[leg.limb.chain[-1]]
        shapes = [s for s in body.collisions if has_bounds(s.geometry, robot.meshes)]
        if shapes:
            pose, meshes = body.zero_pose, robot.meshes
            lowest = min(shapes, key=lambda s: min_height(s, pose, meshes)).geometry
            if lowest.friction is not None:
                is_slippery = lowest.condim == 1 and lowest.priority > 0
                feet[leg.foot] = 0.0 if is_slippery else lowest.friction, lowest
    values = [value for value, _ in feet.values()]
    for foot, (value, geometry) in feet.items():
        common = sorted(values)[len(values) // 2]
        if not _MIN_FRICTION <= value <= _MAX_FRICTION:
            expected = f"expected {_MIN_FRICTION:g} to {_MAX_FRICTION:g}"
        elif len(values) > 2 and values.count(value) == 1 and values.count(common) > 1:
            expected = f"expected {common:g}, as on the other feet"
        else:
            continue
        if value == 0 and geometry.friction:
            expected = f"condim 1 and priority {geometry.priority}; expected condim 3"
        yield Violation(
            element=Part(foot, geometry.source),
            message=f"sliding friction of foot {foot}: got {value:g}; {expected}",
            measured={"friction": value},
        )
