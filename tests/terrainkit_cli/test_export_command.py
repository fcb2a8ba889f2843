import json
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

import torch

from terrainkit_cli import training_extra
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
def here(tmp_path, monkeypatch, run_main):
    """Run `terrainkit` in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return run_main


@pytest.fixture
def run_folder(trained, tmp_path):
    shutil.copytree(trained, tmp_path / "run")
    return tmp_path / "run"


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_export_run_into_its_own_folder(here, run_folder):
    run = here("export", "run")
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    assert names(run_folder / "exported") == FILES
    first, second = run.stdout.splitlines()
    assert first.startswith("wrote run/exported/policy.onnx, run/exported/policy.pt, ")
    assert first.endswith("47 observations to 12 actions, from model_2.pt")
    assert second.startswith("verified: largest difference from the checkpoint: policy.onnx ")
    assert second.endswith(", policy.pt 0.0e+00")
    config = json.loads((run_folder / "exported" / "policy.json").read_text())
    assert config["iteration"] == 2


def test_export_checkpoint_by_file_or_iteration(here, run_folder, tmp_path):
    iterations = {}
    for name, words in {
        "a": ("run/model_1.pt",),
        "b": ("run", "--checkpoint", 1),
        "c": ("run/model_2.pt",),
    }.items():
        run = here("export", *words, "-o", name)
        assert run.returncode == 0, run.stderr
        iterations[name] = json.loads((tmp_path / name / "policy.json").read_text())["iteration"]
    assert iterations == {"a": 1, "b": 1, "c": 2}
    onnx = {name: (tmp_path / name / "policy.onnx").read_bytes() for name in iterations}
    assert onnx["a"] == onnx["b"] != onnx["c"]
    assert "exported" not in names(run_folder)


@pytest.mark.usefixtures("run_folder")
def test_export_example_beside_the_policy(here, tmp_path):
    run = here("export", "run", "-o", "policy", "--example")
    assert run.returncode == 0, run.stderr
    assert names(tmp_path / "policy") == [*FILES, "run_policy.py"]
    assert run.stdout.splitlines()[2] == "next: python policy/run_policy.py --vx 0.5 --viewer"


@pytest.mark.usefixtures("run_folder")
def test_export_overwrites_with_option_only(here, tmp_path):
    assert here("export", "run", "-o", "policy").returncode == 0
    (tmp_path / "policy" / "policy.pt").write_bytes(b"mine")
    run = here("export", "run", "-o", "policy")
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert "policy/policy.pt exists" in run.stderr or "policy/policy.onnx exists" in run.stderr
    assert (tmp_path / "policy" / "policy.pt").read_bytes() == b"mine"
    assert here("export", "run", "-o", "policy", "--overwrite").returncode == 0
    assert (tmp_path / "policy" / "policy.pt").stat().st_size > 1000


def test_export_bundled_policy_by_name(here, trained, tmp_path, monkeypatch):
    bundled = tasks.get_task("quadruped")
    folder = tmp_path / "package"
    shutil.copytree(bundled.folder, folder, ignore=shutil.ignore_patterns("trained"))
    monkeypatch.setitem(tasks._registered, "quadruped", replace(bundled, folder=folder))
    run = here("export", "quadruped")
    assert run.returncode == 2
    assert "no policy is shipped with quadruped" in run.stderr
    shipped = tasks.get_task("quadruped").trained_run
    shutil.copytree(trained, shipped)
    run = here("export", "quadruped")
    assert run.returncode == 0, run.stderr
    assert names(tmp_path / "quadruped_policy") == FILES
    assert names(shipped) == names(trained)


def test_export_map(here, tmp_path):
    words = ("--rows", 1, "--cols", 1, "--terrain", "stairs", "--patch-size", 5, 4, "--border", 1)
    assert here("generate", "-o", "map.npz", *words).returncode == 0
    run = here("export", "map.npz", "-o", "map.stl", "--full")
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("wrote map.stl: 1 x 1 patches")
    assert (tmp_path / "map.stl").stat().st_size > 1000
    assert here("export", "map.npz", "-o", "e/f/map.xml").returncode == 0
    assert (tmp_path / "e" / "f" / "map.xml").is_file()
    run = here("export", "map.npz", "-o", "ros.yaml", "--max-step", 0.1)
    assert run.stdout.startswith("wrote ros.yaml, with ros.json, ros.pgm, ros.png beside it: 1 x 1")
    run = here("export", "map.npz", "-o", "model.sdf")
    assert run.stdout.startswith("wrote model.sdf, with model.stl beside it: 1 x 1")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "MAP.npz or RUN: missing"),
        (("unicorn",), "no map, run or robot unicorn; robots are: biped"),
        (("none.npz", "-o", "a.stl"), "no file none.npz"),
        (("none.pt",), "run: got none.pt"),
        (("empty",), "empty has no run.toml"),
        (("text.txt", "-o", "a.stl"), "text.txt"),
        (("map.npz",), "--output: missing; expected a file"),
        (
            ("map.npz", "-o", "a.xml", "--checkpoint", 3),
            "--checkpoint: got the map map.npz",
        ),
        (("map.npz", "-o", "a.xml", "--example"), "--example: got the map map.npz"),
        (("run", "--collision", "boxes"), "--collision: got the run run; expected a map"),
        (("run", "--y-up"), "--y-up: got the run run; expected a map"),
        (("run", "--checkpoint", 7), "run: got checkpoint 7; expected one of: 1, 2"),
        (("run", "--checkpoint", -7), "run: got checkpoint -7"),
        (("run", "-o", "text.txt/policy"), "text.txt is not a folder"),
        (("run", "-o", "text.txt"), "text.txt exists"),
        (("x" * 5000,), "cannot read"),
    ],
    ids=lambda value: " ".join(map(str, value))[:40] if isinstance(value, tuple) else "",
)
@pytest.mark.usefixtures("run_folder")
def test_export_rejects_invalid_input(here, tmp_path, words, message):
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.txt").write_text("no map")
    if "map.npz" in words:
        small = ("--rows", 1, "--cols", 1, "--terrain", "flat", "--patch-size", 4, 4)
        assert here("generate", "-o", "map.npz", *small).returncode == 0
    before = sorted(tmp_path.rglob("*"))
    run = here("export", *words)
    assert run.returncode == 2
    assert run.stdout == ""
    assert run.stderr.count("\n") == 1
    assert message in run.stderr
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.usefixtures("run_folder")
def test_export_rejects_a_truncated_checkpoint(here, run_folder):
    path = run_folder / "model_2.pt"
    path.write_bytes(path.read_bytes()[:1000])
    run = here("export", "run")
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert "model_2.pt is not a checkpoint of terrainkit" in run.stderr
    assert "exported" not in names(run_folder)


@pytest.mark.usefixtures("run_folder")
def test_export_names_the_missing_extra(here, monkeypatch):
    monkeypatch.setattr(training_extra, "_PACKAGES", ("torch", "no_such_package"))
    run = here("export", "run")
    assert run.returncode == 2
    assert run.stderr == (
        "terrainkit: error: missing packages: no_such_package; run: "
        "pip install '.[train]' (in a clone of terrainkit)\n"
    )


def test_export_help_covers_maps_and_policies(terrainkit):
    message = terrainkit("export", "--help").stdout
    assert "MAP.npz|RUN" in message
    assert "policy.onnx" in message
    assert "heightfield" in message


def test_export_map_imports_no_torch(tmp_path, terrainkit):
    assert terrainkit("generate", "-o", "map.npz", "--rows", 1, "--cols", 2).returncode == 0
    code = (
        "import sys; from terrainkit_cli.main import main;"
        "main(['export', 'map.npz', '-o', 'map.png']); main(['--help']);"
        "print(sorted({'torch', 'rsl_rl', 'onnx', 'tensordict'} & set(sys.modules)))"
    )
    import sys

    run = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert run.stdout.endswith("[]\n")
    assert np.fromfile(tmp_path / "map.png", np.uint8).size > 1000
