"""Defects of names."""

from defects.patient import NotHereError, Patient, Subjects, child, kind, parent


def _rename_link(robot: Patient, old: str, new: str) -> None:
    robot.link(old).set("name", new)
    for joint in robot.joints():
        for tag, name in (("child", child(joint)), ("parent", parent(joint))):
            if name == old:
                joint.find(tag).set("link", new)


def _typo(robot: Patient, name: str) -> str:
    """Return a name with one letter of its longest word lost, doubled or swapped."""
    word = max(name.removesuffix("_joint").removesuffix("_link").split("_"), key=len)
    at = robot.rng.randrange(1, len(word) - 1)
    wrong = robot.choose(
        [
            word[:at] + word[at + 1 :],
            word[:at] + word[at] + word[at:],
            word[: at - 1] + word[at] + word[at - 1] + word[at + 1 :],
        ]
    )
    if wrong == word:
        raise NotHereError
    return name.replace(word, wrong, 1)


@kind("NAM001", "warning", "a typo in the name of a joint")
def joint_typo(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    joint.set("name", _typo(robot, joint.get("name")))
    return [joint.get("name")]


@kind("NAM001", "warning", "a typo in the name of a link")
def link_typo(robot: Patient) -> Subjects:
    link = robot.choose(robot.leg_links()).get("name")
    wrong = _typo(robot, link)
    _rename_link(robot, link, wrong)
    return [wrong]


@kind("NAM001", "warning", "other letters in the name of a joint")
def joint_case(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    words = joint.get("name").split("_")
    at = robot.rng.randrange(len(words))
    words[at] = words[at].upper() if words[at].islower() else words[at].lower()
    joint.set("name", "_".join(words))
    return [joint.get("name")]


@kind("NAM001", "warning", "a word left out of the name of a joint")
def shorter(robot: Patient) -> Subjects:
    joint = robot.choose(robot.leg_joints())
    name = joint.get("name").removesuffix("_joint")
    if name in {j.get("name") for j in robot.joints()} or name == joint.get("name"):
        raise NotHereError
    joint.set("name", name)
    return [name]


@kind("NAM002", "warning", "a name that is no identifier")
def no_identifier(robot: Patient) -> Subjects:
    joint = robot.choose(robot.moving())
    name = joint.get("name")
    joint.set("name", robot.choose([name.replace("_", " "), name.replace("_", "-"), f"1_{name}"]))
    return [joint.get("name")]


@kind("NAM002", "warning", "a link whose name has a dot or a slash")
def dotted(robot: Patient) -> Subjects:
    link = robot.choose(robot.leg_links()).get("name")
    wrong = link.replace("_", robot.choose([".", "/", ":"]), 1)
    _rename_link(robot, link, wrong)
    return [wrong]


@kind("NAM002", "error", "two names that become one")
def colliding(robot: Patient) -> Subjects:
    one, other = (link.get("name") for link in robot.rng.sample(robot.leg_links(), 2))
    wrong = one.replace("_", "-", 1)
    _rename_link(robot, other, wrong)
    return [wrong, one]


@kind("NAM003", "info", "a sensor on a leg that is named like a foot or the base")
def trap(robot: Patient) -> Subjects:
    word = robot.choose(["foot", "base"])
    host = robot.choose(robot.leg_links()).get("name")
    name = f"{word}_camera"
    robot.insert(f'<link name="{name}"/>')
    robot.insert(
        f'<joint name="{name}_joint" type="fixed">'
        f'<parent link="{host}"/><child link="{name}"/></joint>'
    )
    return [name]
