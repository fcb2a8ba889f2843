"""Average the networks of checkpoints, as stochastic weight averaging does (arXiv:1803.05407)."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from terrainkit.errors import ConfigError, prefixed_errors
from terrainkit_robots.checkpoint import Checkpoint, check_state, policy_state, read_checkpoint
from terrainkit_robots.policy.bundle import write_policy
from terrainkit_robots.rl.run import Run, checkpoints, last_checkpoint


def average_checkpoints(run: Run, number: int, folder: Path, base: Run | None = None) -> Run:
    """Write a run whose networks are the mean of the last checkpoints of another run.

    The checkpoints of one training differ in the terrain and the disturbances that they can handle,
    even if their rewards are the same. The new run has no training state: it can be evaluated and
    exported, and a new run can start with its networks.

    Args:
        run: The run. Checkpoints after the selected one are not used.
        number: Number of checkpoints, at least 2.
        folder: New folder.
        base: The run that the training started from; the networks are then the mean of its last
            checkpoint and that mean, which keeps more of what it could do (arXiv:2109.01903).

    Returns:
        The new run.

    Raises:
        ConfigError: If the run has fewer checkpoints, or they or that of `base` do not fit the
            selected one.
        ExportError: If the folder is not empty, or cannot be written.
    """
    last = policy_state(read_checkpoint(last_checkpoint(run)))
    saved = {i: path for i, path in checkpoints(run.folder).items() if i <= last["iteration"]}
    if saved.get(last["iteration"]) != last_checkpoint(run):
        raise ConfigError(
            f"{last_checkpoint(run)}: got a checkpoint of iteration {last['iteration']}; expected "
            f"the name model_{last['iteration']}.pt"
        )
    if not 2 <= number <= len(saved):
        raise ConfigError(
            f"checkpoints: got {number}; expected at least 2; {run.folder} has {len(saved)} up to "
            f"iteration {last['iteration']}"
        )
    used = list(saved)[-number:]
    states = [*(_read_like(saved[i], last) for i in used[:-1]), last]
    mean, info = _mean(states), replace(run.info, averaged=tuple(used))
    if base:
        path = last_checkpoint(base)
        mean = _mean([_read_like(path, last), mean])
        info = replace(info, base=f"{path.parent.name}/{path.name}")
    return write_policy(run, info, mean, folder)


def _read_like(path: Path, other: Checkpoint) -> Checkpoint:
    """Read a checkpoint; raise ConfigError unless its networks have the form of another's."""
    state = policy_state(read_checkpoint(path))
    with prefixed_errors(f"{path}: "):
        check_state("actor_state_dict", state["actor_state_dict"], other["actor_state_dict"])
        check_state("critic_state_dict", state["critic_state_dict"], other["critic_state_dict"])
    return state


def _mean(states: Sequence[Checkpoint]) -> Checkpoint:
    """Return the last checkpoint with the mean of the networks."""
    mean = states[-1].copy()
    mean["actor_state_dict"] = _mean_network([state["actor_state_dict"] for state in states])
    mean["critic_state_dict"] = _mean_network([state["critic_state_dict"] for state in states])
    return mean


def _mean_network(networks: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the mean of each parameter; integers, such as numbers of samples, are the last's."""
    import torch

    means = dict(networks[-1])
    for name, value in means.items():
        if isinstance(value, torch.Tensor) and value.is_floating_point():
            values = torch.stack([network[name].double() for network in networks])
            means[name] = values.mean(0).to(value.dtype)
    return means
