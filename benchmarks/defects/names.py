"""Defects of names (NAM)."""

from defects.mutant import Mutant, NotApplicableError, Subjects, child, mutation, parent


def _rename_link(robot: Mutant, old: str, new: str) -> None:
    robot.link(old).set("name", new)
    for joint in robot.joints():
        for tag, name in (("child", child(joint)), ("parent", parent(joint))):
            if name == old:
                joint.find(tag).set("link", new)


def _misspell(robot: Mutant, name: str) -> str:
    """Return a name with one letter of its longest word removed, duplicated or swapped."""
    word = max(name.removesuffix("_joint").removesuffix("_link").split("_"), key=len)
    at = robot.rng.randrange(1, len(word) - 1)
    wrong = robot.pick(
        [
            word[:at] + word[at + 1 :],
            word[:at] + word[at] + word[at:],
            word[: at - 1] + word[at] + word[at - 1] + word[at + 1 :],
        ]
    )
    if wrong == word:
        raise NotApplicableError
    return name.replace(word, wrong, 1)


@mutation("NAM004 SYM007", "warning", "joint that does not turn about the axis in its name")
def wrong_axis_name(robot: Mutant) -> Subjects:
    axes = {"pitch": "1 0 0", "roll": "0 1 0", "yaw": "0 1 0"}
    joint, word = robot.pick(
        (joint, word) for joint in robot.leg_joints() for word in axes if word in joint.get("name")
    )
    joint.find("axis").set("xyz", axes[word])
    return [joint.get("name")]


@mutation("NAM001", "warning", "misspelled joint name")
def wrong_joint_name(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    joint.set("name", _misspell(robot, joint.get("name")))
    return [joint.get("name")]


@mutation("NAM001", "warning", "misspelled link name")
def wrong_link_name(robot: Mutant) -> Subjects:
    link = robot.pick(robot.leg_links()).get("name")
    wrong = _misspell(robot, link)
    _rename_link(robot, link, wrong)
    return [wrong]


@mutation("NAM001", "warning", "joint name in the wrong case")
def joint_case(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    words = joint.get("name").split("_")
    at = robot.rng.randrange(len(words))
    words[at] = words[at].upper() if words[at].islower() else words[at].lower()
    joint.set("name", "_".join(words))
    return [joint.get("name")]


@mutation("NAM001", "warning", "joint name without its suffix")
def short_name(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    name = joint.get("name").removesuffix("_joint")
    if name in {j.get("name") for j in robot.joints()} or name == joint.get("name"):
        raise NotApplicableError
    joint.set("name", name)
    return [name]


@mutation("NAM002", "warning", "joint name that is not an identifier")
def no_identifier(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    name = joint.get("name")
    joint.set("name", robot.pick([name.replace("_", " "), name.replace("_", "-"), f"1_{name}"]))
    return [joint.get("name")]


@mutation("NAM002", "warning", "link name with a dot, slash or colon")
def special_characters(robot: Mutant) -> Subjects:
    link = robot.pick(robot.leg_links()).get("name")
    wrong = link.replace("_", robot.pick([".", "/", ":"]), 1)
    _rename_link(robot, link, wrong)
    return [wrong]


@mutation("NAM002", "error", "two names that become equal")
def name_collision(robot: Mutant) -> Subjects:
    one, other = (link.get("name") for link in robot.rng.sample(robot.leg_links(), 2))
    wrong = one.replace("_", "-", 1)
    _rename_link(robot, other, wrong)
    return [wrong, one]


@mutation("NAM003", "info", "sensor on a leg with the name of a foot or base")
def sensor_name(robot: Mutant) -> Subjects:
    word = robot.pick(["foot", "base"])
    host = robot.pick(robot.leg_links()).get("name")
    name = f"{word}_camera"
    robot.insert(f'<link name="{name}"/>')
    robot.insert(
        f'<joint name="{name}_joint" type="fixed">'
        f'<parent link="{host}"/><child link="{name}"/></joint>'
    )
    return [name]
