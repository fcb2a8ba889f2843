"""Run the functions with which published works build their ground, and compare what they build.

`make integrations` runs this with the folder in WORKS. It has checkouts with the names of their
repositories, such as legged_gym and extreme-parkour, the source of the wheels of mjlab in mjlab/src
and of Isaac Lab in IsaacLab, and isaacgym/python/isaacgym of Isaac Gym. A work without a checkout
is not run. The numbers are in tests/terrainkit/terrain/works.json; with --write, they are written
anew.

python tests/frameworks/works_check.py [PRESET ...] [--write]
"""

import ast
import json
import os
import random
import re
import sys
from functools import partial
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from unittest.mock import MagicMock

import mujoco
import numpy as np
import torch
from scipy import interpolate
from stand_ins import StandIns

sys.path.append(str(Path(__file__).parents[2]))
from tests.ground_numbers import MEASURES, rounded

WORKS = Path(os.environ["WORKS"])
"""Folder with a checkout of each work, and with the package isaacgym of Isaac Gym."""

NUMBERS = Path(__file__).parents[1] / "terrainkit/terrain/works.json"
SEEDS = 10
RANDOM = ("field", "stones", "lane", "stairs", "ramps", "bars", "slits")


def load(name, path):
    """Load a file of a work as a module of this name."""
    spec = spec_from_file_location(name, WORKS / path)
    module = sys.modules[name] = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def seed_all(seed):
    """Seed the generators that works use."""
    np.random.seed(seed)  # noqa: NPY002
    random.seed(seed)
    torch.manual_seed(seed)


def bilinear(y, x, z, kind):
    """Stand in for `scipy.interpolate.interp2d`, which newer versions of SciPy lack."""
    assert kind == "linear"
    spline = interpolate.RectBivariateSpline(x, y, np.asarray(z, float), kx=1, ky=1)
    return lambda new_y, new_x: spline(new_x, new_y)


interpolate.interp2d = bilinear


GYM = ("isaacgym", "legged_gym", "humanoid", "pydelatin", "pyfqmr")
"""Packages that are stand-ins while the modules of a work are loaded."""


def gym_module(package, files):
    """Load files of a work in Isaac Gym by their modules, and return the modules."""
    finder = StandIns(GYM)
    sys.meta_path.insert(0, finder)
    try:
        base = ModuleType("base_config")
        base.BaseConfig = object
        sys.modules[f"{package}.envs.base.base_config"] = base
        utils = load("isaacgym.terrain_utils", "isaacgym/python/isaacgym/terrain_utils.py")
        modules = [load(f"{package}.{name}", path) for name, path in files.items()]
        modules[-1].terrain_utils = utils
    finally:
        sys.meta_path.remove(finder)
        for name in [each for each in sys.modules if each.split(".")[0] in GYM]:
            del sys.modules[name]
    return modules


def gym_work(module, cfg, kind="Terrain", **values):
    """Return the layout of the map of a work in Isaac Gym, and a function that makes a patch."""
    values = {"mesh_type": "heightfield", "curriculum": True} | values
    cfg = type("Config", (cfg,), values)
    calls = []

    class Recorder(getattr(module, kind)):
        def make_terrain(self, choice, difficulty):
            calls.append((choice, difficulty))

        def add_terrain_to_map(self, *arguments):
            pass

        def add_roughness(self, *arguments, **keywords):
            if self.is_rough:
                super().add_roughness(*arguments, **keywords)

    terrain = Recorder(cfg, 0)

    def build(choice, difficulty, seed, *, is_rough=False):
        terrain.is_rough = is_rough
        seed_all(seed)
        made = super(Recorder, terrain).make_terrain(choice, difficulty)
        return made.height_field_raw * cfg.vertical_scale

    layout = {
        "rows": cfg.num_rows,
        "cols": cfg.num_cols,
        "patch_size": [float(cfg.terrain_length), float(cfg.terrain_width)],
        "cell": cfg.horizontal_scale,
        "levels": [round(difficulty, 4) for _, difficulty in calls[: cfg.num_rows]],
    }
    ends = np.cumsum(np.array(cfg.terrain_proportions) / np.sum(cfg.terrain_proportions))
    choices = [choice for choice, _ in calls[:: cfg.num_rows]]
    return layout, choices, ends, build


