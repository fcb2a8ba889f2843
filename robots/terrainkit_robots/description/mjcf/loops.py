"""Find the joints that other joints move through constraints or tendons."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import mujoco


def coupled_joints(spec: "mujoco.MjSpec") -> set[str]:
    """Return the joints in loops that connect and weld constraints close, and of fixed tendons."""
    import mujoco

    kinds = mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD
    bodies = {body.name: body for body in spec.bodies if body.name}
    sites = {site.name: site.parent for site in spec.sites}
    found: list[Any] = []
    for equality in spec.equalities:
        held = sites if equality.objtype == mujoco.mjtObj.mjOBJ_SITE else bodies
        chains = [_ancestors(held.get(name)) for name in (equality.name1, equality.name2)]
        # A body that is held by the world or by a mocap body closes no loop.
        if equality.type in kinds and equality.active and chains[0][-1:] == chains[1][-1:] != []:
            for chain, other in (chains, chains[::-1]):
                found += [joint for body in chain if body not in other for joint in body.joints]
    names = {joint.name for joint in found}
    for tendon in spec.tendons:
        wraps = [wrap for wrap in tendon.path if wrap.type == mujoco.mjtWrap.mjWRAP_JOINT]
        names |= {wrap.target.name for wrap in wraps if wrap.target is not None}
    return names - {""}


def _ancestors(body: Any) -> list[Any]:
    """Return a body and the bodies that carry it, without the world."""
    found = []
    while body is not None and body.parent is not None:
        found.append(body)
        body = body.parent
    return found
