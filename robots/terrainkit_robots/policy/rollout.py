"""The walk: a policy looks and acts, again and again, while robots are asked for this and that."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict

from terrainkit_robots.policy.actor import Act
from terrainkit_robots.rl.env import LeggedEnv

FloatArray = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """A step that n robots have made; where it led to is the environment's state."""

    observed: TensorDict
    """What the policy saw before it."""

    commands: FloatArray
    """What was asked for in it, shape (n, 3)."""

    fallen: NDArray[np.bool_]
    """Who fell in it, and has begun anew, shape (n,)."""


def walk(env: LeggedEnv, policy: Act, commands: Iterable[FloatArray | None]) -> Iterator[Step]:
    """Let robots walk, and yield each step once it is made.

    Args:
        env: The environment.
        policy: What acts.
        commands: What is asked for in each step, shape (n, 3); None for the task's random commands.
    """
    held: object = ...  # neither commands nor None: nothing was asked for yet
    for asked in commands:
        if asked is not held:
            env.set_commands(asked)
            held = asked
        before, observed = env.state, env.get_observations()
        with torch.inference_mode():
            actions = policy(observed)
        _, _, dones, extras = env.step(actions)
        fallen = (dones & ~extras["time_outs"]).cpu().numpy()
        yield Step(observed=observed, commands=before.commands, fallen=fallen)


def timetable(commands: FloatArray | None, steps: int) -> list[FloatArray | None]:
    """Return what is asked for in each step.

    Args:
        commands: What is asked for one after the other, each for the same part of the time, shape
            (n, 3) or (k, n, 3); None for the task's random commands.
        steps: How many.
    """
    if commands is None:
        return [None] * steps
    turns = list(commands.reshape(-1, *commands.shape[-2:]))
    return [turns[k * len(turns) // steps] for k in range(steps)]