def legged_gym(rough):
    """Yield the terrains of legged_gym with its proportions, or with equal proportions."""
    folder = "legged_gym/legged_gym"
    config, module = gym_module(
        "legged_gym",
        {
            "envs.base.legged_robot_config": f"{folder}/envs/base/legged_robot_config.py",
            "utils.terrain": f"{folder}/utils/terrain.py",
        },
    )
    values = {} if rough else {"terrain_proportions": [1 / 8] * 8}
    layout, choices, ends, build = gym_work(module, config.LeggedRobotCfg.terrain, **values)
    names = {
        "pyramid_slope_inverted": "slope",
        "pyramid_slope": "slope",
        "rough_slope": "field",
        "pyramid_stairs_inverted": "around_center",
        "pyramid_stairs": "around_center",
        "obstacles": "field",
        "stepping_stones": "stones",
        "gap": "around_center",
        "pit": "around_center",
    }
    bounds = [ends[0] / 2, *ends]
    if rough:
        layout["columns"] = [list(names)[np.searchsorted(bounds, each)] for each in choices]
    terrains = {}
    for (name, kind), end in zip(names.items(), bounds, strict=False):
        terrains[name] = kind, partial(build, end - 0.01)
    return layout, terrains


def humanoid_gym():
    folder = "humanoid-gym/humanoid"
    *_, config, module = gym_module(
        "humanoid",
        {
            "envs.base.legged_robot_config": f"{folder}/envs/base/legged_robot_config.py",
            "envs.custom.humanoid_config": f"{folder}/envs/custom/humanoid_config.py",
            "utils.terrain": f"{folder}/utils/terrain.py",
        },
    )
    cfg = config.XBotLCfg.terrain
    layout, _, ends, build = gym_work(module, cfg, "HumanoidTerrain", curriculum=cfg.curriculum)
    layout["levels"] = [0.0, 0.5, 1.0]  # drawn uniformly, and so is the terrain
    names = {
        "flat": "field",
        "obstacles": "field",
        "rough": "field",
        "pyramid_slope": "slope",
        "pyramid_slope_inverted": "slope",
    }
    layout["columns"] = "random"
    terrains = {
        name: (kind, partial(build, end - 0.01))
        for (name, kind), end in zip(names.items(), ends, strict=False)
    }
    return layout, terrains


def extreme_parkour():
    folder = "extreme-parkour/legged_gym/legged_gym"
    config, module = gym_module(
        "legged_gym",
        {
            "envs.base.legged_robot_config": f"{folder}/envs/base/legged_robot_config.py",
            "utils.terrain": f"{folder}/utils/terrain.py",
        },
    )
    layout, choices, ends, build = gym_work(module, config.LeggedRobotCfg.terrain)
    names = {15: "side_ramps", 16: "hurdles", 17: "rough", 18: "steps", 19: "gap_track"}
    kinds = {"steps": "stairs", "rough": "field", "side_ramps": "ramps"}
    layout["columns"] = [names[int(np.searchsorted(ends, each)) + 1] for each in choices]
    terrains = {
        name: (
            kinds.get(name, "lane"),
            partial(build, ends[place - 1] - 0.01, is_rough=name == "rough"),
        )
        for place, name in names.items()
    }
    return layout, terrains


def robot_parkour_learning():
    """Return the terrains of the four skills, each with a config of its own."""
    folder = "parkour/legged_gym/legged_gym"
    skills = {"climb": "jump", "leap": "leap", "crawl": "crawl", "tilt": "tilt"}
    kinds = {"climb": "stairs", "leap": "lane", "crawl": "bars", "tilt": "slits"}
    terrains = {}
    for name, skill in skills.items():
        *_, config, mesh_tools, module = gym_module(
            "legged_gym",
            {
                "utils.helpers": f"{folder}/utils/helpers.py",
                "envs.base.legged_robot_config": f"{folder}/envs/base/legged_robot_config.py",
                "envs.a1.a1_config": f"{folder}/envs/a1/a1_config.py",
                "envs.a1.a1_field_config": f"{folder}/envs/a1/a1_field_config.py",
                f"envs.a1.a1_{skill}_config": f"{folder}/envs/a1/a1_{skill}_config.py",
                "utils.trimesh": f"{folder}/utils/trimesh.py",
                "utils.terrain.barrier_track": f"{folder}/utils/terrain/barrier_track.py",
            },
        )
        module.trimesh = mesh_tools
        cfg = getattr(config, f"A1{skill.capitalize()}Cfg").terrain
        terrains[name] = kinds[name], partial(barrier_track, module, cfg)
    levels = [row / (cfg.num_rows - 1) for row in range(cfg.num_rows)]
    return {"rows": cfg.num_rows, "cell": cfg.horizontal_scale, "levels": levels}, terrains


