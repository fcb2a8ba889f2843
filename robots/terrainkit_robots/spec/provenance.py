"""Provenance of an edited spec: which values are derived, and which values the user gave."""

from collections.abc import Iterator
from dataclasses import replace

from terrainkit.errors import one_line
from terrainkit_robots.spec.per_joint import match_joints
from terrainkit_robots.spec.robot_spec import JOINT_TABLES, Provenance, RobotSpec


def with_provenance(spec: RobotSpec, derived: RobotSpec, file: str) -> RobotSpec:
    """Return a spec with the provenance of its values: as derived where equal, else given.

    Args:
        spec: The edited spec. Its own provenance may describe values that were replaced.
        derived: The spec that is derived without it.
        file: File of the edited spec.
    """
    given = Provenance(origin="given", reason=f"in {one_line(file)}")
    provenance: dict[str, Provenance] = {}
    for name in {key.partition(".")[0]: None for key in derived.provenance}:
        provenance |= dict(_field_provenance(name, spec, derived, given))
    return replace(spec, provenance=provenance)


def _field_provenance(
    name: str, spec: RobotSpec, derived: RobotSpec, given: Provenance
) -> Iterator[tuple[str, Provenance]]:
    """Yield the provenance of a field, and of single values of a table."""
    value, derived_value = getattr(spec, name), getattr(derived, name)
    known = {k: v for k, v in derived.provenance.items() if k.partition(".")[0] == name}
    if value == derived_value:
        yield from known.items()
        return
    if name not in JOINT_TABLES:
        yield name, given
        return
    if name in known:
        yield name, known[name]
    before = match_joints(derived_value, spec.joint_order)
    origins = {key: known.get(f"{name}.{key}", known.get(name, given)) for key in derived_value}
    origin_of = match_joints(origins, spec.joint_order).values
    for key in value:
        joints = match_joints({key: value[key]}, spec.joint_order).values
        unchanged = {origin_of[j] for j in joints if before.values.get(j) == value[key]}
        is_derived = len(unchanged) == 1 and all(before.values.get(j) == value[key] for j in joints)
        origin = unchanged.pop() if is_derived else given
        if origin != known.get(name):
            yield f"{name}.{key}", origin
