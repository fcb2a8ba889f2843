"""Held-out defects, set A: published with the rules that were improved on it."""

# Every defect has the same arguments.
# ruff: noqa: ARG001

import math
from random import Random

from benchmarks.held_out.defect import (
    DefectSet,
    Element,
    Mutant,
    add,
    feet,
    format_numbers,
    is_solid,
    multiply,
    named,
    numbers,
    of,
    option,
)

DEFECTS = DefectSet()
DEGREES = 180 / math.pi
KNEE = "(calf|knee)_joint$"
THIGH = "(thigh|hip_pitch)_joint$"


# Joint dynamics, effort and speed of URDF


@DEFECTS("dynamics", "a1 quadruped biped", "controller gains kp and kd are written into <dynamics>")
def controller_gains_as_dynamics(tree: Element, rng: Random) -> Mutant:
    """Write the gains of a PD controller as damping and friction of every joint of a leg."""
    side = rng.choice(("FL|left", "RR|right"))
    joints = [j for j in named(tree, "joint", f"^({side})") if j.find("limit") is not None]
    for joint in joints:
        effort = float(joint.find("limit").get("effort"))
        dynamics = joint.find("dynamics")
        dynamics.set("damping", "0.5")
        dynamics.set("friction", format_numbers([0.85 * effort]))
    return of(*joints)


@DEFECTS("dynamics", "quadruped biped", "damping per degree from a data sheet or from USD")
def damping_per_degree(tree: Element, rng: Random) -> Mutant:
    """Multiply the damping of all joints by 57.3, twice the usual slip from USD."""
    joints = [j for j in tree.iter("joint") if j.find("dynamics") is not None]
    for joint in joints:
        multiply(joint.find("dynamics"), DEGREES, "damping")
    return of(*joints)


@DEFECTS("dynamics", "a1 quadruped biped", "a friction is identified on the mirrored axis")
def negative_friction(tree: Element, rng: Random) -> Mutant:
    """Give one joint a negative friction."""
    joint = rng.choice([j for j in tree.iter("joint") if j.find("dynamics") is not None])
    joint.find("dynamics").set("friction", "-0.2")
    return of(joint)


@DEFECTS("dynamics", "go2 h1", "sw_urdf_exporter writes effort 0 and velocity 0 by default")
def effort_left_zero(tree: Element, rng: Random) -> Mutant:
    """Leave the effort of one joint at the exporter's 0."""
    joint = rng.choice([j for j in tree.iter("joint") if j.find("limit") is not None])
    joint.find("limit").set("effort", "0")
    return of(joint)


@DEFECTS("dynamics", "go2 g1 quadruped", "a motor's data sheet gives N mm")
def effort_in_newton_millimeters(tree: Element, rng: Random) -> Mutant:
    """Give the effort of one joint in N mm."""
    joint = rng.choice(named(tree, "joint", KNEE))
    multiply(joint.find("limit"), 1000, "effort")
    return of(joint)


@DEFECTS("dynamics", "a1 h1 biped", "a motor's data sheet gives revolutions per minute")
def velocity_in_rpm(tree: Element, rng: Random) -> Mutant:
    """Give the velocity of all joints in revolutions per minute."""
    joints = [j for j in tree.iter("joint") if j.find("limit") is not None]
    for joint in joints:
        multiply(joint.find("limit"), 30 / math.pi, "velocity")
    return of(*joints)


@DEFECTS("dynamics", "a1 g1 quadruped", "columns of a spreadsheet of motors are exchanged")
def effort_and_velocity_swapped(tree: Element, rng: Random) -> Mutant:
    """Exchange the effort and the velocity of one knee."""
    joint = rng.choice(named(tree, "joint", KNEE))
    limit = joint.find("limit")
    effort, velocity = limit.get("effort"), limit.get("velocity")
    limit.set("effort", velocity)
    limit.set("velocity", effort)
    return of(joint)


@DEFECTS("dynamics", "go2 g1", "limits are those of the rotor: the gear ratio is left out")
def limits_of_rotor(tree: Element, rng: Random) -> Mutant:
    """Divide the effort of all joints by the gear ratio, and multiply the velocity by it."""
    joints = [j for j in tree.iter("joint") if j.find("limit") is not None]
    for joint in joints:
        multiply(joint.find("limit"), 1 / 14.3, "effort")
        multiply(joint.find("limit"), 14.3, "velocity")
    return of(*joints)


