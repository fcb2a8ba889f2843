import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

pytestmark = pytest.mark.usefixtures("own_tasks")

DOCS = Path(__file__).parents[2] / "docs"
QUICK = ("--num-envs", "4", "--env.num-threads", "1")

OBSERVATIONS = """
def height_command(data, rotation):
    return 0.3

def front_feet(data, rotation):
    return [0.4, 0.4]
"""


@pytest.fixture
def ran(terrainkit):
    """Return a function that runs a command, and returns what it prints."""

    def run(*words):
        done = terrainkit(*words)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_task_of_the_guide_from_training_to_its_export(ran, rejected, own_tasks):
    [code] = re.findall(r"```python\n(.*?)```", (DOCS / "adding_a_robot.md").read_text(), re.DOTALL)
    Path("crouch.py").write_text(code)
    own = ("--task", "crouch.py")
    printed = ran("train", *own, "--max-iterations", 2, "--log-dir", "run", *QUICK)
    assert "terrainkit evaluate run --task crouch.py" in printed
    assert ran("train", *own, "--resume", "run", "--max-iterations", 3, *QUICK)
    own_tasks()
    assert rejected("evaluate run").endswith("give its Python file with --task\n")
    rollout = ("--seconds", 2.5, "--num-envs", 3, "--format", "json")
    live = json.loads(ran("evaluate", "run", *own, *rollout))
    assert live["commands"] == {"velocity": 3, "height": 1}
    assert (len(live["by_command"]), live["all"]["followed"]) == (3, None)
    terms = live["all"]["terms"]
    # The mean of squares is at least the square of the mean.
    assert terms["rew_height"] <= -20 * terms["height_error"] ** 2 < 0
    assert "followed" not in ran("play", "run", *own, "--seconds", 0.1, "--no-video")
    ran("export", "run", *own, "-o", "policy", "--example")
    # The exported network keeps its state as the live one does.
    exported = json.loads(ran("evaluate", "--policy", "policy/policy.onnx", *own, *rollout))
    numbers = {key: each for key, each in live["all"].items() if isinstance(each, float)}
    assert len(numbers) > 5
    assert {key: exported["all"][key] for key in numbers} == pytest.approx(numbers, rel=1e-2)
    recurrent = json.loads(Path("policy/policy.json").read_text())["recurrent"]
    assert recurrent == {"inputs": ["h_in"], "outputs": ["h_out"], "shape": [1, 1, 256]}
    program = [sys.executable, "policy/run_policy.py", "--seconds", "0.1"]
    done = subprocess.run(program, capture_output=True, text=True, check=False)
    assert done.stderr == (
        "observation height_command: unknown; define it in a file for --observations\n"
    )
    Path("own.py").write_text(OBSERVATIONS)
    program += ["--observations", "own.py"]
    done = subprocess.run(program, capture_output=True, text=True, check=True)
    assert "in 0.10 s" in done.stdout


def test_gait_commands_can_be_trained(ran):
    task = DOCS / "examples/gait_commands.py"
    assert ran("train", "--task", task, "--max-iterations", 1, *QUICK)


def test_student_is_distilled(ran, rejected):
    own = ("--task", DOCS / "examples/teacher_student.py", "--max-iterations", 1, *QUICK)
    ran("generate", "--terrain", "stairs", "--rows", 1, "--cols", 1, "-o", "map.npz")
    student = ("--terrain", "map.npz", "--log-dir", "student")
    assert "expected --resume RUN of the teacher" in rejected("train", *own, *student)
    assert ran("train", *own, *student, "--resume", "quadruped_map")