def barrier_track(module, cfg, difficulty, seed):
    """Return a track of Robot Parkour Learning without noise: its heights, and boxes above."""
    kwargs = {**cfg.BarrierTrack_kwargs, "add_perlin_noise": False}
    values = {"mesh_type": None, "num_rows": 1, "num_cols": 1, "BarrierTrack_kwargs": kwargs}
    cfg = type("Config", (cfg,), values)
    seed_all(seed)
    track = module.BarrierTrack(cfg, 1)
    meshes = []
    track.device = "cpu"
    track.add_trimesh_to_sim = lambda mesh, origin: meshes.append(mesh[0] + origin)
    track.get_difficulty = lambda *_: (difficulty, kwargs["virtual_terrain"])
    track.initialize_track()
    track.build_heightfield_raw()
    track.initialize_track_info_buffer()
    track.add_track_to_sim([track.border, track.border, 0], row_idx=0, col_idx=0)
    size = [slice(track.border, track.border + count) for count in track.track_resolution]
    ground = track.heightfield_raw[tuple(size)] * cfg.vertical_scale
    # The 8 corners of a bar are the last vertices of a mesh.
    boxes = [each[-8:] for each in meshes if each[-8:, 2].max() > 0.1]
    offset = track.border * cfg.horizontal_scale
    return ground, [np.sort(each, axis=0)[[0, -1]] - [offset, offset, 0] for each in boxes]


ISAACLAB = ("carb", "cv2", "flatdict", "h5py", "hid", "isaacsim", "omni", "onnx", "pxr", "usdrt")
ISAACLAB += ("einops", "matplotlib", "prettytable", "toml", "transformers", "warp", "yaml")
ISAACLAB += ("requests", "uwlab_assets", "isaaclab_contrib")


SCALES = ("horizontal_scale", "vertical_scale", "slope_threshold")
"""Values that a map in Isaac Lab gives its terrains."""


def bare_package(name, path):
    """Make a package whose modules can be imported, without running its `__init__`."""
    module = sys.modules[name] = ModuleType(name)
    module.__path__ = [str(WORKS / path)]


def lab_configs(path, names, values):
    """Return some values of a file with a config, which is not imported as a whole."""
    tree = ast.parse((WORKS / path).read_text())
    tree.body = [
        node
        for node in tree.body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") in names
    ]
    exec(compile(tree, path, "exec"), values)
    return [values[name] for name in names]


