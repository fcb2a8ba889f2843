"""Check a robot file: load it, compute its facts, and run the lint rules."""

from collections.abc import Mapping
from pathlib import Path

from terrainkit.errors import ConfigError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.runner import Report
from terrainkit_robots.lint.selection import lint_selected
from terrainkit_robots.lint.settings import Settings, read_settings
from terrainkit_robots.mesh.mesh_cache import Meshes


def check_robot(
    path: str | Path,
    settings: Settings | None = None,
    *,
    against: str | Path | None = None,
    spec: str | Path | None = None,
    contents: Mapping[Path, bytes] | None = None,
) -> Report:
    """Return what the lint rules find in a robot file.

    Args:
        path: A URDF, xacro or MJCF file, or the name of a robot; see `find_robot`.
        settings: Selected rules, ROS packages and xacro arguments. By default they are read from
            the nearest terrainkit.toml or pyproject.toml in the folder of the file or above it;
            for a name, in the working directory or above it.
        against: Another file of the same robot, to compare with.
        spec: The robot.toml of the robot, to compare with.
        contents: Bytes to read instead of the files at these paths, such as the result of a fix.

    Returns:
        The report, with the facts of the robot, the findings and the rules that were skipped.

    Raises:
        RobotFileError: if a file cannot be found, downloaded or opened.
        ConfigError: if the settings name an unknown rule, `against` is not a robot, or the spec is
            invalid.
    """
    from terrainkit_robots.spec.robot_spec import RobotSpec

    path, contents = Path(path), contents or {}
    if settings is None:
        settings = read_settings(path.parent)
    packages, arguments = settings.packages, settings.xacro_arguments
    other = None
    if against is not None:
        model = load_robot(against, packages=packages, xacro_arguments=arguments)
        if not model.links:
            reason = f": {model.problems[0].message}" if model.problems else ""
            raise ConfigError(f"{against} does not describe a robot{reason}")
        other = Facts(model)
    robot_spec = RobotSpec.load(Path(spec)) if spec is not None else None
    model = load_robot(path, packages=packages, xacro_arguments=arguments, contents=contents)
    facts = Facts(model, Meshes(contents), against=other, spec=robot_spec)
    return lint_selected(facts, settings, contents)