# Damping, armature, friction loss, gear of MJCF


@DEFECTS("mjcf_joint", "quadruped.xml biped.xml h1.xml", "rotor inertia in g m2 or kg cm2")
def armature_in_grams(tree: Element, rng: Random) -> Mutant:
    """Multiply every armature by 1000."""
    for joint in tree.iter("joint"):
        if joint.get("armature"):
            multiply(joint, 1000, "armature")
    return Mutant(names=of(*named(tree, "joint", "joint")).names, about="armature")


@DEFECTS(
    "mjcf_joint", "quadruped.xml biped.xml h1.xml", "the sign of a mirrored leg is in the gear"
)
def gear_of_one_side_negative(tree: Element, rng: Random) -> Mutant:
    """Give one motor the gear -1 while its joint keeps its axis."""
    motor = rng.choice(named(tree, "motor", "(calf|knee|thigh|hip_pitch)"))
    motor.set("gear", "-1")
    return Mutant(names=(motor.get("name"), motor.get("joint")))


@DEFECTS("mjcf_joint", "quadruped.xml go2.xml biped.xml", "gear is added to limits at the joint")
def gear_counted_twice(tree: Element, rng: Random) -> Mutant:
    """Add the gear ratio to motors whose range is already that of the joint."""
    motors = list(tree.find("actuator").iter("motor"))
    for motor in motors:
        motor.set("gear", "9.1")
    names = [m.get(key) for m in motors for key in ("name", "joint")]
    return Mutant(names=tuple(names), about="gear")


@DEFECTS(
    "mjcf_joint", "quadruped.xml h1.xml go2.xml", "the controller's kp is set as joint damping"
)
def damping_is_stiffness(tree: Element, rng: Random) -> Mutant:
    """Set the default damping to the stiffness of a controller."""
    for joint in tree.iter("joint"):
        if joint.get("damping"):
            joint.set("damping", "40")
    return Mutant(names=of(*named(tree, "joint", "joint")).names, about="damping")


@DEFECTS("mjcf_joint", "quadruped.xml biped.xml go2.xml", "stall torque is copied to frictionloss")
def friction_loss_over_torque(tree: Element, rng: Random) -> Mutant:
    """Give a joint more friction than its motor has torque."""
    joint = rng.choice(named(tree, "joint", THIGH))
    joint.set("frictionloss", "100")
    return of(joint)


@DEFECTS("mjcf_joint", "quadruped.xml biped.xml h1.xml", "the sign of a viscous torque is kept")
def damping_negative(tree: Element, rng: Random) -> Mutant:
    """Give one joint a negative damping."""
    joint = rng.choice(named(tree, "joint", KNEE))
    joint.set("damping", "-0.5")
    return of(joint)


@DEFECTS("mjcf_joint", "quadruped.xml h1.xml", "a list of motors is sorted, one is edited by hand")
def motors_swapped(tree: Element, rng: Random) -> Mutant:
    """Exchange the joints of the left and the right knee's motors."""
    left, right = named(tree, "motor", "(FL_calf|FR_calf|knee)")[:2]
    a, b = left.get("joint"), right.get("joint")
    left.set("joint", b)
    right.set("joint", a)
    return Mutant(names=(left.get("name"), right.get("name"), a, b))


@DEFECTS("mjcf_joint", "quadruped.xml go2.xml biped.xml", "the minus sign is lost in copying")
def control_range_one_sided(tree: Element, rng: Random) -> Mutant:
    """Let one motor pull one way only."""
    motor = rng.choice(list(tree.find("actuator").iter("motor")))
    motor.set("ctrlrange", "0 23.7")
    return Mutant(names=(motor.get("name"), motor.get("joint")))


@DEFECTS("mjcf_joint", "quadruped.xml biped.xml h1.xml", "genesis-world#461: kp is left at 1")
def position_without_gain(tree: Element, rng: Random) -> Mutant:
    """Replace the motors by position actuators without kp."""
    names = []
    for motor in list(tree.find("actuator").iter("motor")):
        motor.tag = "position"
        motor.attrib.pop("class", None)
        names += [motor.get("name"), motor.get("joint")]
    return Mutant(names=tuple(names), about=r"\bkp\b|gain")


