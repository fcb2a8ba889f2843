"""Small robots: elements of a URDF, and the facts of a text."""

from pathlib import Path

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot

URDF, MJCF = Path("/robots/robot.urdf"), Path("/robots/robot.xml")


def facts(*parts):
    """Return the facts of the text of a robot, or of a URDF of links and joints."""
    text = "".join(parts)
    if "<robot" not in text and "<mujoco" not in text:
        text = f'<robot name="r">{text}</robot>'
    file = URDF if "<robot" in text else MJCF
    return Facts(load_robot(file, contents={file: text.encode()}))


def shape(element, xyz="0 0 0", rpy="0 0 0", kind="collision"):
    """Return the element of a shape, such as `box size="1 1 1"`."""
    return f'<{kind}><origin xyz="{xyz}" rpy="{rpy}"/><geometry><{element}/></geometry></{kind}>'


def ball(radius, xyz="0 0 0", kind="collision"):
    return shape(f'sphere radius="{radius}"', xyz, kind=kind)


def box(size, xyz="0 0 0", rpy="0 0 0", kind="collision"):
    return shape(f'box size="{size}"', xyz, rpy, kind)


def link(name, *shapes, mass=1.0, center="0 0 0", inertia="1 1 1 0 0 0", rpy="0 0 0"):
    """Return a link, without an inertial if the mass is None."""
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    six = " ".join(f'{n}="{x}"' for n, x in zip(names, inertia.split(), strict=True))
    inertial = (
        f'<inertial><origin xyz="{center}" rpy="{rpy}"/><mass value="{mass}"/><inertia {six}/>'
        "</inertial>"
    )
    return f'<link name="{name}">{"" if mass is None else inertial}{"".join(shapes)}</link>'


def joint(
    parent, child, xyz="0 0 0", axis="0 1 0", kind="revolute", limits=(), rpy="0 0 0", more=""
):
    """Return the joint `child_joint`, without limits or with the lower and the upper one."""
    if limits:
        more += f'<limit lower="{limits[0]}" upper="{limits[1]}" effort="50" velocity="20"/>'
    return (
        f'<joint name="{child}_joint" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{more}'
        "</joint>"
    )


def chain(name, root, lengths, parent="trunk", kind="revolute", axes=(), radius=0.02):
    """Return links that hang below each other, with a ball at the end of the last one.

    Args:
        name: Name of the links `name0`, `name1` and so on.
        root: Position of the first joint.
        lengths: Length of each link [m].
        parent: Link that carries the first joint.
        kind: Type of the joints.
        axes: Axis of each joint; y by default.
        radius: Radius of the ball [m].
    """
    parts, places = "", [root, *(f"0 0 {-length}" for length in lengths)]
    for k, length in enumerate(lengths):
        end = [ball(radius, places[-1])] if k == len(lengths) - 1 else []
        parts += link(f"{name}{k}", *end, center=f"0 0 {-length / 2}", inertia=".01 .01 .01 0 0 0")
        above = parent if k == 0 else f"{name}{k - 1}"
        axis = axes[k] if axes else "0 1 0"
        parts += joint(above, f"{name}{k}", places[k], axis, kind)
    return parts


def floating(text, trunk):
    """Return a URDF whose trunk floats in MuJoCo."""
    world = '<link name="world"/>' + joint("world", trunk, kind="floating")
    return text.replace("</robot>", f"{world}</robot>")


def tree_text(*joints):
    """Return a URDF of joints `name: parent > child`; `!` is fixed, `*` is kept."""
    links: dict[str, None] = {}
    parts = ""
    for each in joints:
        name, parent, child = each.replace(":", "").replace("> ", "").split()
        links |= dict.fromkeys([parent, child])
        made = joint(parent, child, kind="fixed" if "!" in name else "revolute", limits=(-1, 1))
        made = made.replace(f'"{child}_joint"', f'"{name.strip("!*")}"')
        parts += made.replace("<joint", '<joint dont_collapse="true"') if "*" in name else made
    bodies = "".join(link(name, ball(0.01)) for name in links)
    return f'<robot name="r">{bodies}{parts}</robot>'


def mjcf(bodies, rest=""):
    """Return the facts of an MJCF whose world body has the given bodies."""
    return facts(f"<mujoco><worldbody>{bodies}</worldbody>{rest}</mujoco>")
