"""Rules on meshes that belong to other links."""

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import PurePosixPath

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import Geometry, Link
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule

_SUFFIX = re.compile(r"[_-]?(link|body|visual|collision|vis|col|\d+)$", re.IGNORECASE)


def _stem(geometry: Geometry) -> str:
    """Return the file name of a mesh without folder and suffix; empty for primitives."""
    if geometry.mesh is None:
        return ""
    return PurePosixPath(geometry.mesh.filename.replace("\\", "/")).stem


def _part(name: str) -> str:
    """Return a name without suffixes such as _link."""
    short = _SUFFIX.sub("", name.lower())
    return short or name.lower()


def _letters(name: str) -> str:
    return re.sub(r"[^a-z]", "", name)


def _shapes(link: Link) -> list[tuple[str, Geometry]]:
    return [("visual", g) for g in link.visuals] + [("collision", g) for g in link.collisions]


@rule("MSH015", "mesh-of-another-link", "warning", certainty="likely")
def mesh_of_another_link(robot: Facts) -> Violations:
    """A link has the mesh of another link.

    The file of the mesh has the name of another link that uses it as well, while a file with the
    name of the link itself exists. A file name was not changed after copying a link, often from the
    other side.

    Fix:
        Use the mesh with the name of the link.

    Source:
        Issue 109 of ros-industrial/fanuc and the discussion of icub-models 70.
    """
    users: dict[str, list[str]] = {}
    for link in robot.links:
        for part in {_part(_stem(g)) for _, g in _shapes(link) if g.mesh is not None}:
            users.setdefault(part, []).append(link.name)
    parts = Counter(_part(link.name) for link in robot.links)
    for link in robot.links:
        own = _part(link.name)
        for kind, geometry in _shapes(link):
            used = _part(_stem(geometry))
            if geometry.mesh is None or parts[used] != 1 or parts[own] != 1:
                continue
            if _letters(used) == _letters(own):
                continue  # the fingers of a hand share their meshes
            owners = [name for name in users[used] if _part(name) == used]
            others = [g for _, g in _shapes(link) if _part(_stem(g)) == own]
            path = geometry.mesh.path
            beside = path.with_name(path.name.replace(_stem(geometry), _own_stem(geometry, link)))
            # A link with a mesh of its own as well consists of several parts.
            has_both = any(_part(_stem(g)) == own for k, g in _shapes(link) if k == kind)
            has_own = bool(others) or (beside != path and robot.meshes.exists(beside))
            if not owners or not has_own or has_both:
                continue
            yield Violation(
                element=Part(link.name, geometry.source),
                message=f"{kind} mesh of link {link.name}: got {_stem(geometry)}, the mesh of link "
                f"{owners[0]}; expected {_own_stem(geometry, link)}, which exists",
            )


def _own_stem(geometry: Geometry, link: Link) -> str:
    """Return the name that the mesh of a link would have."""
    stem = _stem(geometry)
    suffix = _SUFFIX.search(stem)
    return _SUFFIX.sub("", link.name) + (suffix.group() if suffix else "")


@rule("MSH016", "odd-leg-mesh", "warning", needs=("legs",), certainty="likely")
def odd_leg_mesh(robot: Facts) -> Violations:
    """One leg has another mesh than the three legs that share one.

    Meshes are shared by all legs, by the legs of one side, or by the front and the rear legs. If
    three legs share one and the fourth has its own, a file name was not changed after copying. A
    mesh that only the fourth leg uses is meant for the other leg of its side as well, so that leg
    is reported. One thigh with the mesh of all calves is reported, too.

    Fix:
        Use the same mesh as on the opposite leg of the same side, or its mirrored version.

    Source:
        Of the published quadrupeds that were tested, none has such meshes.
    """
    chains = [leg.limb.chain for leg in robot.legs]
    if len(chains) != 4 or len({len(chain) for chain in chains}) != 1:
        return
    sides = [float(leg.limb.points[0] @ robot.mirror.normal) > 0 for leg in robot.legs]
    yield from _meshes_of_other_joints(robot, chains)
    for kind in ("visuals", "collisions"):
        uses = Counter(_stem(g) for link in robot.links for g in getattr(link, kind))
        for bodies in zip(*chains, strict=True):
            shapes = [getattr(robot.bodies[i], kind) for i in bodies]
            found = [tuple(sorted(_stem(s.geometry) for s in group)) for group in shapes]
            groups = Counter(found)
            if len(set(bodies)) < 4 or sorted(groups.values()) != [1, 3]:
                continue
            common, odd = (stems for stems, _ in groups.most_common(2))
            own = [name for name in odd if name and name not in common]
            shared = [name for name in common if name and name not in odd]
            if not own or not shared or len(common) != len(odd):
                continue
            wrong = single = found.index(odd)
            if all(uses[name] == 1 for name in own) and sides.count(sides[single]) == 2:
                wrong = next(k for k in range(4) if k != single and sides[k] == sides[single])
            got, expected = (own, shared) if wrong == single else (shared, own)
            odd_one = next(s for s in shapes[wrong] if _stem(s.geometry) in got)
            others = [robot.bodies[bodies[k]].name for k in range(4) if found[k] == common]
            yield Violation(
                element=Part(odd_one.link, odd_one.geometry.source),
                message=f"{kind[:-1]} mesh of {odd_one.link}: got {', '.join(got)}; expected "
                f"{', '.join(expected)}, or one mesh for all legs, as "
                f"{', '.join(others)} share {', '.join(shared)} and only "
                f"{robot.bodies[bodies[single]].name} has {', '.join(own)}",
            )


def _meshes_of_other_joints(robot: Facts, chains: Sequence[Sequence[int]]) -> Violations:
    """Yield a violation for each body of one leg with the mesh of another joint of all others."""
    for kind in ("visuals", "collisions"):
        users: dict[str, set[tuple[int, int]]] = {}
        for leg, chain in enumerate(chains):
            for position, index in enumerate(chain):
                for shape in getattr(robot.bodies[index], kind):
                    users.setdefault(_stem(shape.geometry), set()).add((position, leg))
        users.pop("", None)
        for stem, places in users.items():
            counts = Counter(position for position, _ in places)
            single = [place for place in places if counts[place[0]] == 1]
            if len(counts) != 2 or len(single) != 1 or len(places) < len(chains):
                continue
            ((position, leg),) = single
            others = {p: q for q in counts for p in counts if p != q}
            body = robot.bodies[chains[leg][position]]
            wrong = next(s for s in getattr(body, kind) if _stem(s.geometry) == stem)
            owner = robot.bodies[chains[leg][others[position]]]
            yield Violation(
                element=Part(wrong.link, wrong.geometry.source),
                message=f"{kind[:-1]} mesh of {wrong.link}: got {stem}, which {len(places) - 1} "
                f"legs have at {owner.name} instead; expected another mesh",
            )