# <option>


@DEFECTS("option", "quadruped.xml h1.xml", "a sign slips; z is down in the CAD program")
def gravity_positive(tree: Element, rng: Random) -> Mutant:
    """Let gravity pull upward."""
    option(tree, gravity="0 0 9.81")
    return Mutant(about="gravity")


@DEFECTS("option", "biped.xml go2.xml", "a model in millimeters is converted to meters")
def gravity_in_millimeters(tree: Element, rng: Random) -> Mutant:
    """Leave gravity in mm/s2."""
    option(tree, gravity="0 0 -9810")
    return Mutant(about="gravity")


@DEFECTS("option", "quadruped.xml biped.xml g1.xml", "the control period is taken for the step")
def timestep_of_control(tree: Element, rng: Random) -> Mutant:
    """Set the time step to the control period."""
    option(tree, timestep="0.02")
    return Mutant(about="time ?step")


@DEFECTS("option", "quadruped.xml h1.xml", "contacts are switched off to debug joints")
def contact_disabled(tree: Element, rng: Random) -> Mutant:
    """Leave contacts switched off."""
    add(option(tree), "flag", contact="disable")
    return Mutant(about="contacts? ?.*(disable|flag|off)|flag")


# Feet


@DEFECTS("foot", "quadruped.xml biped.xml go2.xml", "sliding friction is set to 0 for a test")
def foot_without_friction(tree: Element, rng: Random) -> Mutant:
    """Set the sliding friction of all feet to 0."""
    geoms = feet(tree)
    for geom in geoms:
        geom.set("friction", "0 0.02 0.01")
    return of(*geoms)


@DEFECTS("foot", "quadruped.xml biped.xml h1.xml", "condim 1 of a menagerie default is copied")
def foot_frictionless_contact(tree: Element, rng: Random) -> Mutant:
    """Give the feet contacts without friction."""
    geoms = feet(tree)
    for geom in geoms:
        geom.set("condim", "1")
        geom.set("priority", "1")
    return of(*geoms)


@DEFECTS("foot", "quadruped.xml g1.xml h1.xml", "the class of the visual is pasted")
def foot_without_contact(tree: Element, rng: Random) -> Mutant:
    """Take one foot out of collision."""
    foot = rng.choice(feet(tree)).getparent()
    geoms = [geom for geom in feet(tree) if geom.getparent() is foot]
    for geom in geoms:
        geom.set("contype", "0")
        geom.set("conaffinity", "0")
    return of(foot, *geoms)


# Units and limits


@DEFECTS("units", "a1 g1 quadruped", "URDF takes radians, CAD programs give degrees")
def limit_in_degrees(tree: Element, rng: Random) -> Mutant:
    """Give the limits of one joint in degrees."""
    joint = rng.choice([j for j in tree.iter("joint") if j.find("limit") is not None])
    multiply(joint.find("limit"), DEGREES, "lower", "upper")
    return of(joint)


@DEFECTS("units", "a1 go2 quadruped", "rpy is typed in degrees")
def collision_angle_in_degrees(tree: Element, rng: Random) -> Mutant:
    """Give the rotation of one collision shape in degrees."""
    turned = [
        origin
        for origin in tree.findall("link/collision/origin")
        if any(numbers(origin.get("rpy", "0 0 0")))
    ]
    origin = rng.choice(turned)
    origin.set("rpy", format_numbers(round(x * DEGREES) for x in numbers(origin.get("rpy"))))
    return of(origin.getparent().getparent())


@DEFECTS("units", "go2 h1 biped", "an exporter converts degrees that are radians already")
def limits_converted_twice(tree: Element, rng: Random) -> Mutant:
    """Convert the limits of a leg from degrees to radians twice."""
    side = rng.choice(("FL|left", "FR|right"))
    joints = [j for j in named(tree, "joint", f"^({side})") if j.find("limit") is not None]
    for joint in joints:
        multiply(joint.find("limit"), 1 / DEGREES, "lower", "upper")
    return of(*joints)


