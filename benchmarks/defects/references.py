"""Defects of names, materials and numbers in the parts of a URDF for other tools."""

from lxml import etree

from defects.mutant import Mutant, NotApplicableError, Subjects, mirror_names, mutation


def _misspell(robot: Mutant, name: str) -> str:
    """Return a name with a wrong number of letters, such as that of an older version."""
    return robot.pick([f"{name}2", name.replace("_", "", 1), f"old_{name}", name[:-1]])


def _transmission(joint: str, motor: str, ratio: str = "1") -> str:
    return (
        f'<transmission name="{motor}_tran"><type>transmission_interface/SimpleTransmission</type>'
        f'<joint name="{joint}"/><actuator name="{motor}">'
        f"<mechanicalReduction>{ratio}</mechanicalReduction></actuator></transmission>"
    )


def _add_transmissions(robot: Mutant) -> list[etree._Element]:
    """Add a transmission for each joint without one; return all."""
    for element in robot.root.findall("transmission"):
        robot.root.remove(element)
    for joint in robot.actuated_joints():
        name = joint.get("name")
        robot.insert(_transmission(name, name.replace("joint", "motor")))
    return robot.root.findall("transmission")


@mutation("TRE010", "warning", "gazebo reference to an unknown link")
def gazebo(robot: Mutant) -> Subjects:
    name = _misspell(robot, robot.pick(robot.leg_links()).get("name"))
    robot.insert(f'<gazebo reference="{name}"><mu1>0.8</mu1></gazebo>')
    return [name]


@mutation("TRE010", "warning", "transmission of an unknown joint")
def transmission(robot: Mutant) -> Subjects:
    joint = robot.pick(_add_transmissions(robot)).find("joint")
    joint.set("name", _misspell(robot, joint.get("name")))
    return [joint.get("name")]


@mutation("TRE010", "warning", "two transmissions of one joint")
def repeated_transmission(robot: Mutant) -> Subjects:
    one, other = robot.rng.sample(_add_transmissions(robot), 2)
    one.find("joint").set("name", other.find("joint").get("name"))
    return [other.find("joint").get("name")]


@mutation("JNT024", "warning", "transmission without a ratio")
def zero_ratio(robot: Mutant) -> Subjects:
    element = robot.pick(_add_transmissions(robot))
    element.find("actuator/mechanicalReduction").text = robot.pick(["0", "0.0", "reduction"])
    return [element.find("joint").get("name")]


@mutation("TRE010", "warning", "sensor or controller of an unknown link or joint")
def sensor(robot: Mutant) -> Subjects:
    wrong = _misspell(robot, robot.pick(robot.actuated_joints()).get("name"))
    robot.insert(
        robot.pick(
            [
                f'<sensor name="s" type="imu"><parent link="{wrong}"/></sensor>',
                f'<ros2_control name="c" type="system"><joint name="{wrong}"/></ros2_control>',
                '<gazebo><plugin name="p" filename="libgazebo_ros_p3d.so">'
                f"<bodyName>{wrong}</bodyName></plugin></gazebo>",
            ]
        )
    )
    return [wrong]


@mutation("TRE010", "warning", "SRDF with an unknown link or joint")
def srdf(robot: Mutant) -> Subjects:
    link, joint = robot.pick(robot.leg_links()).get("name"), robot.pick(robot.actuated_joints())
    wrong, kind = _misspell(robot, joint.get("name")), robot.pick(["joint", "link", "collision"])
    parts = {
        "joint": f'<group name="leg"><joint name="{wrong}"/></group>',
        "link": f'<end_effector name="e" parent_link="{wrong}" group="leg"/><group name="leg"/>',
        "collision": f'<disable_collisions link1="{link}" link2="{wrong}" reason="Never"/>',
    }
    name = robot.root.get("name")
    text = (
        f'<robot name="{name}"><group name="a"><link name="{link}"/></group>{parts[kind]}</robot>'
    )
    robot.write(f"{robot.source.file.stem}.srdf", text.encode())
    return [wrong]


@mutation("XML016", "warning", "undefined material")
def material(robot: Mutant) -> Subjects:
    visual = robot.pick(robot.root.iterfind("link/visual"))
    for element in visual.findall("material"):
        visual.remove(element)
    etree.SubElement(visual, "material", name="carbon_fiber")
    return [visual.getparent().get("name")]


@mutation("XML013", "error", "inertia without a product")
def no_product(robot: Mutant) -> Subjects:
    link = robot.pick(robot.links("inertial/inertia"))
    del link.find("inertial/inertia").attrib[robot.pick(["ixy", "ixz", "iyz"])]
    return [link.get("name")]


@mutation("XML009 XML001", "error", "file in another encoding")
def encoding(robot: Mutant) -> Subjects:
    codec = robot.pick(["utf-16", "utf-16-le", "utf-32"])
    robot.rewrite = lambda text: text.decode().encode(codec)
    return ()


@mutation("XML001", "error", "comment in another encoding than the file")
def comment_encoding(robot: Mutant) -> Subjects:
    comment, codec = robot.pick([("Gelenk für links", "latin-1"), ("左腿", "gbk")])
    end = f"<!-- {comment} --></robot>".encode(codec)
    robot.rewrite = lambda text: text.replace(b"</robot>", end)
    return ()


@mutation("JNT004 SYM007 NAM004", "warning", "joint without an axis")
def no_axis(robot: Mutant) -> Subjects:
    joint = robot.pick(
        j for j in robot.leg_joints() if abs(float(j.find("axis").get("xyz").split()[0])) < 0.5
    )
    joint.remove(joint.find("axis"))
    return mirror_names(joint.get("name"))


@mutation("SYM012", "warning", "leg that follows another leg")
def crossed_mimic(robot: Mutant) -> Subjects:
    joints = {j.get("name"): j for j in robot.leg_joints()}
    name = robot.pick(name for name in joints if len(mirror_names(name)) == 2)
    other = mirror_names(name)[1]
    if other not in joints:
        raise NotApplicableError
    etree.SubElement(joints[name], "mimic", joint=other, multiplier="1")
    return [name]


@mutation("JNT013", "warning", "mimic with the multiplier 0")
def still_mimic(robot: Mutant) -> Subjects:
    joint, other = robot.rng.sample(robot.leg_joints(), 2)
    etree.SubElement(joint, "mimic", joint=other.get("name"), multiplier="0")
    return [joint.get("name")]
