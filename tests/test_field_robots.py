"""Tests of the list of robots in docs/field_robots.toml, and of how it is written."""

import importlib.util
import tomllib
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PACKAGES = tomllib.loads((DOCS / "field_robots.toml").read_text())
NAMED = ("genesis-world", "mjlab", "playground", "dm-control", "gymnasium-robotics")
LEGGED = ("quadruped", "biped", "hexapod", "leg")

LEGGED_GYM = """
class GoCfg(Base):
    class init_state(Base.init_state):
        pos = [0.0, 0.0, 0.4]
        default_joint_angles = {"FL_hip": 0.1, "FL_calf": -1.5}
    class control:
        stiffness = {"joint": 10.0, "FL": 20.0}
        damping = {"FL": 0.5}
class Other:
    stiffness = {"FL": 99.0}
"""
ISAAC_LAB = """
GO_CFG = ArticulationCfg(
    spawn=UrdfFileCfg(gains=PDGainsCfg(stiffness=0, damping=None)),
    init_state=InitialStateCfg(joint_pos={".*_hip": 0.1, ".*_calf": -1.5}),
    actuators={
        "legs": DCMotorCfg(joint_names_expr=["FL_.*"], stiffness=20.0, damping=0.5),
        "feet": Feet(joint_names_expr=[".*_toe"], stiffness={".*_toe": 5.0}, damping=FOOT),
    },
)
"""


@pytest.fixture(scope="module")
def published_gains():
    spec = importlib.util.spec_from_file_location("published", DOCS / "published_gains.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_field_robots_are_unique_and_listed_on_the_page():
    rows = [(name, row) for name, table in PACKAGES.items() for row in table["robots"]]
    page = (DOCS / "field_robots.md").read_text()
    for _, row in rows:
        assert {"file", "kind"} <= set(row) <= {"file", "kind", "published", "note"}
        assert row["file"].lower().endswith((".urdf", ".xml", ".xacro"))
        assert f"| {row['file']} | {row['kind']} |" in page
    assert len({(name, row["file"]) for name, row in rows}) == len(rows)
    assert sum(len(PACKAGES[name]["robots"]) for name in NAMED) >= 20
    assert sum(any(word in row["kind"] for word in LEGGED) for _, row in rows) >= 100
    assert all("commit" in table for name, table in PACKAGES.items() if "/" in name)


@pytest.mark.parametrize(
    ("text", "name", "stiffness"),
    [
        (LEGGED_GYM, "GoCfg", {"FL_hip": 20.0, "FL_calf": 20.0}),
        (ISAAC_LAB, "GO_CFG", {"FL_hip": 20.0, "FL_calf": 20.0, "RL_toe": 5.0}),
    ],
)
def test_published_values_are_read_without_running_the_file(
    published_gains, tmp_path, text, name, stiffness
):
    (tmp_path / "cfg.py").write_text("import isaacgym\n" + text)
    found = published_gains.read_published(tmp_path / f"cfg.py:{name}")
    values = {
        table: published_gains.values_of(patterns, ["FL_hip", "FL_calf", "RL_toe"])
        for table, patterns in found.items()
    }
    assert values == {
        "default_pose": {"FL_hip": 0.1, "FL_calf": -1.5},
        "stiffness": stiffness,
        "damping": {"FL_hip": 0.5, "FL_calf": 0.5},
    }


def test_place_without_gains_is_an_error(published_gains, tmp_path):
    (tmp_path / "cfg.py").write_text(LEGGED_GYM)
    with pytest.raises(ValueError, match=r"cfg\.py:None: no stiffness by joint"):
        published_gains.read_published(tmp_path / "cfg.py:None")