def lab_work(packages, modules, path, names, kinds):
    """Return the layout and the terrains of a work in Isaac Lab.

    Args:
        packages: Folder of each package that is not to be run.
        modules: Modules with the configs of the terrains.
        path: File with the configs of the maps.
        names: Their names.
        kinds: Name and measure of each terrain, by the name in the work.
    """
    sys.path.insert(0, str(WORKS / "IsaacLab/source/isaaclab"))
    sys.meta_path.insert(0, StandIns(ISAACLAB))
    for package, folder in packages.items():
        bare_package(package, folder)
    generator = import_module("isaaclab.terrains.terrain_generator")
    known = {"terrain_gen": ModuleType("terrain_gen")}
    for module in ("isaaclab.terrains", "isaaclab.terrains.terrain_generator_cfg", *modules):
        values = vars(import_module(module))
        known |= values
        vars(known["terrain_gen"]).update(values)
    configs = lab_configs(path, names, known)
    terrains = {}
    for cfg in configs:
        for name in kinds.keys() & cfg.sub_terrains.keys():
            sub = cfg.sub_terrains[name]
            values = {"size": cfg.size, "wall_prob": [0.0] * 4, "perlin_cfg": None}
            values |= {key: getattr(cfg, key) for key in SCALES}
            for key in values.keys() & vars(sub).keys():
                setattr(sub, key, values[key])
            ours, kind = kinds[name]
            terrains[ours] = kind, partial(lab_ground, sub, cfg.horizontal_scale)
    rows = []

    class Recorder(generator.TerrainGenerator):
        def __init__(self):
            self.cfg, self.np_rng = cfg, np.random.default_rng(0)

        def _get_terrain_mesh(self, difficulty, sub):
            rows.append((difficulty, sub))
            return None, None

        def _add_sub_terrain(self, *arguments):
            pass

    Recorder()._generate_curriculum_terrains()
    names = {id(sub): kinds.get(name, [name])[0] for name, sub in cfg.sub_terrains.items()}
    levels = np.array([difficulty for difficulty, _ in rows]).reshape(cfg.num_cols, -1)
    layout = {
        "rows": cfg.num_rows,
        "cols": cfg.num_cols,
        "patch_size": [float(each) for each in cfg.size],
        "cell": cfg.horizontal_scale,
        "columns": [names[id(sub)] for _, sub in rows[:: cfg.num_rows]],
    }
    # Uniform between i / rows and (i + 1) / rows.
    assert (np.floor(levels * cfg.num_rows) == np.arange(cfg.num_rows)).all()
    layout["levels"] = [(row + 0.5) / cfg.num_rows for row in range(cfg.num_rows)]
    if len(configs) > 1:  # a map for each terrain
        del layout["columns"]
    return layout, terrains


def lab_ground(cfg, cell, difficulty, seed):
    """Return the heights of a terrain in Isaac Lab: its height field, or its meshes by cell."""
    seed_all(seed)
    utils = import_module("isaaclab.terrains.height_field.utils")
    fields = []

    def record(heights, _, vertical_scale, __):
        fields.append(heights * vertical_scale)
        return np.eye(3), np.array([[0, 1, 2]])

    utils.convert_height_field_to_mesh = record
    meshes, _ = cfg.function(difficulty, cfg)
    if fields:
        return fields[0][:-1, :-1]
    ground = np.full([round(side / cell) for side in cfg.size], -np.inf)
    for mesh in meshes:
        for triangle in np.asarray(mesh.triangles)[np.asarray(mesh.face_normals)[:, 2] > 0.01]:
            raise_ground(ground, triangle, cell)
    return np.maximum(ground, -10.0)  # holes without a floor


def raise_ground(ground, triangle, cell):
    """Raise heights at the centers of cells to a triangle above them."""
    low = np.ceil(triangle[:, :2].min(axis=0) / cell - 0.5 - 1e-6).astype(int).clip(0)
    high = np.floor(triangle[:, :2].max(axis=0) / cell - 0.5 + 1e-6).astype(int) + 1
    high = np.minimum(high, ground.shape)
    if (low >= high).any():
        return
    edges = np.column_stack([triangle[1] - triangle[0], triangle[2] - triangle[0]])
    x, y = ((np.arange(a, b) + 0.5) * cell for a, b in zip(low, high, strict=True))
    points = np.stack(np.meshgrid(x, y, indexing="ij"), -1) - triangle[0, :2]
    weights = points @ np.linalg.inv(edges[:2]).T
    inside = (weights >= -1e-6).all(axis=-1) & (weights.sum(axis=-1) <= 1 + 1e-6)
    z = np.where(inside, triangle[0, 2] + weights @ edges[2], -np.inf)
    part = ground[low[0] : high[0], low[1] : high[1]]
    np.maximum(part, z, out=part)


