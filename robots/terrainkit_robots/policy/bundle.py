"""Bundle a policy: copy the part of a run that is shipped with the package."""

from dataclasses import replace
from pathlib import Path

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.checkpoint import Checkpoint, checkpoint_bytes, policy_state, read_checkpoint
from terrainkit_robots.rl.run import (
    MAP_FILE,
    RUN_FILE,
    TASK_FILE,
    Run,
    RunInfo,
    last_checkpoint,
    open_run,
    write_run_folder,
)
from terrainkit_robots.rl.tasks import task_names
from terrainkit_robots.spec.robot_arrays import SPEC_FILE


def bundle_policy(run: Run, folder: Path) -> Run:
    """Write a run without its training state and without paths of this machine.

    Args:
        run: The run.
        folder: New folder.

    Returns:
        The run in the new folder.

    Raises:
        ConfigError: If the run has no checkpoint, or its robot cannot be shipped.
        ExportError: If the folder is not empty, or cannot be written.
    """
    if run.info.robot not in task_names():
        raise ConfigError(f"robot: got {run.info.robot}; expected one of {listing(task_names())}")
    info = replace(run.info, terrain="plane" if run.terrain == "plane" else MAP_FILE)
    return write_policy(run, info, policy_state(read_checkpoint(last_checkpoint(run))), folder)


def write_policy(run: Run, info: RunInfo, state: Checkpoint, folder: Path) -> Run:
    """Write a policy as a run without a training state, completely or not at all.

    Args:
        run: The run whose task, robot and map the new one has.
        info: The content of its `run.toml`.
        state: Its checkpoint.
        folder: New folder.

    Returns:
        The run in the new folder.

    Raises:
        ExportError: If the folder is not empty, or cannot be written.
    """
    paths = [run.folder / name for name in (TASK_FILE, SPEC_FILE, MAP_FILE)]
    files = {path.name: path.read_bytes() for path in paths if path.is_file()}
    files[RUN_FILE] = info.to_toml().encode()
    files[f"model_{state['iteration']}.pt"] = checkpoint_bytes(state)
    write_run_folder(folder, files)
    return open_run(folder)
