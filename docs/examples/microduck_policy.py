"""Export a policy with the 51 observations and 14 actions of MicroDuck's runtime.

Install: pip install '.[train]' (in a clone of terrainkit)
Run: python microduck_policy.py RUN walking.onnx
RUN is the folder of a training of MicroDuck with `--observations.history-length 1`.
docs/small_robot.md has the options of microduck_runtime.
"""

import math
import sys
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
HEAD, MEMORY = ["neck_pitch", "head_pitch", "head_yaw", "head_roll"], [7, 8]
AMPLITUDE = 0.0005
"""Amplitude of the targets of `MEMORY` [rad]; the servos resolve 2 pi / 4096 = 0.0015."""


class RuntimeNetwork(torch.nn.Module):
    """A policy in the runtime's form, in which the last action carries the phase of the gait."""

    def __init__(self, policy, description):
        super().__init__()
        self.policy, self.model = policy, policy.model
        self.parts, self.gait = description["observation"]["parts"], description["gait"]
        joints, actions = description["joints"], description["action"]["joints"]
        names, size = joints["name"], description["observation"]["size"]
        step = description["timing"]["policy_dt"]
        got = names[5:9], [name for name in names if name not in actions], step, size
        if got != (expected := (HEAD, HEAD, 0.02, 49)):
            what = "joints 6 to 9, joints without an action, time step, number of observations"
            raise SystemExit(f"{what}: got {got}; expected {expected}")
        self.index, self.min_norm = list(map(names.index, actions)), description["min_norm"]
        self.scale = torch.tensor(joints["action_scale"])[self.index]
        self.offset = torch.tensor(joints["action_offset"])
        self.offset[MEMORY] = 0.0
        turn = 2 * math.pi * step / self.gait["period"]
        sin, cos = AMPLITUDE * math.sin(turn), AMPLITUDE * math.cos(turn)
        self.spread = torch.diag(torch.tensor(joints["action_scale"]))[self.index]
        self.rotation = torch.tensor([[cos, -sin], [sin, cos]]) @ torch.eye(14)[MEMORY]

    def forward(self, obs):
        """Return the actions, shape (n, 14), for observations of the runtime, shape (n, 51)."""
        ang_vel, gravity, pos, vel, last, command = obs.split([3, 3, 14, 14, 14, 3], dim=1)
        lin, yaw = command[:, :2], command[:, 2:]
        lin = lin * (lin.norm(dim=1, keepdim=True) >= self.min_norm)
        yaw = yaw * (yaw.abs() >= self.min_norm)
        moving = (lin != 0).any(dim=1, keepdim=True) | (yaw.abs() >= self.gait["min_yaw_rate"])
        phase = last[:, MEMORY]
        norm = phase.norm(dim=1, keepdim=True)
        # In the first step, the last action is 0.
        phase = torch.where(norm > AMPLITUDE / 2, phase / norm, torch.tensor([[0.0, 1.0]]))
        raw = {
            "commands": torch.cat([lin, yaw], dim=1),
            "projected_gravity": gravity,
            "base_ang_vel": ang_vel,
            "dof_pos": pos + DEFAULT_POSITION,
            "dof_vel": vel,
            "actions": (last + DEFAULT_POSITION - self.offset)[:, self.index] / self.scale,
            "gait_phase": phase * moving,
        }
        parts = [
            (raw[part["name"]] - torch.tensor(part["offset"])) * torch.tensor(part["scale"])
            for part in self.parts
        ]
        actions = self.policy(torch.cat(parts, dim=1))[0]
        target = self.offset + actions @ self.spread + phase @ self.rotation
        return target - DEFAULT_POSITION


if __name__ == "__main__":
    run, path = open_run(Path(sys.argv[1])), Path(sys.argv[2])
    env = build_eval_env(run, Plane(), 8, EvaluationConfig())
    description = export.describe_policy(env) | {"min_norm": run.task.commands.min_norm}
    actor, order = load_actor(run, env), export.observation_order(env)
    policy = export.OnnxNetwork(actor, run.task.normalization, order)
    network = RuntimeNetwork(policy, description)
    path.write_bytes(export.export_onnx(network, torch.zeros(1, 51), {}))
    print(f"wrote {path}")
