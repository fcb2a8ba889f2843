"""The terrain curriculum: which patch each environment is reset on.

A sampler assigns a patch, its level (row) and column, to each environment, and learns from the
progress of the episodes. `CommandProgress` measures the progress along velocity commands.
"""

from typing import Literal

from terrainkit.curriculum.assignment import (
    Assignment,
    assign_levels,
    assign_spawns,
    resample_columns,
)
from terrainkit.curriculum.learning_progress import LearningProgressSampler
from terrainkit.curriculum.levels import LevelSampler, update_levels
from terrainkit.curriculum.prioritized_replay import PrioritizedReplaySampler
from terrainkit.curriculum.progress import CommandProgress
from terrainkit.curriculum.sampler import PatchSampler
from terrainkit.curriculum.statistics import PatchStatistics
from terrainkit.curriculum.uniform import UniformSampler

__all__ = [
    "SAMPLERS",
    "Assignment",
    "CommandProgress",
    "LearningProgressSampler",
    "LevelSampler",
    "PatchSampler",
    "PatchStatistics",
    "PrioritizedReplaySampler",
    "SamplerName",
    "UniformSampler",
    "assign_levels",
    "assign_spawns",
    "resample_columns",
    "update_levels",
]

SamplerName = Literal["levels", "uniform", "learning_progress", "prioritized_replay"]
"""Names of the samplers."""

SAMPLERS: dict[SamplerName | None, type[PatchSampler]] = {
    "levels": LevelSampler,
    "uniform": UniformSampler,
    "learning_progress": LearningProgressSampler,
    "prioritized_replay": PrioritizedReplaySampler,
    None: PatchSampler,
}
"""Class of each sampler; None keeps every environment on its patch."""
