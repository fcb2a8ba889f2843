import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.tree import build_tree
from terrainkit_robots.description.model import Joint, Link, RobotModel, Source
from tests.small_robots import URDF
from tests.tables import read_table

SOURCE = Source(file=URDF, line=1)
TREES = read_table(__file__, "trees")


def robot(links, joints, kind="urdf"):
    """Return a robot of links and of joints `parent child` or `parent child name`."""
    made = []
    for joint in joints:
        parent, child, *name = joint
        name = name[0] if name else f"{parent}-{child}"
        made.append(Joint(name=name, source=SOURCE, kind="fixed", parent=parent, child=child))
    return RobotModel(
        name="r",
        kind=kind,
        file=SOURCE.file,
        source=SOURCE,
        links=tuple(Link(name=name, source=SOURCE) for name in links),
        joints=tuple(made),
    )


def tree(links, joints, kind="urdf"):
    """Return the tree of links and joints between one-letter links, such as `ab bc`."""
    return build_tree(robot(links.split(), [tuple(each) for each in joints.split()], kind))


def rejected(tree):
    return {joint.name: reason for joint, reason in tree.rejected}


@pytest.mark.parametrize("title", TREES)
def test_tree(title):
    links, joints, roots, order, reasons = TREES[title]
    found = tree(links, joints)
    assert ("".join(found.roots), "".join(found.order)) == (roots, order)
    assert rejected(found) == reasons
    assert len(found.cycles) == list(reasons.values()).count("cycle")


def test_cycles_start_at_the_rejected_joint():
    found = tree("a b c d p q", "ab bc ca cd pq qp")
    assert found.cycles == (("b", "a", "c"), ("q", "p"))
    assert [joint.child for joint, _ in found.rejected] == ["b", "q"]


def test_joints_above_and_below_a_link():
    found = tree("a b c", "ab ac")
    above = {link: joint.name for link, joint in found.parent_joint.items()}
    assert above == {"b": "a-b", "c": "a-c"}
    below = {link: [j.child for j in joints] for link, joints in found.child_joints.items()}
    assert below == {"a": ["b", "c"], "b": [], "c": []}


def test_first_link_of_a_name_is_kept():
    model = robot(["a", "b", "b"], ["ab"])
    found = build_tree(model)
    assert found.order == ("a", "b")
    assert found.links["b"] is model.links[1]


@pytest.mark.parametrize(
    ("links", "kind", "order", "reasons"),
    [
        (["a", "b"], "mjcf", ("a", "b"), {}),
        (["a", "b"], "urdf", ("a", "b"), {"world-a": "unknown-link"}),
        (["world", "a", "b"], "urdf", ("world", "a", "b"), {}),
        (["world", "a", "b"], "mjcf", ("world", "a", "b"), {}),
    ],
)
def test_world_of_mjcf_is_no_link(links, kind, order, reasons):
    found = build_tree(robot(links, [("world", "a"), ("a", "b")], kind))
    assert (found.order, rejected(found)) == (order, reasons)


NAMES_OF_MANY = tuple(f"l{k}" for k in range(10_000))


@pytest.mark.parametrize(
    ("joints", "roots"),
    [
        pytest.param(list(itertools.pairwise(NAMES_OF_MANY)), 1, id="chain"),
        pytest.param([(NAMES_OF_MANY[0], name) for name in NAMES_OF_MANY[1:]], 1, id="star"),
        pytest.param([], 10_000, id="separate"),
    ],
)
def test_tree_of_many_links(joints, roots):
    found = build_tree(robot(NAMES_OF_MANY, joints))
    assert found.roots == NAMES_OF_MANY[:roots]
    assert found.order == (NAMES_OF_MANY if roots == 1 else NAMES_OF_MANY[:1])


def test_tree_of_a_long_cycle():
    pairs = itertools.pairwise([*NAMES_OF_MANY, NAMES_OF_MANY[0]])
    found = build_tree(robot(NAMES_OF_MANY, list(pairs)))
    assert (len(found.cycles[0]), len(found.order)) == (10_000, 10_000)


NAMES = st.sampled_from("abcdefgh")


@given(
    st.lists(NAMES, max_size=10),
    st.lists(st.tuples(NAMES, NAMES, st.sampled_from(["", "j", "k"])), max_size=12),
)
def test_tree_of_random_joints_is_forest(links, joints):
    forest = build_tree(robot(links, [(p, c, n or f"{p}-{c}") for p, c, n in joints]))
    # Every joint is accepted or rejected, and every link is below exactly one root.
    assert len(forest.parent_joint) + len(forest.rejected) == len(joints)
    seen, stack = [], list(forest.roots)
    while stack:
        at = stack.pop()
        seen.append(at)
        stack += [j.child for j in forest.child_joints[at]]
    assert sorted(seen) == sorted(set(links))
    for name, above in forest.parent_joint.items():
        assert above.child == name
        assert above in forest.child_joints[above.parent]
    place = {name: k for k, name in enumerate(forest.order)}
    for name in set(forest.order) & set(forest.parent_joint):
        assert place[forest.parent_joint[name].parent] < place[name]
    assert sum(reason == "cycle" for _, reason in forest.rejected) == len(forest.cycles)
