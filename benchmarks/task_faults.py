"""Plant faults in tasks, and count which ones check-task names; stock tasks may have no error.

usage: python benchmarks/task_faults.py [--host HOST] [--only TEXT] [--stock] [--chosen]
"""

import argparse
import re
import sys
import time
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from terrainkit_robots.task_check.check import check_task
from terrainkit_robots.task_check.host import Host

FAULTS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text())["fault"]

STOCK = {
    "terrainkit": ("quadruped", "biped", "quadruped_map"),
    "gymnasium": ("Ant-v5", "Walker2d-v5", "Humanoid-v5"),
    "mjlab": (
        "Mjlab-Velocity-Flat-Unitree-Go1",
        "Mjlab-Velocity-Flat-Unitree-G1",
        "Mjlab-Velocity-Rough-Unitree-Go1",
        "Mjlab-Velocity-Rough-Unitree-G1",
    ),
}
"""Tasks that are known to be learned."""


def own_host(fault: Mapping[str, Any]) -> Host:
    from terrainkit import MapConfig, generate
    from terrainkit_robots.rl.env import LeggedEnv
    from terrainkit_robots.rl.events import EventTerm
    from terrainkit_robots.rl.run import PolicySpec
    from terrainkit_robots.rl.tasks import get_task
    from terrainkit_robots.rl.terrain import MapGround, Plane
    from terrainkit_robots.spec.robot_arrays import Robot
    from terrainkit_robots.task_check.hosts.terrainkit_host import TerrainkitHost

    found = get_task(fault["task"])
    task = found.task
    for path, value in fault.get("set", {}).items():
        section, name = path.split(".")
        task = replace(task, **{section: replace(getattr(task, section), **{name: value})})
    if depth := fault.get("below"):

        class Sunken(LeggedEnv):
            def event_terms(self):
                def lower(env, env_ids):
                    env.sim.qpos[env_ids, 2] -= depth
                    env.sim.forward(env_ids)

                return {**super().event_terms(), "below": EventTerm(reset=lower)}

        @dataclass(frozen=True, kw_only=True)
        class SunkenTask(type(task)):
            env_class = Sunken

        task = SunkenTask(**vars(task))
    robot = Robot.load(found.folder)
    changes = {name: tuple(value) for name, value in fault.get("spec", {}).items()}
    robot = Robot.from_spec(replace(robot.spec, **changes), found.folder)
    ground = Plane()
    if fault.get("terrain") or fault["task"] == "quadruped_map":
        terrains = [{"terrain": fault.get("terrain", "pyramid_stairs")}]
        ground = MapGround(
            generate(MapConfig.from_table({"rows": 5, "cols": 1, "terrains": terrains}))
        )
    return TerrainkitHost(PolicySpec(task=task, robot=robot), ground, Path(fault["task"]))


def gymnasium_host(fault: Mapping[str, Any]) -> Host:
    import gymnasium
    import numpy as np

    from terrainkit_robots.task_check.hosts.gymnasium_host import GymnasiumHost

    options = {k: tuple(v) if isinstance(v, list) else v for k, v in fault.get("set", {}).items()}
    name = fault["task"]
    if factor := fault.get("observation"):

        def make(**given: Any) -> gymnasium.Env:
            env = gymnasium.make(fault["task"], **given).unwrapped
            space = gymnasium.spaces.Box(-np.inf, np.inf, env.observation_space.shape)
            return gymnasium.wrappers.TransformObservation(env, lambda obs: factor * obs, space)

        name = "Scaled-v5"
        gymnasium.register(name, make, max_episode_steps=1000)
    return GymnasiumHost(name, **options)


def mjlab_host(fault: Mapping[str, Any]) -> Host:
    from terrainkit_robots.task_check.hosts.mjlab_host import MjlabHost, load_cfg

    cfg = load_cfg(fault["task"])
    for path, value in fault.get("set", {}).items():
        target = cfg
        *parents, last = path.split(".")
        for part in parents:
            target = target[part] if isinstance(target, dict) else getattr(target, part)
        value = None if value == "none" else tuple(value) if isinstance(value, list) else value
        if isinstance(target, dict):
            target[last] = value
        else:
            setattr(target, last, value)
    return MjlabHost(fault["task"], cfg)


HOSTS = {"terrainkit": own_host, "gymnasium": gymnasium_host, "mjlab": mjlab_host}


def main() -> int:
    """Print what is found; return 1 if two faults are missed, or a stock task has an error."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--host", choices=HOSTS, default="terrainkit")
    parser.add_argument("--only", default="", help="regular expression for the names of faults")
    parser.add_argument("--stock", action="store_true", help="check the stock tasks instead")
    parser.add_argument(
        "--chosen", action="store_true", help="faults of which thresholds are chosen"
    )
    options = parser.parse_args()
    faults = [
        f for f in FAULTS if f["host"] == options.host and f.get("chosen", False) >= options.chosen
    ]
    if options.stock:
        faults = [{"task": task, "name": "stock", "codes": []} for task in STOCK[options.host]]
    named = tested = errors = 0
    for fault in faults:
        if not re.search(options.only, f"{fault['task']}: {fault['name']}"):
            continue
        start = time.process_time()
        report = check_task(HOSTS[options.host](fault))
        found = {finding.code for finding in report.findings}
        is_named = bool(found & set(fault["codes"])) or not fault["codes"]
        tested, named = tested + 1, named + is_named
        errors += report.verdict == "fail"
        word, seconds = "ok  " if is_named else "MISS", time.process_time() - start
        print(
            f"{word} {seconds:4.0f} s {fault['task']}: {fault['name']} ({' '.join(fault['codes'])})"
        )
        for finding in report.findings:
            print(f"     {finding.code} {finding.severity} {finding.message}", flush=True)
        for skipped in report.skipped:
            print(f"     skipped {skipped.code} {skipped.reason}", flush=True)
    print(f"{named} of {tested} faults named")
    return int(named < tested - 1 or (options.stock and errors > 0))


if __name__ == "__main__":
    sys.exit(main())
