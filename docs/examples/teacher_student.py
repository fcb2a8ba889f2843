"""Distill a policy with a height scan into a student that feels its way: no scan, no velocity.

Install: pip install '.[train]' (in a clone of terrainkit)
Run: terrainkit train --task teacher_student.py --resume quadruped_map --terrain MAP.npz
The teacher is the policy of --resume. Then: terrainkit evaluate RUN --task teacher_student.py
With --observations.history-length 6, the student also sees the latest observations.
"""

from dataclasses import dataclass, field, replace
from typing import ClassVar

from terrainkit_robots.rl.config import Runner, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.tasks import get_task, register_task

TEACHER = get_task("quadruped_map")
HIDDEN = ("height_scan", "base_lin_vel")


class StudentEnv(LeggedEnv):
    """The policy group is what the student observes, with noise; the teacher observes more."""

    def observation_terms(self):
        """Return the groups of the student, the teacher and the critic."""
        groups = super().observation_terms()
        terms = groups["policy"].items()
        teacher = {name: term for name, term in terms if name != "history"}
        student = {name: term for name, term in terms if name not in HIDDEN}
        return {"policy": student, "teacher": teacher, "privileged": groups["privileged"]}


@dataclass(frozen=True, kw_only=True)
class StudentTask(Task):
    """The teacher's task, with rsl-rl's distillation in place of PPO."""

    env_class: ClassVar = StudentEnv
    runner: Runner = field(
        default_factory=lambda: replace(
            TEACHER.task.runner,
            max_iterations=300,
            rsl_rl={
                "obs_groups": {"student": ["policy"], "teacher": ["teacher"]},
                "algorithm": {
                    "class_name": "Distillation",
                    "num_learning_epochs": 2,
                    "gradient_length": 24,
                },
                # A recurrent network remembers what its feet met. Only a little noise: the student
                # acts, and visits the states that it is to learn.
                "student": {
                    "class_name": "RNNModel",
                    "rnn_type": "gru",
                    "rnn_hidden_dim": 128,
                    "distribution_cfg": {"init_std": 0.1},
                },
            },
        )
    )


sections = {name: value for name, value in vars(TEACHER.task).items() if name != "runner"}
register_task("quadruped_student", TEACHER.folder, StudentTask(**sections))
