import json
import re
import shutil
from dataclasses import replace

import pytest

from tests.tables import read_table

pytest.importorskip("torch", reason="the extra `train` is not installed")

import torch

from terrainkit.export import exporters_by_suffix
from terrainkit_cli.export_command import Export
from terrainkit_robots.rl import tasks
from terrainkit_robots.rl.config import Env, Policy, Runner, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import create_run
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.terrain import Plane

FILES = ["policy.json", "policy.onnx", "policy.pt", "robot.xml"]


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """Return the folder of a run with two checkpoints."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    task = Task(
        env=Env(num_envs=4, num_threads=1),
        runner=Runner(num_steps_per_env=4, save_interval=1),
        policy=Policy(actor_hidden_dims=(8,), critic_hidden_dims=(8,)),
    )
    folder = tmp_path_factory.mktemp("runs") / "run"
    run = create_run(folder, task, "quadruped", "plane")
    LeggedRunner(LeggedEnv(run.task, run.robot, Plane()), folder).learn(2)
    yield folder
    torch.set_num_threads(threads)


@pytest.fixture
def run_folder(trained, tmp_path):
    shutil.copytree(trained, tmp_path / "run")
    return tmp_path / "run"


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_export_run_into_its_own_folder(terrainkit, run_folder):
    run = terrainkit("export", "run")
    assert (run.returncode, run.stderr) == (0, "")
    assert names(run_folder / "exported") == FILES
    first, second, note = run.stdout.splitlines()
    assert first.startswith("wrote run/exported/policy.onnx, run/exported/policy.pt, ")
    assert first.endswith("141 observations to 12 actions, from model_2.pt")
    assert second.startswith("verified: largest difference from the checkpoint: policy.onnx ")
    assert second.endswith(", policy.pt 0.0e+00")
    assert "stop at unknown observations: moving_gait_phase; add them" in note
    assert json.loads((run_folder / "exported" / "policy.json").read_text())["iteration"] == 2
    run = terrainkit("export", "run", "--checkpoint", 1, "-o", "a")
    assert run.stdout.splitlines()[0].endswith("141 observations to 12 actions, from model_1.pt")
    assert names(run_folder.parent / "a") == FILES


@pytest.mark.usefixtures("run_folder")
def test_export_example_beside_the_policy(terrainkit, tmp_path):
    run = terrainkit("export", "run", "-o", "policy", "--example")
    assert run.returncode == 0, run.stderr
    assert names(tmp_path / "policy") == [*FILES, "run_policy.py"]
    assert run.stdout.splitlines()[-1] == "next: python policy/run_policy.py --vx 0.5 --viewer"


@pytest.mark.usefixtures("run_folder")
def test_export_overwrites_with_option_only(terrainkit, tmp_path):
    assert terrainkit("export", "run", "-o", "policy").returncode == 0
    (tmp_path / "policy" / "policy.pt").write_bytes(b"mine")
    run = terrainkit("export", "run", "-o", "policy")
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert "policy/policy.pt exists" in run.stderr or "policy/policy.onnx exists" in run.stderr
    assert (tmp_path / "policy" / "policy.pt").read_bytes() == b"mine"
    assert terrainkit("export", "run", "-o", "policy", "--overwrite").returncode == 0
    assert (tmp_path / "policy" / "policy.pt").stat().st_size > 1000


def test_export_bundled_policy_by_name(terrainkit, trained, tmp_path, monkeypatch):
    bundled = tasks.get_task("quadruped")
    folder = tmp_path / "package"
    shutil.copytree(bundled.folder, folder, ignore=shutil.ignore_patterns("trained"))
    monkeypatch.setitem(tasks._registered, "quadruped", replace(bundled, folder=folder))
    run = terrainkit("export", "quadruped")
    assert run.returncode == 2
    assert "no policy is shipped with quadruped" in run.stderr
    shipped = tasks.get_task("quadruped").trained_run
    shutil.copytree(trained, shipped)
    run = terrainkit("export", "quadruped")
    assert run.returncode == 0, run.stderr
    assert names(tmp_path / "quadruped_policy") == FILES
    assert names(shipped) == names(trained)


def test_export_help_names_every_format():
    formats, _, _ = Export.__doc__.partition("Some formats also write files")
    named = re.findall(r"(?<!\w)\.[a-z]+", formats)
    assert {*named, ".usda", ".usdc"} == {*exporters_by_suffix()}


def test_export_map(terrainkit, tmp_path):
    words = ("--rows", 1, "--cols", 1, "--terrain", "stairs", "--patch-size", 5, 4, "--border", 1)
    assert terrainkit("generate", "-o", "map.npz", *words).returncode == 0
    run = terrainkit("export", "map.npz", "-o", "map.stl", "--full")
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("wrote map.stl: 1 x 1 patches")
    assert (tmp_path / "map.stl").stat().st_size > 1000
    assert terrainkit("export", "map.npz", "-o", "e/f/map.xml").returncode == 0
    assert (tmp_path / "e" / "f" / "map.xml").is_file()
    run = terrainkit("export", "map.npz", "-o", "ros.yaml", "--height-band", "0.1:1.0")
    assert run.stdout.startswith("wrote ros.yaml, with ros.json, ros.pgm, ros.png beside it: 1 x 1")
    run = terrainkit("export", "map.npz", "-o", "model.sdf")
    assert run.stdout.startswith("wrote model.sdf, with model.stl beside it: 1 x 1")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        *read_table(__file__, "export_rejects_invalid_input"),
        ("x" * 5000, "cannot read"),
    ],
    ids=lambda text: text[:30],
)
@pytest.mark.usefixtures("run_folder")
def test_export_rejects_invalid_input(rejected, terrainkit, tmp_path, words, message):
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.txt").write_text("no map")
    if words.startswith("map.npz"):
        small = ("--rows", 1, "--cols", 1, "--terrain", "flat", "--patch-size", 4, 4)
        assert terrainkit("generate", "-o", "map.npz", *small).returncode == 0
    before = sorted(tmp_path.rglob("*"))
    assert message in rejected(f"export {words}")
    assert sorted(tmp_path.rglob("*")) == before
