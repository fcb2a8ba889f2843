import itertools
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from terrainkit_robots.analysis.bodies.tree import build_tree
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.description.model import Joint, Link, RobotModel, Source

SOURCE = Source(file=Path("robot.urdf"), line=1)


def joint(parent, child, name=None):
    name = f"{parent}-{child}" if name is None else name
    return Joint(name=name, source=SOURCE, kind="fixed", parent=parent, child=child)


def robot(links, joints, kind="urdf"):
    """Return a robot of links `a b c` and of joints that are pairs or joints."""
    return RobotModel(
        name="r",
        kind=kind,
        file=SOURCE.file,
        source=SOURCE,
        links=tuple(Link(name=name, source=SOURCE) for name in links),
        joints=tuple(j if isinstance(j, Joint) else joint(*j) for j in joints),
    )


def tree(links, joints, kind="urdf"):
    return build_tree(robot(links.split(), joints, kind))


def rejected(tree):
    return [(joint.name, reason) for joint, reason in tree.rejected]


def test_tree_without_links():
    empty = tree("", [])
    assert empty.roots == empty.order == empty.rejected == empty.cycles == ()


def test_tree_order_is_depth_first():
    sound = tree("e d c b a", [("a", "b"), ("b", "c"), ("a", "d"), ("d", "e")])
    assert sound.order == ("a", "b", "c", "d", "e")
    assert sound.roots == ("a",)
    assert sound.rejected == ()


def test_tree_keeps_order_of_joints():
    assert tree("a b c d", [("a", "d"), ("a", "b"), ("a", "c")]).order == ("a", "d", "b", "c")


def test_tree_parent_and_child_joints():
    sound = tree("a b c", [("a", "b"), ("a", "c")])
    assert sound.parent_joint["b"].name == "a-b"
    assert "a" not in sound.parent_joint
    assert [j.child for j in sound.child_joints["a"]] == ["b", "c"]
    assert sound.child_joints["c"] == ()


def test_tree_root_has_most_descendants():
    several = tree("x a b p q r", [("a", "b"), ("p", "q"), ("q", "r")])
    assert several.roots == ("p", "a", "x")
    assert several.order == ("p", "q", "r")


def test_tree_root_tie_takes_first_link():
    assert tree("b a", []).roots == ("b", "a")


def test_tree_keeps_first_link_of_each_name():
    model = robot(["a", "b", "b"], [("a", "b")])
    double = build_tree(model)
    assert double.order == ("a", "b")
    assert double.links["b"] is model.links[1]


def test_tree_rejects_duplicate_joint():
    double = tree("a b", [joint("a", "b", "j"), joint("a", "b", "j")])
    assert rejected(double) == [("j", "duplicate")]
    assert double.order == ("a", "b")


def test_tree_keeps_joints_with_equal_names():
    double = tree("a b c", [joint("a", "b", "j"), joint("a", "c", "j")])
    assert rejected(double) == []
    assert double.order == ("a", "b", "c")


def test_tree_rejects_unknown_links():
    lost = tree("a b", [("a", "x"), ("y", "b"), ("a", "")])
    assert rejected(lost) == [(name, "unknown-link") for name in ("a-x", "y-b", "a-")]
    assert lost.order == ("a",)


def test_tree_rejects_second_parent():
    two = tree("a b c", [("a", "b"), ("a", "c"), ("b", "c")])
    assert rejected(two) == [("b-c", "second-parent")]
    assert two.order == ("a", "b", "c")
    assert two.cycles == ()


def test_tree_rejects_link_below_itself():
    own = tree("a b", [("a", "b"), ("a", "a")])
    assert own.cycles == (("a",),)
    assert rejected(own) == [("a-a", "cycle")]
    assert own.order == ("a", "b")


def test_tree_opens_cycle_with_tail():
    # Every link has a parent, so the cycle is cut above a.
    circle = tree("a b c d", [("a", "b"), ("b", "c"), ("c", "a"), ("c", "d")])
    assert len(circle.cycles) == 1
    assert set(circle.cycles[0]) == {"a", "b", "c"}
    assert [reason for _, reason in circle.rejected] == ["cycle"]
    assert set(circle.order) == {"a", "b", "c", "d"}