def mjlab():
    """Return the terrains of mjlab's map for walking."""
    sys.modules["mjlab"] = ModuleType("mjlab")
    sys.modules["mjlab"].__path__ = [str(WORKS / "mjlab/src/mjlab")]
    sys.modules["mjlab.terrains.terrain_entity"] = MagicMock()  # needs the whole framework
    names = {
        "flat": ("flat", "field"),
        "pyramid_stairs": ("pyramid_stairs", "around_center"),
        "pyramid_stairs_inv": ("pyramid_stairs_inverted", "around_center"),
        "hf_pyramid_slope": ("pyramid_slope", "slope"),
        "hf_pyramid_slope_inv": ("pyramid_slope_inverted", "slope"),
        "random_rough": ("rough", "field"),
        "wave_terrain": ("wave", "field"),
    }
    cfg = import_module("mjlab.terrains.config").ROUGH_TERRAINS_CFG

    def build(sub, difficulty, seed):
        spec = mujoco.MjSpec()
        spec.worldbody.add_body(name="terrain")
        sub.size = cfg.size
        sub.function(difficulty, spec, np.random.default_rng(seed))
        model = spec.compile()
        ground = np.full((80, 80), -np.inf)
        x = y = (np.arange(80) + 0.5) * 0.1
        for geom in range(model.ngeom):
            center, size = model.geom_pos[geom], model.geom_size[geom]
            part = np.ix_(abs(x - center[0]) < size[0], abs(y - center[1]) < size[1])
            if model.geom_dataid[geom] < 0:
                ground[part] = np.maximum(ground[part], center[2] + size[2])
        if model.nhfield:  # rows are along y
            shape = model.hfield_nrow[0], model.hfield_ncol[0]
            field = model.hfield_data.reshape(shape).T * model.hfield_size[0, 2]
            ground = field[:80, :80] + model.geom_pos[model.geom_dataid == 0][0, 2]
        return ground

    terrains = {}
    for name, sub in cfg.sub_terrains.items():
        ours, kind = names[name]
        terrains[ours] = kind, partial(build, sub)
    rows = cfg.num_rows
    layout = {"rows": rows, "patch_size": [*cfg.size], "cell": 0.1}
    layout["levels"] = [round(row / (rows - 1), 4) for row in range(rows)]
    return layout, terrains


isaaclab = partial(
    lab_work,
    {},
    (),
    "IsaacLab/source/isaaclab/isaaclab/terrains/config/rough.py",
    ("ROUGH_TERRAINS_CFG",),
    {
        "pyramid_stairs": ("pyramid_stairs", "around_center"),
        "pyramid_stairs_inv": ("pyramid_stairs_inverted", "around_center"),
        "boxes": ("random_grid", "field"),
        "random_rough": ("rough", "field"),
        "hf_pyramid_slope": ("pyramid_slope", "slope"),
        "hf_pyramid_slope_inv": ("pyramid_slope_inverted", "slope"),
    },
)
risky_terrains = partial(
    lab_work,
    {
        "uwlab": "UWLab/source/uwlab/uwlab",
        "uwlab.terrains": "UWLab/source/uwlab/uwlab/terrains",
    },
    ("uwlab.terrains.trimesh", "uwlab.terrains.utils"),
    "UWLab/source/uwlab_tasks/uwlab_tasks/manager_based/locomotion/risky_terrains/config/terrains"
    "/terrain_cfg.py",
    ("BALANCE_BEAMS_CFG", "STEPPING_BEAMS_CFG", "RISKY_TERRAINS_CFG"),
    {
        "stones_everywhere": ("stones_everywhere", "stones"),
        "balance_beams": ("beams", "stones"),
        "stepping_beams": ("stepping_beams", "stones"),
    },
)
hiking_in_the_wild = partial(
    lab_work,
    {
        name: "InstinctLab/source/instinctlab/" + name.replace(".", "/")
        for name in ("instinctlab", "instinctlab.terrains", "instinctlab.utils")
    },
    ("instinctlab.terrains.height_field", "instinctlab.terrains.trimesh"),
    "InstinctLab/source/instinctlab/instinctlab/tasks/parkour/config/parkour_env_cfg.py",
    ("ROUGH_TERRAINS_CFG",),
    {
        "perlin_rough": ("rough", "field"),
        "perlin_rough_stand": ("rough", "field"),
        "square_gaps": ("gap", "around_center"),
        "pyramid_stairs": ("pyramid_stairs", "around_center"),
        "pyramid_stairs_high": ("pyramid_stairs_high", "around_center"),
        "pyramid_stairs_inv": ("pyramid_stairs_inverted", "around_center"),
        "pyramid_stairs_inv_high": ("pyramid_stairs_inverted_high", "around_center"),
        "boxes": ("obstacles", "field"),
        "mesh_boxes": ("small_obstacles", "field"),
        "hf_pyramid_slope_inv": ("pyramid_slope_inverted", "slope"),
    },
)


