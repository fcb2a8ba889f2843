"""The public names of terrainkit_robots. A module in this list is public with all its names."""

from terrainkit_robots.description.load import load_robot as load_robot
from terrainkit_robots.description.model import RobotModel as RobotModel
from terrainkit_robots.lint.check import check_robot as check_robot
from terrainkit_robots.lint.rule import Finding as Finding
from terrainkit_robots.lint.runner import Report as Report
from terrainkit_robots.lint.settings import Settings as Settings
from terrainkit_robots.onboarding.onboard_options import OnboardOptions as OnboardOptions
from terrainkit_robots.onboarding.pipeline import onboard as onboard
from terrainkit_robots.onboarding.result import OnboardResult as OnboardResult
from terrainkit_robots.policy.average import average_checkpoints as average_checkpoints
from terrainkit_robots.policy.evaluate import EvaluationConfig as EvaluationConfig
from terrainkit_robots.policy.evaluate import evaluate as evaluate
from terrainkit_robots.policy.margins import measure_margins as measure_margins
from terrainkit_robots.policy.metrics import RolloutMetrics as RolloutMetrics
from terrainkit_robots.policy.open_policy import open_policy as open_policy
from terrainkit_robots.policy.play import play as play
from terrainkit_robots.policy.result_table import ResultTable as ResultTable
from terrainkit_robots.rl.config import Task as Task
from terrainkit_robots.rl.run import PolicySpec as PolicySpec
from terrainkit_robots.rl.run import open_run as open_run
from terrainkit_robots.rl.tasks import get_task as get_task
from terrainkit_robots.rl.tasks import register_task as register_task
from terrainkit_robots.rl.train import train as train
from terrainkit_robots.spec.robot_arrays import Robot as Robot
from terrainkit_robots.spec.robot_spec import RobotSpec as RobotSpec
from terrainkit_robots.viewer.show_policy import PolicyView as PolicyView
from terrainkit_robots.viewer.show_robot import show_robot as show_robot

from . import integrations as integrations
from . import rl as rl
