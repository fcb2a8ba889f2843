"""Run the examples of docs/examples as they are, and the notebook."""

import ast
import os
import re
import runpy
import shutil
import subprocess
import sys
from itertools import chain
from pathlib import Path
from types import SimpleNamespace

import cv2
import nbclient
import nbformat
import numpy as np
import onnxruntime
import pytest
import torch

from terrainkit_robots.policy.export import export_onnx

ROOT = Path(__file__).parent.parent
EXAMPLES = ROOT / "docs/examples"
SCRIPTS = sorted(EXAMPLES.glob("*.py"))
MICRODUCK = EXAMPLES / "microduck_policy.py"  # its network is tested here

WRITTEN = {
    "generate_map": ("map.npz", "map.png", "map.xml"),
    "own_terrain": ("furrows.png",),
    "own_solids": ("logs.png", "logs.xml"),
    "import_scan": ("scan.npz", "scan.ply", "scan.png"),
    "height_scan": (),
    "plan_path": ("map.yaml", "map.pgm", "plan.png"),
    "near_geoms": (),
    "depth_camera": (),
    "onboard_robot": ("my_robot/robot.toml", "my_robot/mjlab_config.py"),
    "train_and_export": ("ground.npz", "policy/policy.onnx", "policy/run_policy.py"),
}
"""Files that an example writes. The others need frameworks, and run in tests/frameworks, or are
tasks, and run in test_own_task.py."""

CHECKS = "".join(
    path.read_text()
    for path in (
        *(ROOT / "tests/frameworks").glob("*_check.py"),
        ROOT / "tests/terrainkit_cli/test_own_task.py",
    )
)

STAND_IN = """
import runpy, sys
sys.path[:0] = ["", {frameworks!r}]
from stand_ins import StandIns
sys.meta_path.insert(0, StandIns({packages!r}))
{before}
sys.argv[:] = [{script!r}]
runpy.run_path({script!r}, run_name="__main__")
"""


def run(folder, *arguments):
    """Run Python in a folder, and return what it prints."""
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    command = [sys.executable, *map(str, arguments)]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "Warning" not in done.stderr, done.stderr
    return done.stdout


def run_with_stand_ins(folder, script, packages, before, check):
    """Run an example with mocks in place of a framework, and then a check."""
    names = {"frameworks": str(ROOT / "tests/frameworks"), "script": str(EXAMPLES / script)}
    return run(folder, "-c", STAND_IN.format(packages=packages, before=before, **names) + check)


@pytest.mark.parametrize("name", WRITTEN)
def test_example_runs_in_an_empty_folder(name, tmp_path):
    shutil.copy(EXAMPLES / f"{name}.py", tmp_path)
    arguments = ("1",) if name == "train_and_export" else ()
    for _ in range(1 if arguments else 2):  # the second time, the files exist
        assert run(tmp_path, f"{name}.py", *arguments)
    for file in WRITTEN[name]:
        assert (tmp_path / file).stat().st_size > 100
    for picture in tmp_path.glob("*.png"):
        is_of_heights = picture.with_suffix(".json").exists()
        assert is_of_heights or cv2.imread(str(picture)).std() > 5


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_example_is_run_and_short_and_says_what_to_install(path):
    is_run = path.stem in WRITTEN or path == MICRODUCK or f"examples/{path.name}" in CHECKS
    assert is_run, f"{path.name} is neither in WRITTEN nor in tests/frameworks or test_own_task.py"
    text = path.read_text()
    assert len(text.splitlines()) <= 90
    summary, _, rest = ast.get_docstring(ast.parse(text)).partition("\n")
    assert summary.endswith(".")
    assert "pip install" in rest
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and node.module.startswith("terrainkit.integrations."):
            module = ast.parse((ROOT / f"{node.module.replace('.', '/')}.py").read_text())
            imports = [line.names for line in module.body if isinstance(line, ast.ImportFrom)]
            defined = {name.name for name in chain(module.body, *imports) if hasattr(name, "name")}
            assert {each.name for each in node.names} <= defined


