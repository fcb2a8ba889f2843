"""Robots from texts, and their parts by name."""

from pathlib import Path

from terrainkit_robots.description.load import load_robot

FILE = Path("/robots/robot.xml")


def read(text, file=FILE):
    """Return the robot of a text."""
    return load_robot(file, contents={file: text if isinstance(text, bytes) else text.encode()})


def mjcf(inside, rest=""):
    """Return an MJCF with elements in its world and others after it."""
    return f"<mujoco>{rest}<worldbody>{inside}</worldbody></mujoco>"


def body(inside, rest=""):
    """Return an MJCF with one body, a."""
    return mjcf(f'<body name="a">{inside}</body>', rest)


def write_all(folder, files):
    """Write files, and return the path of the first."""
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder / next(iter(files))


def link(robot, name="a"):
    return next(each for each in robot.links if each.name == name)


def joint(robot, name="j"):
    return next(each for each in robot.joints if each.name == name)


def codes(robot):
    return [problem.code for problem in robot.problems]
