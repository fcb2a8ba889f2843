"""Copy an MJCF model with its meshes and textures into one folder."""

from pathlib import Path

from terrainkit_robots.quiet_mujoco import quiet_mujoco

ROBOT_FILE = "robot.xml"
"""Name of the MJCF file of a copy."""

EXAMPLE = Path(__file__).with_name("run_policy.py")
"""A program that runs an exported policy with a copy, in plain MuJoCo."""


def copy_model(mjcf: Path) -> dict[str, bytes]:
    """Return the MJCF of a robot, in one file, and its meshes and textures, by file name."""
    import mujoco

    with quiet_mujoco():
        spec = mujoco.MjSpec.from_file(str(mjcf))
        names: dict[Path, str] = {}
        for folder, assets in ((spec.meshdir, spec.meshes), (spec.texturedir, spec.textures)):
            for asset in assets:
                if asset.file:
                    source = mjcf.parent / folder / asset.file
                    asset.file = names.setdefault(source, f"{len(names)}_{source.name}")
        spec.meshdir = spec.texturedir = ""
        spec.assets = files = {name: source.read_bytes() for source, name in names.items()}
        spec.compile()
        return files | {ROBOT_FILE: spec.to_xml().encode()}
