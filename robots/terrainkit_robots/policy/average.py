"""Average the networks of checkpoints, as stochastic weight averaging does (arXiv:1803.05407)."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from terrainkit.errors import ConfigError, prefixed_errors
from terrainkit_robots.checkpoint import (
    check_state,
    checkpoint_bytes,
    policy_state,
    read_checkpoint,
)
from terrainkit_robots.rl.run import (
    MAP_FILE,
    RUN_FILE,
    TASK_FILE,
    Run,
    checkpoints,
    last_checkpoint,
    open_run,
    write_run_folder,
)
from terrainkit_robots.spec.robot import SPEC_FILE


def average_checkpoints(run: Run, number: int, folder: Path) -> Run:
    """Write a run whose networks are the mean of the last checkpoints of another run.

    The checkpoints of one training differ in the terrain and the disturbances that they can handle,
    even if their rewards are the same.
    The new run has no training state: it can be evaluated and exported, and a new run can start
    with its networks.

    Args:
        run: The run. Checkpoints after the selected one are not used.
        number: Number of checkpoints, at least 2.
        folder: New folder.

    Returns:
        The new run.

    Raises:
        ConfigError: If the run has fewer checkpoints, or they do not fit the selected one.
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
    used = dict(list(saved.items())[-number:])
    states = [_read_like(path, last) for path in used.values()]
    for name in ("actor_state_dict", "critic_state_dict"):
        last[name] = _mean([state[name] for state in states], last[name])
    paths = [run.folder / name for name in (TASK_FILE, SPEC_FILE, MAP_FILE)]
    files = {path.name: path.read_bytes() for path in paths if path.is_file()}
    files[RUN_FILE] = replace(run.info, averaged=tuple(used)).to_toml().encode()
    files[f"model_{last['iteration']}.pt"] = checkpoint_bytes(last)
    write_run_folder(folder, files)
    return open_run(folder)


def _read_like(path: Path, other: Mapping[str, Any]) -> Mapping[str, Any]:
    """Read a checkpoint; raise ConfigError unless its networks have the form of another's."""
    state = policy_state(read_checkpoint(path))
    with prefixed_errors(f"{path}: "):
        for name in ("actor_state_dict", "critic_state_dict"):
            check_state(name, state[name], other[name])
    return state


def _mean(networks: Sequence[Mapping[str, Any]], last: Mapping[str, Any]) -> dict[str, Any]:
    """Return the mean of each parameter; integers, such as numbers of samples, are the last's."""
    import torch

    means = dict(last)
    for name, value in last.items():
        if isinstance(value, torch.Tensor) and value.is_floating_point():
            values = torch.stack([network[name].double() for network in networks])
            means[name] = values.mean(0).to(value.dtype)
    return means