@DEFECTS("units", "a1 go2 quadruped", "Fusion2PyBullet#2: one part is drawn in millimeters")
def collision_in_millimeters(tree: Element, rng: Random) -> Mutant:
    """Give the box or cylinder of one link in millimeters."""
    shape = rng.choice(tree.xpath("link/collision/geometry/*[self::box or self::cylinder]"))
    multiply(shape, 1000, *shape.attrib)
    return of(shape.getparent().getparent().getparent())


@DEFECTS("units", "h1.xml quadruped.xml biped.xml", "MuJoCo takes degrees unless angle is given")
def angle_missing(tree: Element, rng: Random) -> Mutant:
    """Drop angle="radian" from <compiler>."""
    tree.find("compiler").attrib.pop("angle")
    names = of(*named(tree, "joint", "joint")).names
    return Mutant(names=names, about="angle|degree")


@DEFECTS("units", "h1.xml g1.xml go2.xml", "one range is typed in degrees in a file of radians")
def range_in_degrees(tree: Element, rng: Random) -> Mutant:
    """Give the range of one joint in degrees."""
    joint = rng.choice(named(tree, "joint", KNEE))
    joint.set("range", "-60 60")
    return of(joint)


@DEFECTS("units", "a1 g1 biped", "the encoder counts from another turn")
def limits_shifted_by_turn(tree: Element, rng: Random) -> Mutant:
    """Shift the limits of one joint by a turn."""
    joint = rng.choice(named(tree, "joint", KNEE))
    limit = joint.find("limit")
    for side in ("lower", "upper"):
        limit.set(side, format_numbers([float(limit.get(side)) + 2 * math.pi]))
    return of(joint)


@DEFECTS("units", "a1 go2 quadruped", "quad-sdk#327: limits of A1 leave the pose out")
def knee_limits_lose_sign(tree: Element, rng: Random) -> Mutant:
    """Give one knee the limits of the opposite bend."""
    joint = rng.choice(named(tree, "joint", KNEE))
    limit = joint.find("limit")
    lower, upper = float(limit.get("lower")), float(limit.get("upper"))
    limit.set("lower", format_numbers([-upper]))
    limit.set("upper", format_numbers([-lower]))
    return of(joint)


@DEFECTS("units", "go2 g1 biped", "onshape shows the center of mass in mm (onshape-to-robot#85)")
def center_of_mass_in_millimeters(tree: Element, rng: Random) -> Mutant:
    """Give the center of mass of one link in millimeters."""
    link = rng.choice([x for x in named(tree, "link", "(thigh|calf|knee|hip_pitch)")
                       if x.find("inertial") is not None])  # fmt: skip
    multiply(link.find("inertial/origin"), 1000, "xyz")
    return of(link)


@DEFECTS("units", "a1 h1 quadruped", "a part is weighed in grams")
def mass_in_grams(tree: Element, rng: Random) -> Mutant:
    """Give the mass of one link in grams."""
    link = rng.choice(named(tree, "link", "(calf|knee|hip_yaw|elbow)(_link)?$"))
    multiply(link.find("inertial/mass"), 1000, "value")
    return of(link)


# Collision shapes


@DEFECTS("collision", "a1 go2 quadruped", "the origin of a primitive is forgotten")
def collision_origin_missing(tree: Element, rng: Random) -> Mutant:
    """Put the shape of one thigh at the joint."""
    link = rng.choice(named(tree, "link", "thigh$"))
    link.find("collision/origin").set("xyz", "0 0 0")
    return of(link)


@DEFECTS("collision", "a1 go2", "the rotation of a primitive is forgotten: it lies along x")
def collision_not_aligned(tree: Element, rng: Random) -> Mutant:
    """Drop the rotation of the box of one thigh."""
    link = rng.choice(named(tree, "link", "thigh$"))
    link.find("collision/origin").set("rpy", "0 0 0")
    return of(link)


@DEFECTS("collision", "quadruped.xml biped.xml go2.xml", "URDF has full sizes, MJCF half sizes")
def full_size_for_half(tree: Element, rng: Random) -> Mutant:
    """Give one box or cylinder its full size."""
    geom = rng.choice([g for g in tree.iter("geom")
                       if is_solid(g) and g.get("type") in ("box", "cylinder")])  # fmt: skip
    multiply(geom, 2, "size")
    return of(geom)


