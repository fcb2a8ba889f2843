"""What the checks of legged_gym and LeggedGym-Ex have in common: a map, and commands."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

import terrainkit

TERRAINS = ("pyramid_stairs", "rough_slope")
CONFIG = terrainkit.MapConfig(
    rows=3,
    cols=2,
    patch_size=(6.0, 5.0),
    border=3.0,
    centered=True,
    terrains=tuple(terrainkit.SubTerrain(terrain=name) for name in TERRAINS),
)

FOLDER = Path(sys.argv[1])
"""Where the check writes."""

PYTHON = Path(sys.argv[2])
"""Python with the framework."""


def copy_checkout(variable):
    """Copy the folder that a variable of the environment names, and return the copy."""
    source = Path(os.environ[variable])
    ignored = shutil.ignore_patterns(".git", "logs")
    return Path(shutil.copytree(source, FOLDER / source.name, ignore=ignored))


def terrainkit_command(*words):
    """Run terrainkit, and return what it prints."""
    command = [sys.executable, "-m", "terrainkit_cli.main", *words]
    run = subprocess.run(command, cwd=FOLDER, check=True, capture_output=True, text=True)
    return run.stdout


def run_command(command, checkout, *modules, **variables):
    """Run a shell command in a checkout, with the framework's Python as `python`."""
    path = os.pathsep.join([str(PYTHON.parent), os.environ["PATH"]])
    modules = os.pathsep.join(map(str, (checkout, *modules)))
    variables |= {"PATH": path, "PYTHONPATH": modules, "OMP_NUM_THREADS": "1"}
    subprocess.run(command, shell=True, cwd=checkout, env=os.environ | variables, check=True)


def export_map(folder):
    """Write terrain.py into the folder of a robot, and return the map."""
    terrain_map = terrainkit.generate(CONFIG)
    terrain_map.save(FOLDER / "map.npz")
    terrainkit_command("export", "map.npz", "-o", folder / "terrain.py")
    return terrain_map


def compare(terrain_map, seen):
    """Compare origins, levels and measured heights with a map, and return its offset [m]."""
    shift = np.array([*np.add(terrain_map.grid.lower, CONFIG.border), 0.0])
    origins = terrain_map.env_origins - shift
    for prefix in ("first", "raised"):
        expected = origins[seen[f"{prefix}_levels"], seen["columns"]]
        assert np.abs(seen[f"{prefix}_origins"] - expected).max() < 1e-5, prefix
    assert (seen["raised_levels"] == 1).all()
    distances = np.abs(seen["starts"] - seen["first_origins"])[:, :2]
    assert distances.max() < 1.01, distances.max()
    points = seen["points"] + shift[:2]
    above = np.concatenate([points, np.full((*points.shape[:-1], 1), 9.0)], -1)
    surface = terrain_map.scan(above)
    errors = np.abs(seen["heights"].reshape(surface.shape) - surface)
    close = (errors < 0.02).mean()
    print(f"origins and levels are right; {close:.1%} of {errors.size} heights within 20 mm")
    assert close > 0.96
    return shift
