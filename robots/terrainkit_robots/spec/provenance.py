"""Mark the values of an edited spec that differ from the derived ones."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from terrainkit_robots.spec.robot_spec import JOINT_TABLES, Provenance, RobotSpec


def with_provenance(spec: RobotSpec, derived: RobotSpec, file: str) -> RobotSpec:
    """Return a spec with the provenance of each value: derived, or given in a file.

    Args:
        spec: The spec as read. The comments in its file may describe replaced values.
        derived: The spec that would be derived from the robot.
        file: Name of the file of `spec`.
    """
    given = Provenance(origin="given", reason=f"in {file}")
    origins: dict[str, Provenance] = {}
    for name in {key.partition(".")[0]: None for key in derived.provenance}:
        origins |= dict(_origins(name, spec, derived, given))
    return replace(spec, provenance=origins)


def _origins(
    name: str, spec: RobotSpec, derived: RobotSpec, given: Provenance
) -> Iterator[tuple[str, Provenance]]:
    """Yield the provenance of a field and of its entries that differ from it."""
    mine, theirs = getattr(spec, name), getattr(derived, name)
    known = {k: v for k, v in derived.provenance.items() if k.partition(".")[0] == name}
    if mine == theirs:
        yield from known.items()
        return
    if name not in JOINT_TABLES or not set(mine) <= set(spec.joint_order):
        yield name, given
        return
    if name in known:
        yield name, known[name]
    changed = [joint for joint, value in mine.items() if not _same(value, theirs, joint)]
    yield from ((key, each) for key, each in known.items() if key.partition(".")[2] not in changed)
    yield from ((f"{name}.{joint}", given) for joint in changed)


def _same(value: float, table: Mapping[str, float], joint: str) -> bool:
    return joint in table and table[joint] == value
