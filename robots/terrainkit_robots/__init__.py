"""Load, check and onboard robot files; train and evaluate policies for legged robots.

The names below are imported on first use, so that `import terrainkit_robots` costs nothing.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from terrainkit_robots.description.load import load_robot
    from terrainkit_robots.description.model import RobotModel
    from terrainkit_robots.lint.check import check_robot
    from terrainkit_robots.lint.rule import Finding
    from terrainkit_robots.lint.runner import Report
    from terrainkit_robots.onboarding.onboard_options import OnboardOptions
    from terrainkit_robots.onboarding.pipeline import onboard
    from terrainkit_robots.onboarding.result import OnboardResult
    from terrainkit_robots.spec.robot_spec import RobotSpec

__all__ = [
    "Finding",
    "OnboardOptions",
    "OnboardResult",
    "Report",
    "RobotModel",
    "RobotSpec",
    "check_robot",
    "load_robot",
    "onboard",
]

_MODULES = {
    "Finding": "lint.rule",
    "OnboardOptions": "onboarding.onboard_options",
    "OnboardResult": "onboarding.result",
    "Report": "lint.runner",
    "RobotModel": "description.model",
    "RobotSpec": "spec.robot_spec",
    "check_robot": "lint.check",
    "load_robot": "description.load",
    "onboard": "onboarding.pipeline",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