@DEFECTS("collision", "h1 g1", "a file name is not changed after copying")
def collision_mesh_of_other_part(tree: Element, rng: Random) -> Mutant:
    """Give a knee the collision mesh of the hip."""
    link = rng.choice(named(tree, "link", "knee_link$"))
    mesh = link.find("collision/geometry/mesh")
    mesh.set("filename", mesh.get("filename").replace("knee", "hip_roll"))
    return of(link)


@DEFECTS("collision", "h1.xml g1.xml", "a mesh name is not changed after copying")
def solid_mesh_of_other_part(tree: Element, rng: Random) -> Mutant:
    """Give a knee the collision mesh of the hip in MJCF."""
    body = rng.choice(named(tree, "body", "knee_link$"))
    geom = next(g for g in body.findall("geom") if is_solid(g))
    geom.set("mesh", geom.get("mesh").replace("knee", "hip_roll"))
    return of(body)


@DEFECTS("collision", "a1 quadruped go2", "the offset of the parent is pasted")
def foot_shape_off_foot(tree: Element, rng: Random) -> Mutant:
    """Put the sphere of one foot where the next joint is."""
    link = rng.choice(named(tree, "link", "foot$"))
    collision = link.find("collision")
    origin = collision.find("origin")
    if origin is None:
        origin = add(collision, "origin")
    origin.set("xyz", "0 0 -0.2")
    return of(link)


@DEFECTS("collision", "go2 quadruped biped", "the diameter is taken for the radius")
def diameter_for_radius(tree: Element, rng: Random) -> Mutant:
    """Give a cylinder or sphere twice its radius."""
    shape = rng.choice(tree.xpath("link/collision/geometry/*[@radius]"))
    multiply(shape, 2, "radius")
    return of(shape.getparent().getparent().getparent())


# Children


@DEFECTS("children", "a1 g1 quadruped", "the axis is deleted: parsers take 1 0 0")
def axis_missing(tree: Element, rng: Random) -> Mutant:
    """Delete the axis of a pitch joint."""
    joint = rng.choice(named(tree, "joint", KNEE))
    joint.remove(joint.find("axis"))
    return of(joint)


@DEFECTS("children", "a1 h1 biped", "a placeholder is left above the exported inertia")
def inertial_repeated(tree: Element, rng: Random) -> Mutant:
    """Give a link a second <inertial>."""
    link = rng.choice(named(tree, "link", "(calf|knee|thigh)(_link)?$"))
    second = add(link, "inertial")
    add(second, "origin", xyz="0 0 0", rpy="0 0 0")
    add(second, "mass", value="1")
    add(second, "inertia", ixx="1", ixy="0", ixz="0", iyy="1", iyz="0", izz="1")
    return of(link)


@DEFECTS("children", "go2 g1 quadruped", "lower and upper default to 0: the joint is locked")
def limit_without_range(tree: Element, rng: Random) -> Mutant:
    """Delete the lower and upper limit of a joint."""
    joint = rng.choice(named(tree, "joint", THIGH))
    for side in ("lower", "upper"):
        joint.find("limit").attrib.pop(side)
    return of(joint)


@DEFECTS("children", "a1 go2 biped", "a merge keeps both origins; readers differ in which they use")
def joint_origin_repeated(tree: Element, rng: Random) -> Mutant:
    """Give a joint a second origin at 0."""
    joint = rng.choice(named(tree, "joint", KNEE))
    add(joint, "origin", xyz="0 0 0", rpy="0 0 0")
    return of(joint)


@DEFECTS("children", "go2 h1 biped", "legged_gym#13: the origin of the inertia is taken out")
def inertial_origin_missing(tree: Element, rng: Random) -> Mutant:
    """Delete the center of mass of a link whose joint is at its end."""
    link = rng.choice(named(tree, "link", "(calf|knee)(_link)?$"))
    inertial = link.find("inertial")
    inertial.remove(inertial.find("origin"))
    return of(link)


@DEFECTS("children", "a1 quadruped", "PowerShell's > writes UTF-16; the declaration says utf-8")
def encoding_is_utf16(tree: Element, rng: Random) -> Mutant:
    """Write the file in UTF-16 under a declaration of UTF-8."""
    return Mutant(about="encod|utf|declar|parse", encode=lambda text: text.encode("utf-16"))


