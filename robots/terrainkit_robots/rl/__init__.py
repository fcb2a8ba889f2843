"""Reinforcement learning: MuJoCo steps the physics, rsl-rl trains the policy.

Read `train` and `env` first, then what they call: `rewards`, `observations`, `commands`, `events`
and `curriculum`.
"""

__all__ = [
    "commands",
    "config",
    "curriculum",
    "env",
    "events",
    "observations",
    "rewards",
    "runner",
    "symmetry",
    "tasks",
    "terminations",
    "terrain",
]
