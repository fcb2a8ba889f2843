"""The command that checks a policy of any project with its contract and a robot."""

import json
from dataclasses import asdict, dataclass
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from terrainkit.errors import ConfigError
from terrainkit_cli import render
from terrainkit_cli.argument_types import RobotName, TaskFile
from terrainkit_cli.parse import option, positional
from terrainkit_cli.plugin_command import PluginCommand

if TYPE_CHECKING:
    from terrainkit_robots.policy.check_policy import Finding

MAX_PRINTED = 3
"""Largest number of findings of one kind in the text."""


@dataclass(frozen=True, kw_only=True)
class CheckPolicy(PluginCommand):
    """Check whether a policy, its contract and a robot fit together.

    The contract is what a policy observes, and what its actions do. The check compares its joints,
    pose, gains, scales and timing with the robot, and commands the robot in simulation to stand,
    walk, turn and sidestep. If it fails, the contract is tested with one value changed at a time:
    the order of joints, terms and history, scales, signs, units, gains, time step. A change with
    which the robot walks names the fault.

    Exit code 0: nothing was found. 1: something was found. 2: a file cannot be read, or an option
    is invalid.
    """

    policy: Annotated[str, positional("POLICY")] = ""
    """An ONNX or TorchScript file of any project."""

    robot: RobotName = ""
    """A robot's name, or a folder written by terrainkit onboard."""

    contract: Annotated[Path, option("FILE")] | None = None
    """The contract, if it is not beside the policy or in its metadata: policy.json, or a YAML file
    in the form of Unitree's deploy.yaml or unitree_rl_gym's deploy_mujoco."""

    task: TaskFile | None = None
    """A Python file with a task of your own, whose environment has further observation terms; it is
    executed."""

    format: Literal["text", "json"] = "text"
    """Format of the report."""

    def run(self) -> int:
        """Check the policy, and print the findings."""
        from terrainkit_cli.training_extra import require_training

        if not self.policy or not (self.robot or self.task):
            raise ConfigError("POLICY, --robot: missing; expected policy.onnx --robot quadruped")
        require_training("onnx", "onnxruntime")
        from terrainkit_robots.policy.check_policy import check_policy
        from terrainkit_robots.rl.tasks import robot_and_task

        robot, task = robot_and_task(self.robot, self.task)
        with render.steps() as steps:
            steps.update(f"checking {self.policy}")
            findings = check_policy(Path(self.policy), robot, self.contract, task)
        if self.format == "json":
            report = {"policy": self.policy, "findings": [asdict(finding) for finding in findings]}
            render.report(json.dumps(report, indent=2) + "\n")
        else:
            render.result("\n".join(text_lines(self.policy, findings)))
        return int(bool(findings))


def text_lines(policy: str, findings: "list[Finding]") -> list[str]:
    """Return the findings as lines, at most some of each code."""
    lines = []
    by_code = attrgetter("code")
    for _, group in groupby(sorted(findings, key=by_code), by_code):
        same = list(group)
        for finding in same[:MAX_PRINTED]:
            lines += [f"{finding.code}  {finding.got}", f"        expected: {finding.expected}"]
        if len(same) > MAX_PRINTED:
            lines.append(f"        and {len(same) - MAX_PRINTED} more")
        lines.append(f"        {same[0].help}")
    found = f"{len(findings)} findings" if len(findings) != 1 else "1 finding"
    return [*lines, f"{policy}: {found if findings else 'the robot stands, walks and turns'}"]