def test_mjlab_example_registers_task_of_a_stand_in(tmp_path):
    before = """
from dataclasses import make_dataclass
import mjlab.terrains
fields = [("flat_patch_sampling", dict, None)]
mjlab.terrains.SubTerrainCfg = make_dataclass("SubTerrainCfg", fields)
"""
    check = """
from mjlab.tasks.registry import register_mjlab_task
from mjlab.scripts.train import main
print(register_mjlab_task.call_args.args[0], main.call_count, *sys.argv[1:4])
"""
    printed = run_with_stand_ins(tmp_path, "mjlab_terrain.py", ("mjlab",), before, check)
    assert printed.split() == ["Map-Go1", "1", "Map-Go1", "--env.scene.num-envs", "16"]
    assert (tmp_path / "map.npz").exists()


def test_legged_gym_example_replaces_terrain_of_a_stand_in(tmp_path):
    assert "terrain.npz" in run(tmp_path, EXAMPLES / "legged_gym_terrain.py")
    before = """
sys.version_info = (3, 8)
from legged_gym.utils import task_registry
pair = (task_registry.env, task_registry.cfg)
task_registry.make_env.return_value = task_registry.make_alg_runner.return_value = pair
"""
    check = """
import terrain
from legged_gym.envs.base import legged_robot
print(legged_robot.Terrain is terrain.Terrain)
"""
    packages, script = ("isaacgym", "legged_gym"), "legged_gym_terrain.py"
    printed = run_with_stand_ins(tmp_path, script, packages, before, check)
    assert printed.splitlines()[-1] == "True"


class Echo(torch.nn.Module):
    """A policy of 10 actions: some of its observations, and then zeros."""

    model = SimpleNamespace(input_names=["obs"], output_names=["actions"])
    model.get_dummy_inputs = lambda: (None,)

    def __init__(self, first, stop):
        super().__init__()
        self.first, self.stop = first, stop

    def forward(self, obs):
        obs = obs[:, self.first : self.stop]
        return (torch.nn.functional.pad(obs, (0, 10 - obs.shape[1])),)


@pytest.fixture
def make_microduck():
    """Return a function that makes the network of the example for an `Echo` of a part."""
    network = runpy.run_path(str(MICRODUCK))["RuntimeNetwork"]
    head = "neck_pitch", "head_pitch", "head_yaw", "head_roll"
    left, right = ([f"{side}_{k}" for k in range(5)] for side in ("left", "right"))
    sizes = {"commands": 3, "projected_gravity": 3, "base_ang_vel": 3, "dof_pos": 14}
    sizes |= {"dof_vel": 14, "actions": 10, "gait_phase": 2}
    start, parts = 0, []
    for name, size in sizes.items():
        scale, offset = (0.25, 0.0) if name == "base_ang_vel" else (1.0, 0.1 * (name == "dof_pos"))
        part = {"name": name, "start": start, "stop": start + size, "history": 1}
        parts.append(part | {"scale": [scale] * size, "offset": [offset] * size})
        start += size
    description = {
        "observation": {"parts": parts, "size": start},
        "joints": {
            "name": [*left, *head, *right],
            "action_scale": [0.25] * 14,
            "action_offset": [0.1] * 14,
        },
        "action": {"joints": [*left, *right]},
        "gait": {"period": 0.4, "min_yaw_rate": 0.1},
        "timing": {"policy_dt": 0.02},
        "min_norm": 0.04,
    }

    def make(name, **changed):
        (part,) = (part for part in parts if part["name"] == name)
        echo = Echo(part["start"], min(part["stop"], part["start"] + 10))
        return network(echo, description | changed)

    return make


@pytest.fixture
def microduck(make_microduck):
    """Return a function that makes such a network as a function of one observation."""

    def make(name):
        policy = make_microduck(name)
        return lambda obs: policy(torch.tensor(obs[None], dtype=torch.float32))[0].numpy()

    return make


LEGS = [0, 1, 2, 3, 4, 9, 10, 11, 12, 13]
HOME = np.array([0, 0, 0.6, -1.2, 0.6, 0, 0, 0, 0, 0, 0, -0.6, 1.2, -0.6])


