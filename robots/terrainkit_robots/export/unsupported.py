"""List the elements of a robot file that are not exported."""

from collections.abc import Iterator

from terrainkit_robots.description.model import RobotModel
from terrainkit_robots.text import count, names


def unsupported_elements(model: RobotModel) -> Iterator[str]:
    """Yield one line for each kind of element that is not exported, or not to robot.urdf."""
    only_mjcf = {"loop": model.loops, "coupling": model.couplings, "tendon": model.tendons}
    lacking = [count(len(found), what) for what, found in only_mjcf.items() if found]
    if lacking:
        yield f"robot.urdf lacks {names(lacking)} of robot.xml, which URDF cannot have"
    unused = [actuator.name for actuator in model.actuators if not actuator.joint]
    if unused:
        yield f"ignored {count(len(unused), 'actuator')} without a joint: {names(unused)}"