@DEFECTS("children", "a1 biped", "urdfdom refuses a material that is not defined")
def material_undefined(tree: Element, rng: Random) -> Mutant:
    """Use a material that the file does not define."""
    material = rng.choice(tree.findall("link/visual/material"))
    material.set("name", "carbon")
    return Mutant(names=("carbon",))


# References


@DEFECTS("references", "a1 go2 quadruped", "the link is renamed; Gazebo's friction is then lost")
def gazebo_link_missing(tree: Element, rng: Random) -> Mutant:
    """Let <gazebo reference> name a foot that is not there."""
    gazebo = add(tree, "gazebo", reference="FL_foot_link")
    add(gazebo, "mu1").text = "0.8"
    add(gazebo, "mu2").text = "0.8"
    return Mutant(names=("FL_foot_link",))


def _transmissions(tree: Element) -> None:
    """Give every joint a transmission."""
    for joint in [j for j in tree.findall("joint") if j.get("type") == "revolute"]:
        name = joint.get("name")
        transmission = add(tree, "transmission", name=f"{name}_trans")
        add(transmission, "type").text = "transmission_interface/SimpleTransmission"
        driven = add(transmission, "joint", name=name)
        interface = "hardware_interface/EffortJointInterface"
        add(driven, "hardwareInterface").text = interface
        actuator = add(transmission, "actuator", name=f"{name}_motor")
        add(actuator, "hardwareInterface").text = interface
        add(actuator, "mechanicalReduction").text = "1"


@DEFECTS("references", "a1 go2", "a joint is renamed after the transmissions are written",
         prepare=_transmissions)  # fmt: skip
def transmission_joint_missing(tree: Element, rng: Random) -> Mutant:
    """Let a transmission name a joint that is not there."""
    transmission = rng.choice(tree.findall("transmission"))
    joint = transmission.find("joint")
    joint.set("name", joint.get("name").replace("_joint", "_motor_joint"))
    return Mutant(names=(joint.get("name"), transmission.get("name")))


@DEFECTS("references", "a1 go2", "a joint is pasted twice: another has no transmission",
         prepare=_transmissions)  # fmt: skip
def transmission_joint_repeated(tree: Element, rng: Random) -> Mutant:
    """Let two transmissions drive the same joint."""
    first, second = rng.sample(tree.findall("transmission"), 2)
    lost = second.find("joint").get("name")
    second.find("joint").set("name", first.find("joint").get("name"))
    names = (first.find("joint").get("name"), lost, second.get("name"))
    return Mutant(names=names)


@DEFECTS("references", "a1 h1", "the SRDF is that of an older version of the robot")
def semantic_links_missing(tree: Element, rng: Random) -> Mutant:
    """Put an SRDF next to the robot that disables a pair that is not there."""
    text = (
        f'<?xml version="1.0"?>\n<robot name="{tree.get("name")}">\n'
        '  <group name="legs"><joint name="FL_hip_abduct_joint"/></group>\n'
        '  <disable_collisions link1="trunk_link" link2="FL_hip_abduct" reason="Adjacent"/>\n'
        "</robot>\n"
    )
    names = ("FL_hip_abduct_joint", "trunk_link", "FL_hip_abduct")
    return Mutant(names=names, files={f"{tree.get('name')}.srdf": text})


@DEFECTS("references", "quadruped.xml go2.xml", "a joint is renamed, its sensor is not")
def sensor_joint_missing(tree: Element, rng: Random) -> Mutant:
    """Let a sensor name a joint that is not there."""
    add(tree.find("sensor"), "jointpos", name="knee_position", joint="FL_knee_joint")
    return Mutant(names=("FL_knee_joint", "knee_position"))


# Copy and paste between legs


@DEFECTS("copy_paste", "a1 go2 quadruped", "the parent is not renamed after copying the leg")
def parent_of_other_leg(tree: Element, rng: Random) -> Mutant:
    """Hang a thigh on the hip of the other side."""
    joint = rng.choice(named(tree, "joint", "(FR|RR)_thigh_joint$"))
    parent = joint.find("parent")
    link = parent.get("link")
    parent.set("link", link.replace("R_", "L_"))
    return Mutant(names=(*of(joint).names, link))


