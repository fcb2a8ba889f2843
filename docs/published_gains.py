"""Read the gains and the pose that are published for a robot, without running the file.

A place is `FILE:NAME`: the class or function of a legged_gym configuration, or the variable of an
Isaac Lab configuration.
"""

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

_TABLES = {
    **dict.fromkeys(("default_joint_angles", "joint_pos"), "default_pose"),
    **{name: name for name in ("stiffness", "damping")},
}
"""Tables of a robot's spec by the names in a configuration."""


def read_published(place: Path) -> dict[str, dict[str, float]]:
    """Return the pose and the gains that are published in a place, by table and pattern.

    Raises:
        ValueError: if the file does not define the name, or it has no stiffness by joint.
    """
    file, _, name = place.name.partition(":")
    tree = ast.parse((place.parent / file).read_text())
    part = next((node for node in ast.walk(tree) if name in _names(node)), ast.Pass())
    published: dict[str, dict[str, float]] = {table: {} for table in _TABLES.values()}
    for node in ast.walk(part):
        for table, values in _tables(node):
            published[table].update(values)
    if not published["stiffness"]:
        raise ValueError(f"{place}: no stiffness by joint")
    return published


def values_of(patterns: Mapping[str, float], joints: Iterable[str]) -> dict[str, float]:
    """Return the values of the joints that a pattern matches as a whole; the last one holds."""
    return {j: value for j in joints for p, value in patterns.items() if re.fullmatch(p, j)}


def _names(node: ast.AST) -> set[str]:
    """Return the names that a statement defines."""
    if isinstance(node, ast.ClassDef | ast.FunctionDef):
        return {node.name}
    targets = node.targets if isinstance(node, ast.Assign) else []
    return {getattr(target, "id", getattr(target, "attr", "")) for target in targets}


def _tables(node: ast.AST) -> Iterator[tuple[str, Mapping[str, float]]]:
    """Yield the tables of a statement of legged_gym, or of a call of Isaac Lab."""
    if isinstance(node, ast.Assign):
        found = {name: _literal(node.value) for name in _names(node)}
    else:
        found = {key.arg: _literal(key.value) for key in getattr(node, "keywords", ())}
    for name in found.keys() & _TABLES.keys():
        values = found[name]
        if isinstance(values, float | int):  # of all joints of an actuator
            yield _TABLES[name], dict.fromkeys(found.get("joint_names_expr") or (), values)
        elif isinstance(values, dict) and isinstance(node, ast.Assign):
            # A key is a part of the names of its joints.
            yield _TABLES[name], {f".*{re.escape(part)}.*": values[part] for part in values}
        elif isinstance(values, dict):
            yield _TABLES[name], values


def _literal(node: ast.AST) -> Any:
    """Return the value of an expression without names, else None."""
    try:
        return ast.literal_eval(node)
    except ValueError:
        return None
