"""Bundle a policy: copy the part of a run that is shipped with the package."""

from pathlib import Path

import tomli_w

from terrainkit.errors import ConfigError, listing
from terrainkit.toml_text import parse_toml
from terrainkit_robots.onboarding.folder import new_folder
from terrainkit_robots.rl import checkpoint, registry, run_folder
from terrainkit_robots.rl.robot import SPEC_FILE
from terrainkit_robots.rl.run_folder import MAP_FILE, RUN_FILE, TASK_FILE, Run


def bundle_policy(run: Run, folder: Path) -> Run:
    """Write a run without its training state and without paths of this machine.

    Raises:
        ConfigError: if the run has no checkpoint, or its robot or terrain cannot be shipped.
        ExportError: if the folder is not empty, or cannot be written.
    """
    if run.checkpoint is None:
        raise ConfigError(f"run {run.folder}: got no checkpoint; expected a trained run")
    if run.robot_name not in registry.names():
        known = listing(registry.names())
        raise ConfigError(f"robot: got {run.robot_name}; expected a registered robot: {known}")
    files = [TASK_FILE, SPEC_FILE] + [MAP_FILE] * (run.terrain != "plane")
    if not (run.folder / files[-1]).is_file():
        raise ConfigError(f"terrain: got {run.terrain}; expected plane or a map with a config")
    info = parse_toml((run.folder / RUN_FILE).read_text(encoding="utf-8"))
    info["terrain"] = "plane" if run.terrain == "plane" else MAP_FILE
    state = checkpoint.only_policy(checkpoint.read_checkpoint(run.checkpoint))
    run_folder.make_parents(folder)
    with new_folder(folder) as path:
        for name in files:
            (path / name).write_bytes((run.folder / name).read_bytes())
        (path / RUN_FILE).write_text(tomli_w.dumps(info), encoding="utf-8")
        name = run_folder.checkpoint_name(state["iteration"])
        checkpoint.save_checkpoint(path / name, state)
    return run_folder.open_run(folder)