@DEFECTS("copy_paste", "a1 h1 quadruped", "the axis is mirrored in one leg, the limits are not")
def axis_of_one_leg_flipped(tree: Element, rng: Random) -> Mutant:
    """Reverse the axis of one pitch joint."""
    joint = rng.choice(named(tree, "joint", KNEE))
    multiply(joint.find("axis"), -1, "xyz")
    return of(joint)


@DEFECTS("copy_paste", "quadruped.xml go2.xml biped.xml", "an axis is mirrored in one leg only")
def mjcf_axis_flipped(tree: Element, rng: Random) -> Mutant:
    """Reverse the axis of one pitch joint in MJCF."""
    joint = rng.choice(named(tree, "joint", KNEE))
    joint.set("axis", "0 -1 0")
    return of(joint)


@DEFECTS("copy_paste", "a1 go2 biped", "the sign of y is not changed after copying")
def offset_not_mirror_image(tree: Element, rng: Random) -> Mutant:
    """Give a joint of the right leg the offset of the left one."""
    joint = rng.choice(named(tree, "joint", "(FR_thigh|RR_thigh|right_hip_roll)_joint$"))
    x, y, z = numbers(joint.find("origin").get("xyz"))
    joint.find("origin").set("xyz", format_numbers((x, -y, z)))
    return of(joint)


@DEFECTS("copy_paste", "quadruped.xml h1.xml g1.xml", "the sign of y is not changed after copying")
def body_not_mirror_image(tree: Element, rng: Random) -> Mutant:
    """Give a body of the right leg the offset of the left one."""
    body = rng.choice(named(tree, "body", "(FR_thigh|RR_thigh|right_hip_(pitch|roll)_link)$"))
    x, y, z = numbers(body.get("pos"))
    if not y:
        body = body.getparent()
        x, y, z = numbers(body.get("pos"))
    body.set("pos", format_numbers((x, -y, z)))
    return of(body)


@DEFECTS("copy_paste", "g1 biped g1.xml", "bitbots_main#885: the sign of a right limit")
def roll_limits_of_left(tree: Element, rng: Random) -> Mutant:
    """Give the right roll joint the limits of the left one."""
    left = named(tree, "joint", "left_hip_roll_joint$")[0]
    right = named(tree, "joint", "right_hip_roll_joint$")[0]
    if left.get("range"):
        right.set("range", left.get("range"))
    else:
        for side in ("lower", "upper"):
            right.find("limit").set(side, left.find("limit").get(side))
    return of(right)


@DEFECTS("copy_paste", "h1 g1", "the mesh of the left part is used on the right")
def mesh_of_left_on_right(tree: Element, rng: Random) -> Mutant:
    """Give a right link the meshes of the left one."""
    link = rng.choice(named(tree, "link", "right_(hip_roll|hip_pitch|hip_yaw)_link$"))
    for mesh in link.iter("mesh"):
        mesh.set("filename", mesh.get("filename").replace("right_", "left_"))
    return of(link)


@DEFECTS("copy_paste", "a1 go2", "thigh_mirror is for the right legs only")
def mirror_thigh_on_left(tree: Element, rng: Random) -> Mutant:
    """Give a left thigh the mesh of the right ones."""
    link = rng.choice(named(tree, "link", "(FL|RL)_thigh$"))
    mesh = link.find("visual/geometry/mesh")
    mesh.set("filename", mesh.get("filename").replace("thigh", "thigh_mirror"))
    return of(link)


@DEFECTS("copy_paste", "h1.xml quadruped.xml biped.xml", "the inertia of the left part is pasted")
def center_of_mass_not_mirror_image(tree: Element, rng: Random) -> Mutant:
    """Give a right thigh or knee the center of mass of the left one."""
    body = rng.choice(named(tree, "body", "(FR_thigh|RR_thigh|right_hip_pitch_link)$"))
    inertial = body.find("inertial")
    x, y, z = numbers(inertial.get("pos"))
    inertial.set("pos", format_numbers((x, -y, z)))
    return of(body)


