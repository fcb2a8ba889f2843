"""Runs in an environment with Genesis: builds the robot of genesis_config.py and steps it."""

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


assert set(genesis_config.FEET) <= {link.name for link in robot.links}
for found, calf, other in (
    (robot.get_dofs_kp(dofs), 30.0, 20.0),
    (robot.get_dofs_kv(dofs), 0.75, 0.5),
    (robot.get_dofs_force_range(dofs)[1], 45.43, 23.7),
    (robot.get_dofs_armature(dofs), 0.04, 0.01),
):
    torch.testing.assert_close(found.cpu().float(), by_part(calf, other))
pose = torch.tensor(list(genesis_config.DEFAULT_POSE.values()))
torch.testing.assert_close(robot.get_dofs_position(dofs).cpu().float(), pose)
for _ in range(20):
    scene.step()
assert torch.isfinite(robot.get_pos()).all()
assert abs(robot.get_dofs_position(dofs).cpu() - pose).max() < 0.5