def test_tree_opens_cycle_beside_robot():
    beside = tree("a b p q", [("a", "b"), ("p", "q"), ("q", "p")])
    assert set(beside.cycles[0]) == {"p", "q"}
    assert beside.order == ("a", "b")
    assert len(beside.roots) == 2


def test_tree_root_never_had_a_parent():
    # The cycle has more links, and so has the tree below a missing link.
    beside = tree("a b p q r", [("a", "b"), ("p", "q"), ("q", "r"), ("r", "p")])
    assert beside.roots[0] == "a"
    lost = tree("p q r a b", [("x", "p"), ("p", "q"), ("q", "r"), ("a", "b")])
    assert lost.roots == ("a", "p")
    assert lost.order == ("a", "b")


def test_tree_opens_two_cycles():
    two = tree("a b c d", [("a", "b"), ("b", "a"), ("c", "d"), ("d", "c")])
    assert [set(cycle) for cycle in two.cycles] == [{"a", "b"}, {"c", "d"}]
    assert len(two.rejected) == 2
    assert len(two.roots) == 2


def test_tree_ignores_joints_to_mjcf_world():
    held = tree("a b", [("world", "a"), ("a", "b")], kind="mjcf")
    assert held.order == ("a", "b")
    assert held.rejected == ()
    assert "a" not in held.parent_joint


def test_tree_keeps_world_link_of_urdf():
    assert rejected(tree("a", [("world", "a")])) == [("world-a", "unknown-link")]
    assert tree("world a", [("world", "a")]).order == ("world", "a")


def test_tree_of_long_chain():
    count = 10_000
    names = [f"l{i}" for i in range(count)]
    model = robot(names, list(itertools.pairwise(names)))
    assert build_tree(model).order == tuple(names)


def test_tree_of_long_cycle():
    count = 10_000
    names = [f"l{i}" for i in range(count)]
    model = robot(names, list(zip(names, [*names[1:], names[0]], strict=True)))
    circle = build_tree(model)
    assert len(circle.cycles[0]) == count
    assert len(circle.order) == count


def test_tree_of_large_star():
    names = [f"l{i}" for i in range(10_000)]
    star = build_tree(robot(names, [(names[0], name) for name in names[1:]]))
    assert star.order == tuple(names)


def test_tree_of_many_separate_links():
    names = [f"l{i}" for i in range(10_000)]
    assert build_tree(robot(names, [])).roots == tuple(names)


NAMES = st.sampled_from("abcdefgh")


@given(
    st.lists(NAMES, max_size=10),
    st.lists(st.tuples(NAMES, NAMES, st.sampled_from(["", "j", "k"])), max_size=12),
)
def test_tree_of_random_joints_is_forest(links, joints):
    model = robot(links, [joint(p, c, n or f"{p}-{c}") for p, c, n in joints])
    forest = build_tree(model)
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
    assert all(
        place[forest.parent_joint[n].parent] < k
        for n, k in place.items()
        if n in forest.parent_joint
    )
    assert sum(reason == "cycle" for _, reason in forest.rejected) == len(forest.cycles)


@given(st.permutations(range(7)))
def test_tree_is_independent_of_joint_order(order):
    pairs = [("a", "b"), ("b", "c"), ("b", "d"), ("a", "e"), ("e", "f"), ("e", "g"), ("g", "h")]
    shuffled = tree("a b c d e f g h", [pairs[k] for k in order])
    assert set(shuffled.order) == set("abcdefgh")
    assert {(j.parent, j.child) for j in shuffled.parent_joint.values()} == set(pairs)


def test_tree_of_published_robot_is_complete(robot_file):
    model = load_robot(robot_file("g1/g1_29dof.urdf"))
    sound = build_tree(model)
    assert sound.roots == ("pelvis",)
    assert set(sound.order) == {link.name for link in model.links}
    assert sound.rejected == sound.cycles == ()