def _mimic_joints(tree: Element) -> None:
    """Give each front knee a rod that follows it."""
    for leg in ("FL", "FR"):
        link = add(tree, "link", name=f"{leg}_rod")
        inertial = add(link, "inertial")
        add(inertial, "origin", xyz="0 0 -0.05", rpy="0 0 0")
        add(inertial, "mass", value="0.02")
        moments = {"ixx": "2e-5", "iyy": "2e-5", "izz": "1e-6"}
        add(inertial, "inertia", ixy="0", ixz="0", iyz="0", **moments)
        visual = add(link, "visual")
        add(visual, "origin", xyz="0 0 -0.05", rpy="0 0 0")
        add(add(visual, "geometry"), "cylinder", radius="0.005", length="0.1")
        joint = add(tree, "joint", name=f"{leg}_rod_joint", type="revolute")
        add(joint, "origin", xyz="0 0 -0.05", rpy="0 0 0")
        add(joint, "parent", link=f"{leg}_thigh")
        add(joint, "child", link=f"{leg}_rod")
        add(joint, "axis", xyz="0 1 0")
        add(joint, "limit", lower="-2.8", upper="-0.8", effort="20", velocity="20")
        add(joint, "mimic", joint=f"{leg}_calf_joint", multiplier="1", offset="0")


@DEFECTS(
    "copy_paste",
    "a1 go2 quadruped",
    "the mimic is not renamed after copying",
    prepare=_mimic_joints,
)
def mimic_of_other_leg(tree: Element, rng: Random) -> Mutant:
    """Let the right rod follow the left knee."""
    joint = named(tree, "joint", "FR_rod_joint")[0]
    joint.find("mimic").set("joint", "FL_calf_joint")
    return of(joint)


# Inertia


@DEFECTS("inertia", "go2 g1 biped", "SolidWorks takes products of inertia with the other sign")
def products_negative(tree: Element, rng: Random) -> Mutant:
    """Negate the products of inertia of one link."""
    link = rng.choice(named(tree, "link", "(thigh|hip_pitch_link|hip_yaw_link)$"))
    multiply(link.find("inertial/inertia"), -1, "ixy", "ixz", "iyz")
    return of(link)


@DEFECTS("inertia", "a1 go2 h1", "the axes of the CAD part are other than those of the link")
def moments_swapped(tree: Element, rng: Random) -> Mutant:
    """Exchange ixx and izz of a long link."""
    link = rng.choice(named(tree, "link", "(thigh|calf|knee_link)$"))
    inertia = link.find("inertial/inertia")
    ixx, izz = inertia.get("ixx"), inertia.get("izz")
    inertia.set("ixx", izz)
    inertia.set("izz", ixx)
    return of(link)


@DEFECTS("inertia", "a1 h1 quadruped", "CAD gives the inertia at the origin (exporter issue 117)")
def inertia_about_joint(tree: Element, rng: Random) -> Mutant:
    """Give the inertia of one link about its joint."""
    link = rng.choice(named(tree, "link", "(calf|knee_link)$"))
    inertial = link.find("inertial")
    x, y, z = numbers(inertial.find("origin").get("xyz"))
    mass = float(inertial.find("mass").get("value"))
    inertia = inertial.find("inertia")
    offsets = {
        "ixx": y * y + z * z, "iyy": x * x + z * z, "izz": x * x + y * y,
        "ixy": -x * y, "ixz": -x * z, "iyz": -y * z,
    }  # fmt: skip
    for name, square in offsets.items():
        inertia.set(name, format_numbers([float(inertia.get(name)) + mass * square]))
    return of(link)


@DEFECTS("inertia", "quadruped.xml biped.xml", "fullinertia is ixx iyy izz ixy ixz iyz")
def full_inertia_in_urdf_order(tree: Element, rng: Random) -> Mutant:
    """Write fullinertia in the order of the URDF attributes."""
    body = rng.choice(named(tree, "body", "(thigh|hip_pitch_link|hip_yaw_link)$"))
    inertial = body.find("inertial")
    xx, yy, zz, xy, xz, yz = numbers(inertial.get("fullinertia"))
    inertial.set("fullinertia", format_numbers((xx, xy, xz, yy, yz, zz)))
    return of(body)


@DEFECTS("inertia", "go2.xml h1.xml g1.xml", "the quat of <inertial> is lost with diaginertia kept")
def inertial_rotation_missing(tree: Element, rng: Random) -> Mutant:
    """Drop the rotation of the principal axes of a body."""
    body = rng.choice(named(tree, "body", "(base_link|ankle_link|ankle_roll_link)$"))
    body.find("inertial").attrib.pop("quat")
    return of(body)
