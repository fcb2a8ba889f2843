import importlib.util
from functools import partial

import pytest

from tests.tables import read_table

pytest.importorskip("torch", reason="the extra `train` is not installed")

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit_robots.policy import play
from terrainkit_robots.rendering import video
from terrainkit_robots.rendering.child_process import RenderError

QUICK = ("--seconds", "0.04", "--num-envs", "1")
SMALL = ("--size", "96", "64")


@pytest.fixture
def here(run_beside_walk):
    """Run `terrainkit play` in a folder with a run `walk`."""
    return partial(run_beside_walk, "play")


def test_play_writes_a_video_named_as_the_run(here, tmp_path):
    code, out, err = here("walk", *QUICK, *SMALL)
    if "MuJoCo cannot render here" in err:
        pytest.skip(err)
    assert (code, err) == (0, "")
    assert "quadruped, model_7.pt, on plane: 1 robot, 0 fell" in out
    assert "wrote walk.mp4: 0.0 s, 0.0 MB" in out
    import cv2

    reader = cv2.VideoCapture(str(tmp_path / "walk.mp4"))
    more, frame = reader.read()
    assert more
    assert frame.shape == (64, 96, 3)


def test_play_names_the_missing_extra(here, rejected, monkeypatch):
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if "ffmpeg" in name else find_spec(name)
    )
    told = "missing packages: imageio_ffmpeg; run: pip install '.[train]'"
    assert told in rejected("play", "walk", *QUICK)
    code, out, _ = here("walk", *QUICK, "--no-video")
    assert code == 0
    assert [line.split(",")[0] for line in out.splitlines()] == [
        "quadruped",
        "commands followed: not measured",
    ]


def test_play_prints_a_table_for_a_map(here, tmp_path):
    terrains = (SubTerrain(terrain="flat"), SubTerrain(terrain="stairs"))
    config = MapConfig(rows=2, cols=2, patch_size=(6, 6), border=1, terrains=terrains)
    generate(config).save(tmp_path / "map.npz")
    code, out, _ = here("walk", "--terrain", "map.npz", "--no-video", "--seconds", "0.1")
    assert code == 0
    assert out.splitlines()[1] == "commands followed: not measured"
    lines = [line.split() for line in out.splitlines()[2:]]
    assert lines[0] == ["terrain", "robots", "fell", "m/s", "rad/s", "success", "level", "0", "1"]
    assert lines[1] == ["flat", "2", "0", "-", "-", "-", "-", "-"]
    assert [line[0] for line in lines[1:]] == ["flat", "stairs", "forward"]
    assert sorted(each.name for each in tmp_path.iterdir()) == ["map.npz", "walk"]


def test_play_prints_the_table_without_a_renderer(here, tmp_path, monkeypatch):
    def write_video(*_, **__):
        raise RenderError("MuJoCo cannot render here")

    monkeypatch.setattr(video, "write_video", write_video)
    code, out, err = here("walk", *QUICK)
    assert (code, err) == (2, "terrainkit: error: MuJoCo cannot render here\n")
    assert "1 robot" in out
    assert [each.name for each in tmp_path.iterdir()] == ["walk"]


@pytest.mark.usefixtures("walking")
def test_play_checks_the_target_first(rejected, tmp_path, monkeypatch):
    monkeypatch.setattr(play, "play", None)
    (tmp_path / "walk.mp4").write_bytes(b"mine")
    assert "walk.mp4 exists" in rejected("play", "walk", *QUICK)
    assert (tmp_path / "walk.mp4").read_bytes() == b"mine"


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "play_rejects_invalid_input"))
@pytest.mark.usefixtures("walking")
def test_play_rejects_invalid_input(rejected, words, message):
    assert message in rejected(f"play {words}")
