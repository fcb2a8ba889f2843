"""Build the robot of genesis_config.py and step it; runs in an environment with Genesis.

The second argument is `wheeled` if the calf joints have velocity targets.
"""

import sys

sys.path.insert(0, sys.argv[1])

import genesis as gs
import genesis_config
import torch

gs.init(backend=gs.cpu, logging_level="warning")
scene = gs.Scene(show_viewer=False)
scene.add_entity(gs.morphs.Plane())
robot = genesis_config.build(scene)
dofs = genesis_config.dofs(robot)


def by_part(calf, other):
    return torch.tensor([calf if "calf" in joint else other for joint in genesis_config.JOINTS])


is_wheeled = sys.argv[2] == "wheeled"
assert set(genesis_config.FEET) <= {link.name for link in robot.links}
for found, calf, other in (
    (robot.get_dofs_kp(dofs), 0.0 if is_wheeled else 30.0, 20.0),
    (robot.get_dofs_kv(dofs), 0.75, 0.5),
    (robot.get_dofs_force_range(dofs)[1], 45.43, 23.7),
    (robot.get_dofs_armature(dofs), 0.04, 0.01),
):
    torch.testing.assert_close(found.cpu().float(), by_part(calf, other))
pose = torch.tensor(list(genesis_config.DEFAULT_POSE.values()))
torch.testing.assert_close(robot.get_dofs_position(dofs).cpu().float(), pose)
if is_wheeled:
    wheels = genesis_config.dofs(robot, genesis_config.SPEED_SCALE)
    assert len(wheels) == 4
    robot.set_pos([0.0, 0.0, 5.0])
    robot.control_dofs_velocity([3.0] * 4, wheels)
    for _ in range(5):
        scene.step()
    assert (robot.get_dofs_velocity(wheels) > 0.5).all()
else:
    for _ in range(20):
        scene.step()
    assert abs(robot.get_dofs_position(dofs).cpu() - pose).max() < 0.5
assert torch.isfinite(robot.get_pos()).all()
