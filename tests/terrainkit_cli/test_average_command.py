import shutil

import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit_robots.checkpoint import read_checkpoint, save_checkpoint
from terrainkit_robots.rl.run import open_run


@pytest.fixture
def run_folder(tmp_path):
    """Return the folder of a run with the checkpoints 1, 2 and 3."""
    bundled = open_run("quadruped")
    folder = shutil.copytree(bundled.folder, tmp_path / "run")
    (folder / bundled.checkpoint.name).unlink()
    for iteration in (1, 2, 3):
        state = read_checkpoint(bundled.checkpoint) | {"iteration": iteration}
        save_checkpoint(folder / f"model_{iteration}.pt", state)
    return folder


@pytest.mark.usefixtures("run_folder")
def test_average_writes_a_run(terrainkit):
    run = terrainkit("average", "run/model_2.pt", "--checkpoints", 2, "-o", "new")
    wrote = "wrote new: the mean of 2 checkpoints, 1 to 2\nnext: terrainkit evaluate new\n"
    assert (run.returncode, run.stdout, run.stderr) == (0, wrote, "")
    run = terrainkit("export", "new", "-o", "policy")
    assert run.stdout.splitlines()[0].endswith("141 observations to 12 actions, from model_2.pt")


@pytest.mark.usefixtures("run_folder")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["run"], "RUN, --output: missing; expected a run, and the folder of a new one"),
        (["none", "-o", "new"], "run: got none; expected a folder that terrainkit train wrote"),
        (["run", "-o", "run"], "run exists; choose another folder"),
        (["run", "-o", "new"], "checkpoints: got 7; expected at least 2; run has 3 up to"),
    ],
)
def test_average_rejects(terrainkit, tmp_path, words, message):
    run = terrainkit("average", *words, "--checkpoints", 3 if words[-1] == "run" else 7)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith(f"terrainkit: error: {message}")
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
