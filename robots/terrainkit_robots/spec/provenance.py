"""Provenance of an edited spec: which values are derived, and which ones the user gave."""

from collections.abc import Iterator
from dataclasses import replace

from terrainkit_robots.spec.robot_spec import JOINT_TABLES, Provenance, RobotSpec


def with_provenance(spec: RobotSpec, derived: RobotSpec, file: str) -> RobotSpec:
    """Return a spec with the provenance of its values: as derived where equal, else given.

    Args:
        spec: The edited spec. Its own provenance may be that of replaced values.
        derived: The spec that is derived without it.
        file: File of the edited spec.
    """
    given = Provenance(origin="given", reason=f"in {file}")
    provenance: dict[str, Provenance] = {}
    for name in {key.partition(".")[0]: None for key in derived.provenance}:
        provenance |= dict(_field_provenance(name, spec, derived, given))
    return replace(spec, provenance=provenance)


def _field_provenance(
    name: str, spec: RobotSpec, derived: RobotSpec, given: Provenance
) -> Iterator[tuple[str, Provenance]]:
    """Yield the provenance of a field, and that of single values of a table."""
    value, derived_value = getattr(spec, name), getattr(derived, name)
    known = {k: v for k, v in derived.provenance.items() if k.partition(".")[0] == name}
    if value == derived_value:
        yield from known.items()
        return
    if name not in JOINT_TABLES or not set(value) <= set(spec.joint_order):
        yield name, given
        return
    if name in known:
        yield name, known[name]
    changed = [joint for joint in value if value[joint] != derived_value.get(joint)]
    yield from ((key, item) for key, item in known.items() if key.partition(".")[2] not in changed)
    yield from ((f"{name}.{joint}", given) for joint in changed)
