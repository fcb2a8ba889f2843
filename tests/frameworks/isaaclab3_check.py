"""Run maps in Isaac Lab 3 on Newton, without Isaac Sim; `make integrations` runs it."""

import argparse
import contextlib
import importlib
import os
import re
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch
from isaaclab.app import launch_simulation
from isaaclab.assets import RigidObjectCfg
from isaaclab.envs import ManagerBasedRLEnv, ManagerBasedRLEnvCfg
from isaaclab.managers import (
    CurriculumTermCfg,
    EventTermCfg,
    ObservationGroupCfg,
    ObservationTermCfg,
    RewardTermCfg,
    SceneEntityCfg,
    TerminationTermCfg,
)
from isaaclab.scene import InteractiveSceneCfg
from isaaclab.sensors import RayCasterCfg, patterns
from isaaclab.sim import (
    MassCfg,
    SimulationCfg,
    SphereCfg,
    UsdPhysicsCollisionCfg,
    UsdPhysicsRigidBodyCfg,
)
from isaaclab.utils import configclass
from isaaclab_newton.physics import MJWarpSolverCfg, NewtonCfg, NewtonCollisionPipelineCfg
from isaaclab_tasks.core.velocity import mdp, velocity_env_cfg
from pages import page_block
from parkour import CONFIG, RADIUS, ball_starts, rest_error
from scipy.ndimage import maximum_filter, minimum_filter

import terrainkit
from terrainkit.integrations.isaaclab import terrain_importer_cfg
from terrainkit_robots.description import bundled
from terrainkit_robots.onboarding.onboard_options import OnboardOptions
from terrainkit_robots.onboarding.pipeline import onboard

folder = Path(sys.argv[1])
os.chdir(folder)


@configclass
class SceneCfg(InteractiveSceneCfg):
    """A ball instead of a robot, with the height scanner of the velocity task."""

    terrain = None
    robot = RigidObjectCfg(
        prim_path="{ENV_REGEX_NS}/Robot",
        spawn=SphereCfg(
            radius=RADIUS,
            rigid_props=UsdPhysicsRigidBodyCfg(),
            mass_props=MassCfg(mass=1.0),
            collision_props=UsdPhysicsCollisionCfg(),
        ),
        init_state=RigidObjectCfg.InitialStateCfg(pos=(0.0, 0.0, RADIUS + 0.02)),
    )
    height_scanner = RayCasterCfg(
        prim_path="{ENV_REGEX_NS}/Robot",
        offset=RayCasterCfg.OffsetCfg(pos=(0.0, 0.0, 20.0)),
        ray_alignment="yaw",
        pattern_cfg=patterns.GridPatternCfg(resolution=0.1, size=[1.6, 1.0]),
        mesh_prim_paths=["/World/ground"],
        global_world_only=True,
    )


@configclass
class PolicyCfg(ObservationGroupCfg):
    """The height scan as observation."""

    scan = ObservationTermCfg(
        func=mdp.height_scan, params={"sensor_cfg": SceneEntityCfg("height_scanner")}
    )


@configclass
class ActionsCfg:
    """No actions."""


@configclass
class CommandsCfg:
    """The command that the curriculum reads."""

    base_velocity = mdp.UniformVelocityCommandCfg(
        asset_name="robot",
        resampling_time_range=(10.0, 10.0),
        ranges=mdp.UniformVelocityCommandCfg.Ranges(
            lin_vel_x=(1.5, 2.0), lin_vel_y=(0.0, 0.0), ang_vel_z=(0.0, 0.0)
        ),
    )


@configclass
class TerminationsCfg:
    """The terms that end an episode."""

    time_out = TerminationTermCfg(func=mdp.time_out, time_out=True)
    out = TerminationTermCfg(func=mdp.terrain_out_of_bounds, time_out=True)


@configclass
class CurriculumCfg:
    """The curriculum of the velocity task."""

    terrain_levels = CurriculumTermCfg(func=mdp.terrain_levels_vel)


def env_cfg(terrain, use_mujoco_contacts):
    """Return an environment with the terms of the velocity task that depend on the terrain."""
    solver = MJWarpSolverCfg(njmax=300, nconmax=100, use_mujoco_contacts=use_mujoco_contacts)
    pipeline = None if use_mujoco_contacts else NewtonCollisionPipelineCfg()
    newton = NewtonCfg(solver_cfg=solver, collision_cfg=pipeline, num_substeps=2)
    reset = {"pose_range": {}, "velocity_range": {}}
    return ManagerBasedRLEnvCfg(
        sim=SimulationCfg(dt=0.005, device="cpu", physics=newton),
        scene=SceneCfg(num_envs=16, env_spacing=0.0, terrain=terrain),
        observations={"policy": PolicyCfg()},
        actions=ActionsCfg(),
        commands=CommandsCfg(),
        rewards={"alive": RewardTermCfg(func=mdp.is_alive, weight=1.0)},
        terminations=TerminationsCfg(),
        events={
            "reset": EventTermCfg(func=mdp.reset_root_state_uniform, mode="reset", params=reset)
        },
        curriculum=CurriculumCfg(),
        decimation=4,
        episode_length_s=4.0,
    )