@pytest.mark.parametrize(
    ("name", "numbers", "expected"),
    [
        ("commands", {48: 0.3, 49: 0.1, 50: 1.0}, [0.3, 0.1, 1.0]),
        ("commands", {48: 0.03, 49: 0.01, 50: 0.03}, [0, 0, 0]),  # below min_norm
        ("base_ang_vel", {0: 1.0, 1: -2.0, 2: 4.0}, [0.25, -0.5, 1.0]),
        ("projected_gravity", {3: 0.1, 5: -1.0}, [0.1, 0, -1.0]),
        ("dof_pos", {6: 0.2}, [0.1, -0.1, 0.5, -1.3, 0.5, -0.1, -0.1, -0.1, -0.1, -0.1]),
        ("dof_vel", {20: 3.0}, [3.0]),
    ],
)
def test_microduck_policy_maps_observations_and_actions(microduck, name, numbers, expected):
    obs = np.zeros(51)
    obs[[*numbers]] = [*numbers.values()]
    actions = microduck(name)(obs)
    legs = 0.1 + 0.25 * np.pad(expected, (0, 10 - len(expected)))
    np.testing.assert_allclose(actions[LEGS] + HOME[LEGS], legs, atol=1e-6)
    np.testing.assert_allclose(actions[5:7], 0.1, atol=1e-6)  # the neck stays where it was


def test_microduck_policy_keeps_last_action_and_phase(microduck):
    keep, phases = microduck("actions"), microduck("gait_phase")
    obs = np.zeros(51)
    obs[34:48] = np.linspace(-0.1, 0.2, 14)
    np.testing.assert_allclose(keep(obs)[LEGS], obs[34:48][LEGS], atol=1e-6)
    obs = np.zeros(51)
    obs[48] = 0.3
    for step in range(41):  # two periods
        actions = phases(obs)
        angle = 2 * np.pi * step * 0.02 / 0.4
        expected = 0.1 + 0.25 * np.array([np.sin(angle), np.cos(angle)])
        np.testing.assert_allclose(actions[:2], expected, atol=1e-5)
        assert np.abs(actions[7:9]).max() <= 0.0005 + 1e-9
        obs[34:48] = actions
    obs[48] = 0.0
    np.testing.assert_allclose(phases(obs)[:2], 0.1, atol=1e-6)  # commanded to stand


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({"timing": {"policy_dt": 0.01}}, r"got \(.*\], 0.01, 49\); expected \(.*\], 0.02, 49\)$"),
        ({"observation": {"parts": [], "size": 245}}, r"number of observations: got .* 245\);"),
        ({"action": {"joints": ["head_yaw"]}}, r"joints without an action.*: got .*'right_4'\],"),
    ],
)
def test_microduck_policy_says_what_it_needs(make_microduck, changed, expected):
    with pytest.raises(SystemExit, match=expected):
        make_microduck("commands", **changed)


def test_microduck_policy_is_exported_for_several_robots(make_microduck):
    policy, obs = make_microduck("dof_pos"), torch.randn(3, 51)
    session = onnxruntime.InferenceSession(export_onnx(policy, torch.zeros(1, 51), {}))
    (actions,) = session.run(["actions"], {"obs": obs.numpy()})
    np.testing.assert_allclose(actions, policy(obs).numpy(), atol=1e-6)


def test_notebook_runs_and_shows_maps(tmp_path, monkeypatch):
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / ".ipython"))
    notebook = nbformat.read(EXAMPLES / "terrainkit.ipynb", as_version=4)
    kept = list(map(outputs_of, notebook.cells))
    assert [count for count, _ in kept if count] == list(range(1, 7))
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3").execute(cwd=tmp_path)
    assert list(map(outputs_of, notebook.cells)) == kept, (
        "run jupyter execute --inplace docs/examples/terrainkit.ipynb"
    )
    assert str(kept).count("'image'") == 2
    assert (EXAMPLES / "terrainkit.ipynb").stat().st_size < 300_000


def outputs_of(cell):
    """Return the count of a cell, and the kinds of its outputs with their texts without numbers."""
    outputs = [
        (output.output_type, kind.removesuffix("/png").removesuffix("/jpeg"), text)
        for output in cell.get("outputs", ())
        for kind, data in sorted(output.data.items())
        for text in ([re.sub(r"[-\d.]+", "0", data)] if kind == "text/plain" else [""])
    ]
    return cell.get("execution_count"), outputs