BUILDERS = {
    "legged_gym": partial(legged_gym, rough=False),
    "legged_gym_rough": partial(legged_gym, rough=True),
    "humanoid_gym": humanoid_gym,
    "extreme_parkour": extreme_parkour,
    "robot_parkour_learning": robot_parkour_learning,
    "mjlab": mjlab,
    "hiking_in_the_wild": hiking_in_the_wild,
    "risky_terrains": risky_terrains,
    "isaaclab": isaaclab,
}
"""Function that returns the layout of the map and the terrains of each work, by preset."""


SOURCES = {
    "legged_gym": "leggedrobotics/legged_gym at 8fa29ac, Terrain.make_terrain, equal proportions",
    "legged_gym_rough": "leggedrobotics/legged_gym at 8fa29ac, Terrain.make_terrain",
    "humanoid_gym": "roboterax/humanoid-gym at ae46e20, HumanoidTerrain.make_terrain",
    "extreme_parkour": "chengxuxin/extreme-parkour at d2ffe27, Terrain.make_terrain",
    "robot_parkour_learning": "ZiwenZhuang/parkour at 5e1f413, BarrierTrack.add_track_to_sim",
    "mjlab": "mjlab 1.6.0, ROUGH_TERRAINS_CFG",
    "hiking_in_the_wild": "project-instinct/InstinctLab at ef1e920, ROUGH_TERRAINS_CFG",
    "risky_terrains": "UW-Lab/UWLab at 36d98af, RISKY_TERRAINS_CFG and two others",
    "isaaclab": "Isaac Lab 2.3.2, ROUGH_TERRAINS_CFG",
}
"""Where the function was run. Works in Isaac Gym use the functions of isaacgym.terrain_utils."""


def measure(kind, build, difficulty, cell):
    """Return the numbers of the ground of a work at a difficulty."""
    grounds = [build(difficulty, seed) for seed in range(SEEDS if kind in RANDOM else 1)]
    if isinstance(grounds[0], tuple) and kind != "bars":
        grounds = [ground for ground, _ in grounds]
    return rounded(MEASURES[kind](grounds, cell))


def work_numbers(name):
    """Return what the functions of a work build."""
    layout, terrains = BUILDERS[name]()
    levels = layout["levels"]
    table = {"layout": layout, "terrains": {}}
    for terrain, (kind, build) in terrains.items():
        numbers = {
            str(level): measure(kind, build, level, layout["cell"])
            for level in (levels[0], levels[len(levels) // 2], levels[-1])
        }
        table["terrains"][terrain] = {"measure": kind, "numbers": numbers}
    return table


def is_as_known(known, numbers):
    """Return whether numbers have those that are known, whatever else they have."""
    if not isinstance(known, dict):
        return known == numbers
    return all(key in numbers and is_as_known(known[key], numbers[key]) for key in known)


def main():
    known = json.loads(NUMBERS.read_text()) if NUMBERS.exists() else {}
    words = [each for each in sys.argv[1:] if each in BUILDERS]
    for name in words or BUILDERS:
        try:
            numbers = json.loads(json.dumps(work_numbers(name)))
        except (FileNotFoundError, ModuleNotFoundError) as error:
            print(f"{name}: not run; {error}")
            continue
        if "--write" in sys.argv:
            known = json.loads(NUMBERS.read_text())
            known[name] = {"source": SOURCES[name], **numbers}
            rows = json.dumps(known, indent=1)
            rows = re.sub(r"\[\s+([^][{}]*?)\s+\]", lambda m: f"[{' '.join(m[1].split())}]", rows)
            rows = re.sub(r"{\s+([^{}]*?)\s+}", lambda m: f"{{{' '.join(m[1].split())}}}", rows)
            NUMBERS.write_text(rows + "\n")
        else:
            assert is_as_known(known[name], {"source": SOURCES[name], **numbers}), name
        print(f"{name}: {len(numbers['terrains'])} terrains", flush=True)


if __name__ == "__main__":
    main()