@contextlib.contextmanager
def environment(terrain, use_mujoco_contacts=False, use_curriculum=False):
    """Make the environment on a terrain."""
    cfg = env_cfg(terrain, use_mujoco_contacts)
    if use_curriculum:
        exec(page_block("levels.md", "use_terrain_curriculum(env"), {"env_cfg": cfg})
    with launch_simulation(cfg=cfg, launcher_args=argparse.Namespace(device="cpu", headless=True)):
        env = ManagerBasedRLEnv(cfg)
        yield env
        env.close()


def place(env, positions):
    """Place the balls [m], shape (16, 3), in the frame of the simulation."""
    pose = torch.zeros(16, 7)
    pose[:, :3], pose[:, 6] = torch.as_tensor(positions, dtype=torch.float), 1.0
    env.scene["robot"].write_root_pose_to_sim_index(root_pose=pose)
    env.scene["robot"].write_root_velocity_to_sim_index(root_velocity=torch.zeros(16, 6))


def flat_starts(terrain_map):
    """Return the positions of balls over flat spots of all heights [m], shape (16, 3)."""
    heights = terrain_map.heights
    flat = maximum_filter(heights, 3) == minimum_filter(heights, 3)
    border = terrain_map.config.border_cells  # an episode would end on it
    flat[:border] = flat[-border:] = flat[:, :border] = flat[:, -border:] = False
    i, j = np.nonzero(flat)
    order = np.argsort(heights[i, j], kind="stable")[np.linspace(0, len(i) - 1, 16, dtype=int)]
    xy = terrain_map.first_sample + (np.stack([i, j], axis=1)[order]) * terrain_map.grid.cell
    return np.column_stack([xy, terrain_map.height(xy) + RADIUS + 0.02])


def rest(terrain_map, starts, *, heightfield=None, use_mujoco_contacts=False):
    """Return the largest distance of balls at rest from the surface [m], and the start time [s]."""
    path = terrain_map.save(folder / "map.npz", overwrite=True)
    center, start = [*terrain_map.grid.center, 0.0], time.perf_counter()
    terrain = terrain_importer_cfg(path, heightfield=heightfield)
    with environment(terrain, use_mujoco_contacts) as env:
        started = time.perf_counter() - start
        env.reset()
        place(env, starts - center)
        for _ in range(50):
            env.step(torch.zeros(16, 0))
        positions = env.scene["robot"].data.root_pos_w.torch.numpy() + center
    return rest_error(terrain_map, starts, positions), started


def rejected(terrain_map, heightfield, **options):
    """Return the error with which a map is rejected when the simulation starts."""
    try:
        rest(terrain_map, starts, heightfield=heightfield, **options)
    except terrainkit.TerrainkitError as error:
        return str(error)
    return "no error"


def make_map(*names, **options):
    """Return a map without solids."""
    terrains = tuple(terrainkit.SubTerrain(terrain=name) for name in names)
    size = {"rows": 3, "cols": 4, "patch_size": (8.0, 6.0), "border": 5.0}
    return terrainkit.generate(terrainkit.MapConfig(terrains=terrains, **size, **options))


# Isaac Lab's own terms on a heightfield.
ground = make_map("stairs", "pit", "slope", "rough")
ground.save("map.npz")
cfg = env_cfg(None, use_mujoco_contacts=False)
exec(page_block("isaaclab.md", "max_init_terrain_level"), {"env_cfg": cfg})
terrain = cfg.scene.terrain
terrain.max_init_terrain_level = 1
terrain.terrain_generator.num_rows = 5  # as in play mode
center = np.array([*ground.grid.center, 0.0])
with environment(terrain) as env:
    importer, ball = env.scene.terrain, env.scene["robot"].data
    origins = ground.env_origins - center
    np.testing.assert_allclose(importer.terrain_origins, origins, atol=1e-4)
    assert importer.terrain_levels.max() <= 1
    assert importer.flat_patches["init_pos"].shape == (3, 4, 1, 3)
    env.reset()
    env.step(torch.zeros(16, 0))
    hits = env.scene["height_scanner"].data.ray_hits_w.torch.numpy().reshape(-1, 3)
    within = np.abs(ground.scan(hits + center + [0, 0, 5.0]) - hits[:, 2]) < 1e-3
    assert within.mean() > 0.95, within.mean()  # the others hit a wall
    # `terrain_out_of_bounds` ends an episode 3 m from the edge, here at x = 14 m.
    place(env, np.tile([13.8, 0.0, 1.0], (16, 1)) + [[0.4 * (k % 2), 0, 0] for k in range(16)])
    env.step(torch.zeros(16, 0))
    out = env.termination_manager.get_term("out")
    assert (out == (torch.arange(16) % 2 == 1)).all(), out
    before = importer.terrain_levels.clone()
    env.reset()  # all balls are more than 4 m from their origins
    assert (importer.terrain_levels > before).any()
    levels = importer.terrain_levels
    expected = importer.terrain_origins[levels, importer.terrain_types]
    np.testing.assert_allclose(importer.env_origins, expected)
