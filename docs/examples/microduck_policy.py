"""Export a policy with the 51 observations and 14 actions of MicroDuck's runtime.

Install: pip install '.[train]' (in a clone of terrainkit)
Run: python microduck_policy.py RUN walking.onnx
RUN is the folder of a training of MicroDuck with `--observations.history-length 1`.
docs/small_robot.md has the options of microduck_runtime.
"""

import math
import sys
import warnings
from pathlib import Path

import torch

from terrainkit_robots.policy import export
from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env
from terrainkit_robots.policy.load_policy import load_actor
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.rl.terrain import Plane

LEG = 0.0, 0.0, 0.6, -1.2, 0.6
DEFAULT_POSITION = torch.tensor([*LEG, 0.0, 0.0, 0.0, 0.0, *(-angle for angle in LEG)])
"""As in src/motor.rs of microduck_runtime, without the mouth; neck and head at 0 [rad]."""
# The runtime has no phase: tiny targets of the head are the sine and the cosine of the next one.
MEMORY_JOINTS, MEMORY = ["head_yaw", "head_roll"], [7, 8]
AMPLITUDE = 0.0005
"""Amplitude of the targets of `MEMORY` [rad]; the servos resolve 2 pi / 4096 = 0.0015."""


class RuntimeNetwork(torch.nn.Module):
    """A policy in the runtime's form, in which the last action carries the phase of the gait."""

    def __init__(self, policy, description):
        super().__init__()
        self.policy, self.model = policy, policy.model
        self.parts = description["observation"]["parts"]
        joints, self.gait = description["joints"], description["gait"]
        names, histories = joints["name"], {part["history"] for part in self.parts}
        if names[7:9] != MEMORY_JOINTS or len(names) != 14 or histories != {1} or self.gait is None:
            raise SystemExit(f"got joints {names}, histories {histories}; expected MicroDuck and 1")
        self.index = [names.index(name) for name in description["action"]["joints"]]
        self.scale = torch.tensor(joints["action_scale"])[self.index]
        self.offset = torch.tensor(joints["action_offset"])
        self.min_norm = description["min_norm"]
        turn = 2 * math.pi * description["timing"]["policy_dt"] / self.gait["period"]
        sin, cos = AMPLITUDE * math.sin(turn), AMPLITUDE * math.cos(turn)
        self.rotation = torch.tensor([[cos, -sin], [sin, cos]])

    def forward(self, obs):
        """Return the actions, shape (1, 14), for observations of the runtime, shape (1, 51)."""
        ang_vel, gravity, pos, vel, last, command = obs.split([3, 3, 14, 14, 14, 3], dim=1)
        lin, yaw = command[:, :2], command[:, 2:]
        lin = lin * (lin.norm(dim=1, keepdim=True) >= self.min_norm)
        yaw = yaw * (yaw.abs() >= self.min_norm)
        moving = (lin != 0).any(dim=1, keepdim=True) | (yaw.abs() >= self.gait["min_yaw_rate"])
        phase = last[:, MEMORY]
        norm = phase.norm(dim=1, keepdim=True)
        # In the first step, the last action is 0.
        phase = torch.where(norm > AMPLITUDE / 2, phase / norm, torch.tensor([[0.0, 1.0]]))
        target = (last + DEFAULT_POSITION)[:, self.index]
        raw = {
            "commands": torch.cat([lin, yaw], dim=1),
            "projected_gravity": gravity,
            "base_ang_vel": ang_vel,
            "dof_pos": pos + DEFAULT_POSITION,
            "dof_vel": vel,
            "actions": (target - self.offset[self.index]) / self.scale,
            "gait_phase": phase * moving,
        }
        parts = [
            (raw[part["name"]] - torch.tensor(part["offset"])) * torch.tensor(part["scale"])
            for part in self.parts
        ]
        target = self.offset.repeat(len(obs), 1)
        target[:, self.index] += self.scale * self.policy(torch.cat(parts, dim=1))[0]
        target[:, MEMORY] = phase @ self.rotation
        return target - DEFAULT_POSITION


if __name__ == "__main__":
    run, path = open_run(Path(sys.argv[1])), Path(sys.argv[2])
    env = build_eval_env(run, Plane(), 8, EvaluationConfig())
    description = export.describe_policy(env) | {"min_norm": run.task.commands.min_norm}
    actor, order = load_actor(run, env), export.observation_order(env)
    policy = export.OnnxNetwork(actor, run.task.normalization, order)
    network = RuntimeNetwork(policy, description)
    with warnings.catch_warnings(action="ignore"), torch.no_grad():
        path.write_bytes(export.export_onnx(network, torch.zeros(1, 51), {}))
    print(f"wrote {path}")
