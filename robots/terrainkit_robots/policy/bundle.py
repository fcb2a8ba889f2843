"""Bundle a policy: copy the part of a run that is shipped with the package."""

from dataclasses import replace
from pathlib import Path

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.checkpoint import policy_state, read_checkpoint, save_checkpoint
from terrainkit_robots.rl import run as runs
from terrainkit_robots.rl.tasks import task_names
from terrainkit_robots.spec.robot import SPEC_FILE


def bundle_policy(run: runs.Run, folder: Path) -> runs.Run:
    """Write a run without its training state and without paths of this machine.

    Raises:
        ConfigError: If the run has no checkpoint, or its robot cannot be shipped.
        ExportError: If the folder is not empty, or cannot be written.
    """
    if run.info.robot not in task_names():
        raise ConfigError(f"robot: got {run.info.robot}; expected one of {listing(task_names())}")
    info = replace(run.info, terrain="plane" if run.terrain == "plane" else runs.MAP_FILE)
    names = [runs.TASK_FILE, SPEC_FILE] + [runs.MAP_FILE] * (info.terrain != "plane")
    state = policy_state(read_checkpoint(runs.last_checkpoint(run)))
    files = {name: (run.folder / name).read_bytes() for name in names}
    runs.write_run_folder(folder, files | {runs.RUN_FILE: info.to_toml().encode()})
    save_checkpoint(folder / f"model_{state['iteration']}.pt", state)
    return runs.open_run(folder)