with environment(terrain, use_curriculum=True) as env:
    importer = env.scene.terrain
    env.reset()
    before = importer.terrain_levels.clone()
    position = importer.env_origins + torch.tensor([0.0, 0.0, 1.0])
    for _ in range(200):
        # Half of the balls follow their commands, 1.5 to 2 m/s ahead; the others stay.
        command = env.command_manager.get_command("base_velocity")
        position[::2, 0] += command[::2, 0] * env.step_dt
        place(env, position)
        log = env.step(torch.zeros(16, 0))[-1]["log"]
    assert (importer.terrain_levels[1::2] <= before[1::2]).all()
    assert (importer.terrain_levels[::2] > before[::2]).any()
    assert "Curriculum/terrain_levels/success/stairs" in log
print(f"Isaac Lab {version('isaaclab')}, Newton {version('newton')}: levels move, ", end="")
print(f"{within.mean():.1%} of {len(within)} rays within 1 mm")

# The velocity task of an onboarded robot.
options = OnboardOptions(frameworks=("isaaclab",), render_images=False)
onboard(bundled.urdf_path("quadruped"), folder / "quadruped", options)
sys.path.insert(0, str(folder / "quadruped"))
config = importlib.import_module("isaaclab_config")
task, default = config.RoughEnvCfg(), velocity_env_cfg.LocomotionVelocityRoughEnvCfg()
for group in ("actions", "commands", "curriculum", "events", "observations", "rewards"):
    # A misspelled term would be a new one.
    assert vars(getattr(task, group)).keys() == vars(getattr(default, group)).keys()
agent = config.__doc__.split("rsl_rl_cfg_entry_point")[1].split('"')[2]
module, _, made = f"{config.velocity_env_cfg.__package__}{agent}".partition(":")
assert hasattr(importlib.import_module(module), made)

# A mesh file, as in isaaclab.md.
ground.save("scan.stl")
exec(page_block("isaaclab.md", "from terrainkit import import_map"), {"env_cfg": cfg})
scan = terrainkit.TerrainMap.load("scan.npz")
with environment(cfg.scene.terrain) as env:
    found = np.asarray(env.scene.terrain.terrain_origins, float).reshape(3)
    np.testing.assert_allclose(found, scan.env_origins[0, 0] - [*scan.grid.center, 0.0], atol=1e-4)
print("a mesh file is the terrain")

# Balls at rest on a heightfield and on a mesh, with both contact pipelines.
starts = flat_starts(ground)
for heightfield in (True, False):
    error, started = rest(ground, starts, heightfield=heightfield)
    assert error < 2e-3, error
    kind = "heightfield" if heightfield else "mesh"
    print(f"{kind}: started in {started:.1f} s, all balls within {error * 1e3:.1f} mm")
    assert "use_mujoco_contacts=True" in rejected(ground, heightfield, use_mujoco_contacts=True)
assert "expected 0.7" in rejected(make_map("stairs", static_friction=0.7), heightfield=True)
stairs = make_map("stairs")
error, _ = rest(stairs, flat_starts(stairs), use_mujoco_contacts=True)
assert error < 2e-3, error
print(f"heightfield and MuJoCo's own contacts: all balls within {error * 1e3:.1f} mm")
parkour = terrainkit.generate(CONFIG)
error, started = rest(parkour, ball_starts(parkour))
assert error < 2e-3, error
print(f"mesh with solids: started in {started:.1f} s, all balls within {error * 1e3:.1f} mm")

example = Path(__file__).parents[2] / "docs/examples/isaaclab_terrain.py"
ROBOT_EXAMPLE = Path(__file__).parents[2] / "docs/examples/isaaclab_robot.py"
run = subprocess.run([sys.executable, example], cwd=folder, capture_output=True, text=True)
(distance,) = re.findall(r"balls rest within ([0-9.]+) mm", run.stdout) or [run.stderr]
assert float(distance) < 2.0, distance
print(f"{example.name}: all balls within {distance} mm")

for robot in ("quadruped", "biped"):
    command = [sys.executable, ROBOT_EXAMPLE, robot]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert "Learning iteration 1/2" in run.stdout, run.stderr
print("isaaclab_robot.py: the quadruped and the biped train two iterations")
