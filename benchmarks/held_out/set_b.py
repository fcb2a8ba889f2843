"""Held-out defects, set B: not shown to the authors of the rules before it was measured."""

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
SHANK = "(calf|knee_link)$"


def limited(tree: Element) -> list[Element]:
    """Return the joints that have a limit."""
    return [j for j in tree.iter("joint") if j.find("limit") is not None]


def motors(tree: Element) -> list[Element]:
    """Return the MJCF motors."""
    return list(tree.find("actuator").iter("motor"))


def driven(*actuators: Element) -> Mutant:
    """Return the mutant in which these actuators are broken."""
    names = [a.get(key) for a in actuators for key in ("name", "joint")]
    return Mutant(names=tuple(dict.fromkeys(names)))


# Joint dynamics, effort and speed of URDF


@DEFECTS("dynamics", "go2 g1 quadruped", "exporters leave velocity 0, which some readers obey")
def velocity_left_zero(tree: Element, rng: Random) -> Mutant:
    """Leave the velocity of one leg at 0."""
    side = rng.choice(("FL|left", "FR|right"))
    joints = [j for j in limited(tree) if j in named(tree, "joint", f"^({side})")]
    for joint in joints:
        joint.find("limit").set("velocity", "0")
    return of(*joints)


@DEFECTS("dynamics", "a1 g1", "a data sheet gives degrees per second")
def velocity_in_degrees(tree: Element, rng: Random) -> Mutant:
    """Give the velocity of one knee in degrees per second."""
    joint = rng.choice(named(tree, "joint", KNEE))
    multiply(joint.find("limit"), DEGREES, "velocity")
    return of(joint)


@DEFECTS("dynamics", "g1 h1 biped", "rows of a table of motors are exchanged")
def efforts_of_knee_and_ankle_swapped(tree: Element, rng: Random) -> Mutant:
    """Exchange the efforts of the knees and the ankles."""
    broken = []
    for side in ("left", "right"):
        knee = named(tree, "joint", f"{side}_knee_joint$")[0]
        ankle = named(tree, "joint", f"{side}_ankle(_pitch)?_joint$")[0]
        a, b = knee.find("limit"), ankle.find("limit")
        effort = a.get("effort")
        a.set("effort", b.get("effort"))
        b.set("effort", effort)
        broken += [knee, ankle]
    return of(*broken)


@DEFECTS("dynamics", "a1 quadruped", "servo data sheets give kgf cm")
def effort_in_kilogram_centimeters(tree: Element, rng: Random) -> Mutant:
    """Give the effort of all joints in kgf cm."""
    joints = limited(tree)
    for joint in joints:
        multiply(joint.find("limit"), 10.197, "effort")
    return of(*joints)


@DEFECTS("dynamics", "quadruped biped", "identified friction is entered for one side only")
def dynamics_of_one_side(tree: Element, rng: Random) -> Mutant:
    """Multiply damping and friction of the left legs by 8."""
    joints = [j for j in named(tree, "joint", "^(FL|RL|left)") if j.find("dynamics") is not None]
    for joint in joints:
        multiply(joint.find("dynamics"), 8, "damping", "friction")
    return of(*joints)


@DEFECTS("dynamics", "quadruped biped", "onshape-to-robot#141: <joint_properties> is not URDF")
def dynamics_under_other_tag(tree: Element, rng: Random) -> Mutant:
    """Write <joint_properties> for <dynamics>: no parser reads it."""
    joints = [j for j in tree.iter("joint") if j.find("dynamics") is not None]
    for joint in joints:
        joint.find("dynamics").tag = "joint_properties"
    return Mutant(names=of(*joints).names, about="joint_properties|dynamics")


@DEFECTS("dynamics", "go2 h1 biped", "a mirrored joint gets a minus sign on every number")
def effort_negative(tree: Element, rng: Random) -> Mutant:
    """Give one joint a negative effort."""
    joint = rng.choice(limited(tree))
    multiply(joint.find("limit"), -1, "effort")
    return of(joint)


@DEFECTS("dynamics", "a1 go2 quadruped", "exporters write a safety controller of zeros")
def safety_controller_of_zeros(tree: Element, rng: Random) -> Mutant:
    """Give a knee soft limits at 0, outside its hard limits."""
    joint = rng.choice(named(tree, "joint", KNEE))
    limits = {"soft_lower_limit": "0.0", "soft_upper_limit": "0.0"}
    add(joint, "safety_controller", k_position="10", k_velocity="0", **limits)
    return of(joint)


# Damping, armature, friction loss, gear of MJCF


@DEFECTS("mjcf_joint", "quadruped.xml biped.xml go2.xml", "unitree_ros#130: G1's file has none")
def armature_missing(tree: Element, rng: Random) -> Mutant:
    """Drop every armature."""
    for joint in tree.iter("joint"):
        joint.attrib.pop("armature", None)
    return Mutant(names=of(*named(tree, "joint", "joint")).names, about="armature")


@DEFECTS("mjcf_joint", "quadruped.xml biped.xml", "a zero slips in one leg")
def armature_of_one_joint(tree: Element, rng: Random) -> Mutant:
    """Give one knee an armature of another order."""
    joint = rng.choice(named(tree, "joint", KNEE))
    joint.set("armature", "0.3")
    return of(joint)


@DEFECTS("mjcf_joint", "quadruped.xml h1.xml go2.xml", "a motor is switched off for a test")
def gear_zero(tree: Element, rng: Random) -> Mutant:
    """Give one motor the gear 0."""
    motor = rng.choice(motors(tree))
    motor.set("gear", "0")
    return driven(motor)


@DEFECTS(
    "mjcf_joint", "quadruped.xml biped.xml", "gear has six numbers for sites; a hinge uses one"
)
def gear_in_wrong_place(tree: Element, rng: Random) -> Mutant:
    """Write the gear of one motor as a torque about x of a site."""
    motor = rng.choice(motors(tree))
    motor.set("gear", "0 0 0 1 0 0")
    return driven(motor)


@DEFECTS("mjcf_joint", "quadruped.xml g1.xml h1.xml", "a line is pasted and only its name changed")
def motor_joint_repeated(tree: Element, rng: Random) -> Mutant:
    """Let two motors drive one joint, and none another."""
    first, second = rng.sample(motors(tree), 2)
    lost = second.get("joint")
    second.set("joint", first.get("joint"))
    return Mutant(names=(first.get("name"), *driven(second).names, lost))


@DEFECTS("mjcf_joint", "quadruped.xml biped.xml h1.xml", "a data sheet gives N m, a class kN m")
def force_range_below_control_range(tree: Element, rng: Random) -> Mutant:
    """Clamp one motor's force to a thousandth of its control range."""
    motor = rng.choice(motors(tree))
    motor.set("forcerange", "-0.0237 0.0237")
    motor.set("forcelimited", "true")
    return driven(motor)


@DEFECTS("mjcf_joint", "quadruped.xml go2.xml biped.xml", "kp is set as the stiffness of the joint")
def stiffness_of_controller(tree: Element, rng: Random) -> Mutant:
    """Give the knees a spring that pulls them to 0."""
    joints = named(tree, "joint", KNEE)
    for joint in joints:
        joint.set("stiffness", "80")
    return Mutant(names=of(*joints).names, about="stiffness|spring")


@DEFECTS("mjcf_joint", "quadruped.xml g1.xml h1.xml", "a line of <actuator> is lost in a merge")
def motor_missing(tree: Element, rng: Random) -> Mutant:
    """Take out one motor."""
    motor = rng.choice(motors(tree))
    motor.getparent().remove(motor)
    return driven(motor)


@DEFECTS("mjcf_joint", "quadruped.xml biped.xml go2.xml", "mujoco_menagerie#232: gains of an arm")
def position_gains_of_arm(tree: Element, rng: Random) -> Mutant:
    """Replace the motors by position actuators with the gains of an industrial arm."""
    broken = motors(tree)
    for motor in broken:
        motor.tag = "position"
        motor.attrib.pop("class", None)
        motor.set("kp", "2000")
        motor.set("kv", "100")
    return Mutant(names=driven(*broken).names, about=r"\bk[pv]\b|gain")


@DEFECTS("mjcf_joint", "h1.xml g1.xml", "the minus sign is lost in copying")
def actuator_force_range_one_sided(tree: Element, rng: Random) -> Mutant:
    """Let one joint be pulled one way only."""
    joint = rng.choice([j for j in tree.iter("joint") if j.get("actuatorfrcrange")])
    joint.set("actuatorfrcrange", f"0 {numbers(joint.get('actuatorfrcrange'))[1]:g}")
    return of(joint)


@DEFECTS("mjcf_joint", "quadruped.xml go2.xml biped.xml", "Gymnasium's -1 1 is used without a gear")
def normalized_range_without_gear(tree: Element, rng: Random) -> Mutant:
    """Give all motors the control range -1 1 and no gear."""
    broken = motors(tree)
    for motor in tree.iter("motor"):
        motor.attrib.pop("gear", None)
        motor.set("ctrlrange", "-1 1")
    return Mutant(names=driven(*broken).names, about="torque|ctrlrange|motor")


# <option>


@DEFECTS("option", "quadruped.xml h1.xml", "y is up in the CAD program")
def gravity_along_y(tree: Element, rng: Random) -> Mutant:
    """Let gravity pull along y."""
    option(tree, gravity="0 -9.81 0")
    return Mutant(about="gravity")


@DEFECTS("option", "biped.xml g1.xml", "gravity is switched off to tune a controller")
def gravity_disabled(tree: Element, rng: Random) -> Mutant:
    """Leave gravity switched off by its flag."""
    add(option(tree), "flag", gravity="disable")
    return Mutant(about="gravity")


@DEFECTS("option", "quadruped.xml go2.xml", "the constraint solver is switched off to debug")
def constraint_disabled(tree: Element, rng: Random) -> Mutant:
    """Leave all constraints switched off."""
    add(option(tree), "flag", constraint="disable")
    return Mutant(about="constraint|flag")


@DEFECTS("option", "biped.xml h1.xml", "the step is given in milliseconds")
def timestep_in_milliseconds(tree: Element, rng: Random) -> Mutant:
    """Give the time step in milliseconds."""
    option(tree, timestep="2")
    return Mutant(about="time ?step")


@DEFECTS("option", "quadruped.xml h1.xml", "a flag for a gripper is copied; neighbors overlap")
def parent_filter_disabled(tree: Element, rng: Random) -> Mutant:
    """Let a body collide with its parent."""
    add(option(tree), "flag", filterparent="disable")
    return Mutant(about="filterparent|parent.*(filter|collid|contact)|flag")


@DEFECTS("option", "quadruped.xml biped.xml", "joint limits are switched off to debug")
def limits_disabled(tree: Element, rng: Random) -> Mutant:
    """Leave joint limits switched off."""
    add(option(tree), "flag", limit="disable")
    return Mutant(about="flag|limits? .*(disable|off)|disable.*limit")


@DEFECTS("option", "quadruped.xml h1.xml", "the header is copied from Gymnasium's swimmer")
def fluid_of_swimmer(tree: Element, rng: Random) -> Mutant:
    """Leave the robot in a dense fluid."""
    option(tree, density="4000", viscosity="0.1")
    return Mutant(about="density|viscosity|fluid")


@DEFECTS("option", "g1.xml go2.xml", "actuation is switched off to look at the passive robot")
def actuation_disabled(tree: Element, rng: Random) -> Mutant:
    """Leave the actuators switched off."""
    add(option(tree), "flag", actuation="disable")
    return Mutant(about="actuat|flag")


# Feet


@DEFECTS("foot", "quadruped.xml biped.xml go2.xml", "sliding comes first, rolling last")
def friction_in_reverse_order(tree: Element, rng: Random) -> Mutant:
    """Write the friction of all feet in the reverse order."""
    geoms = feet(tree)
    for geom in geoms:
        geom.set("friction", "0.01 0.02 0.8")
    return of(*geoms)


@DEFECTS("foot", "quadruped.xml g1.xml go2.xml", "bits that keep legs apart keep the floor out")
def contact_bits_without_floor(tree: Element, rng: Random) -> Mutant:
    """Give the feet contact bits that no floor has by default."""
    geoms = feet(tree)
    for geom in geoms:
        geom.set("contype", "2")
        geom.set("conaffinity", "2")
    return of(*geoms)


@DEFECTS("foot", "quadruped.xml biped.xml go2.xml", "a decimal slips in one leg")
def friction_of_one_foot(tree: Element, rng: Random) -> Mutant:
    """Give one foot a tenth of the others' friction."""
    geom = rng.choice(feet(tree))
    geom.set("friction", "0.06 0.02 0.01")
    return of(geom)


@DEFECTS("foot", "a1 go2 quadruped", "<collision> is deleted with a mesh that did not load")
def foot_collision_missing(tree: Element, rng: Random) -> Mutant:
    """Delete the collision shape of one foot."""
    link = rng.choice(named(tree, "link", "foot$"))
    link.remove(link.find("collision"))
    return of(link)


@DEFECTS("foot", "quadruped.xml biped.xml h1.xml", "solref is time constant, then damping ratio")
def contact_time_in_seconds(tree: Element, rng: Random) -> Mutant:
    """Exchange the numbers of solref: the foot sinks in."""
    geoms = feet(tree)
    for geom in geoms:
        geom.set("solref", "1 0.02")
        geom.set("priority", "1")
    return of(*geoms)


@DEFECTS("foot", "quadruped.xml go2.xml", "a margin is given in millimeters")
def margin_in_millimeters(tree: Element, rng: Random) -> Mutant:
    """Give the feet a margin of a meter: the robot hovers."""
    geoms = feet(tree)
    for geom in geoms:
        geom.set("margin", "1")
    return of(*geoms)


def _foot_frictions(tree: Element) -> None:
    """Give every foot friction in Gazebo."""
    for link in named(tree, "link", "foot$"):
        gazebo = add(tree, "gazebo", reference=link.get("name"))
        for tag in ("mu1", "mu2"):
            add(gazebo, tag).text = "0.6"


@DEFECTS("foot", "a1 quadruped", "one <gazebo> block is left at 0", prepare=_foot_frictions)
def gazebo_friction_zero(tree: Element, rng: Random) -> Mutant:
    """Leave the friction of one foot in Gazebo at 0."""
    gazebo = rng.choice(tree.findall("gazebo"))
    for tag in ("mu1", "mu2"):
        gazebo.find(tag).text = "0.0"
    return Mutant(names=(gazebo.get("reference"),))


# Units and limits


@DEFECTS("units", "g1 biped", "rpy is typed in degrees")
def joint_angle_in_degrees(tree: Element, rng: Random) -> Mutant:
    """Give the rotation of one joint's frame in degrees."""
    joints = named(tree, "joint", "(hip_roll|knee)_joint$")
    joint = rng.choice([j for j in joints if any(numbers(j.find("origin").get("rpy")))])
    multiply(joint.find("origin"), DEGREES, "rpy")
    return of(joint)


@DEFECTS("units", "quadruped.xml biped.xml", "one euler is typed in degrees in a file of radians")
def euler_in_degrees(tree: Element, rng: Random) -> Mutant:
    """Give the rotation of one collision geom in degrees."""
    geom = rng.choice([g for g in tree.iter("geom") if is_solid(g) and g.get("euler")])
    multiply(geom, DEGREES, "euler")
    return of(geom)


@DEFECTS("units", "a1 h1 g1", "one mesh is exported in meters, the scale is that of millimeters")
def mesh_scale_of_millimeters(tree: Element, rng: Random) -> Mutant:
    """Scale the meshes of one link by 0.001."""
    link = rng.choice([x for x in tree.iter("link") if x.find("visual/geometry/mesh") is not None])
    for mesh in link.iter("mesh"):
        mesh.set("scale", "0.001 0.001 0.001")
    return of(link)


@DEFECTS("units", "h1.xml g1.xml", "one mesh asset keeps the scale of millimeters")
def asset_scale_of_millimeters(tree: Element, rng: Random) -> Mutant:
    """Scale one mesh asset by 0.001."""
    mesh = rng.choice(named(tree, "mesh", "(knee|hip_pitch|torso)_link$"))
    mesh.set("scale", "0.001 0.001 0.001")
    bodies = [g.getparent() for g in tree.iter("geom") if g.get("mesh") == mesh.get("name")]
    return Mutant(names=(mesh.get("name"), mesh.get("file"), *of(*bodies).names))


@DEFECTS("units", "quadruped biped", "Fusion2PyBullet#2: a document in cm is a tenth as large")
def robot_at_tenth(tree: Element, rng: Random) -> Mutant:
    """Divide all lengths by 10, with the masses and inertias of the real robot."""
    for element in tree.iter("origin", "box", "cylinder", "sphere"):
        for attribute in ("xyz", "size", "radius", "length"):
            if element.get(attribute):
                multiply(element, 0.1, attribute)
    return Mutant(names=of(*tree.iter("link")).names, about="scale|unit|height|size")


@DEFECTS("units", "go2 h1 quadruped", "CAD lists kg m2 and g m2 in the same table")
def inertia_in_grams(tree: Element, rng: Random) -> Mutant:
    """Multiply the inertia of one link by 1000."""
    link = rng.choice(named(tree, "link", SHANK))
    inertia = link.find("inertial/inertia")
    multiply(inertia, 1000, *inertia.attrib)
    return of(link)


@DEFECTS("units", "a1 g1", "CAD gives kg cm2 for the whole assembly")
def inertias_in_square_centimeters(tree: Element, rng: Random) -> Mutant:
    """Multiply the inertias of all links by 10,000."""
    for inertia in tree.iter("inertia"):
        multiply(inertia, 1e4, *inertia.attrib)
    return of(*tree.iter("link"))


@DEFECTS("units", "quadruped.xml go2.xml", "ref is taken for the standing pose")
def reference_angle_of_standing_pose(tree: Element, rng: Random) -> Mutant:
    """Shift the zero of one thigh by its standing angle."""
    joint = rng.choice(named(tree, "joint", THIGH))
    joint.set("ref", "0.9")
    return of(joint)


@DEFECTS("units", "quadruped.xml go2.xml biped.xml", "a limit of another version of the robot")
def range_without_home(tree: Element, rng: Random) -> Mutant:
    """Give all knees limits that leave out the home keyframe."""
    joints = named(tree, "joint", KNEE)
    for joint in joints:
        joint.set("range", "-2.7227 -2.2" if "calf" in joint.get("name") else "0.6 2.8798")
    return Mutant(names=(*of(*joints).names, "home"))


@DEFECTS("units", "quadruped.xml go2.xml biped.xml", "a pose is read off a slider in degrees")
def keyframe_in_degrees(tree: Element, rng: Random) -> Mutant:
    """Give the joint angles of the home keyframe in degrees."""
    key = tree.find("keyframe/key")
    for attribute, first in (("qpos", 7), ("ctrl", 0)):
        if key.get(attribute):
            values = numbers(key.get(attribute))
            key.set(
                attribute, format_numbers(values[:first] + [x * DEGREES for x in values[first:]])
            )
    return Mutant(names=("home",), about="keyframe")


@DEFECTS("units", "go2 h1 biped", "Fusion 360's API gives centimeters")
def joint_origin_in_centimeters(tree: Element, rng: Random) -> Mutant:
    """Give the origin of one knee in centimeters."""
    joint = rng.choice(named(tree, "joint", KNEE))
    multiply(joint.find("origin"), 100, "xyz")
    return of(joint)


# Collision shapes


@DEFECTS("collision", "a1 go2 quadruped", "a cylinder is along z; it is turned about another axis")
def turned_about_wrong_axis(tree: Element, rng: Random) -> Mutant:
    """Turn a collision shape by 90 degrees about the wrong axis."""
    origins = [
        origin
        for origin in tree.findall("link/collision/origin")
        if abs(max(numbers(origin.get("rpy", "0 0 0")), key=abs)) > 1.5
    ]
    origin = rng.choice(origins)
    roll, pitch, yaw = numbers(origin.get("rpy"))
    origin.set("rpy", format_numbers((pitch, roll, yaw)))
    return of(origin.getparent().getparent())


@DEFECTS("collision", "quadruped.xml biped.xml go2.xml", "URDF's order is length, then radius")
def radius_and_length_swapped(tree: Element, rng: Random) -> Mutant:
    """Exchange radius and half length of a shank's or thigh's cylinder."""
    geoms = [
        geom
        for body in named(tree, "body", "(calf|knee_link|hip_yaw_link)$")
        for geom in body.findall("geom")
        if is_solid(geom) and geom.get("type") == "cylinder"
    ]
    geom = rng.choice(geoms)
    geom.set("size", format_numbers(reversed(numbers(geom.get("size")))))
    return of(geom)


@DEFECTS("collision", "a1 go2 quadruped", "a block is pasted into the wrong link")
def base_shape_in_calf(tree: Element, rng: Random) -> Mutant:
    """Give a calf the collision box of the trunk too."""
    link = rng.choice(named(tree, "link", "calf$"))
    trunk = named(tree, "link", "^(base|trunk)$")[-1]
    pasted = add(link, "collision")
    add(pasted, "origin", xyz="0 0 0", rpy="0 0 0")
    size = trunk.find("collision/geometry/box").get("size")
    add(add(pasted, "geometry"), "box", size=size)
    return of(link)


@DEFECTS("collision", "h1 g1", "only one of two meshes is mirrored for the right side")
def collision_mesh_mirror_image(tree: Element, rng: Random) -> Mutant:
    """Mirror the collision mesh of one link, but not its visual."""
    link = rng.choice(named(tree, "link", "hip_pitch_link$"))
    link.find("collision/geometry/mesh").set("scale", "1 -1 1")
    return of(link)


@DEFECTS("collision", "a1 go2 quadruped", "the placeholder of a template is left")
def base_shape_is_placeholder(tree: Element, rng: Random) -> Mutant:
    """Leave the trunk a box of a millimeter."""
    trunk = named(tree, "link", "^(base|trunk)$")[-1]
    trunk.find("collision/geometry/box").set("size", "0.001 0.001 0.001")
    return of(trunk)


@DEFECTS("collision", "quadruped.xml biped.xml go2.xml", "the sign of z is lost")
def geom_above_joint(tree: Element, rng: Random) -> Mutant:
    """Put the shape of one thigh or shank on the wrong side of the joint."""
    geoms = [
        geom
        for body in named(tree, "body", "(thigh|calf|knee_link)$")
        for geom in body.findall("geom")
        if is_solid(geom) and geom.get("pos")
    ]
    geom = rng.choice(geoms)
    x, y, z = numbers(geom.get("pos"))
    geom.set("pos", format_numbers((x, y, -z)))
    return of(geom)


@DEFECTS("collision", "h1 g1", "the collision meshes are inflated for planning")
def collision_mesh_inflated(tree: Element, rng: Random) -> Mutant:
    """Scale the collision mesh of one link by 1.5."""
    link = rng.choice(named(tree, "link", "(hip_pitch|knee|torso)_link$"))
    link.find("collision/geometry/mesh").set("scale", "1.5 1.5 1.5")
    return of(link)


@DEFECTS("collision", "h1 g1", "a converter turns the collision mesh from y up to z up")
def collision_mesh_not_aligned(tree: Element, rng: Random) -> Mutant:
    """Turn the collision mesh of one link, but not its visual."""
    link = rng.choice(named(tree, "link", "(hip_pitch|knee|torso)_link$"))
    link.find("collision/origin").set("rpy", "1.5707963 0 0")
    return of(link)


# Children


@DEFECTS("children", "a1 g1 quadruped", "a merge keeps both axes")
def axis_repeated(tree: Element, rng: Random) -> Mutant:
    """Give a joint a second, different axis."""
    joint = rng.choice(named(tree, "joint", KNEE))
    add(joint, "axis", xyz="1 0 0")
    return of(joint)


@DEFECTS("children", "go2 biped", "a limit is added without deleting the exported one")
def limit_repeated(tree: Element, rng: Random) -> Mutant:
    """Give a joint a second, narrower limit."""
    joint = rng.choice(named(tree, "joint", THIGH))
    add(joint, "limit", lower="-0.5", upper="0.5", effort="10", velocity="5")
    return of(joint)


@DEFECTS("children", "a1 quadruped h1", "xyz defaults to 0 where it is left out")
def joint_origin_without_position(tree: Element, rng: Random) -> Mutant:
    """Leave out xyz from the origin of a knee."""
    joint = rng.choice(named(tree, "joint", KNEE))
    joint.find("origin").attrib.pop("xyz")
    return of(joint)


@DEFECTS("children", "go2 g1", "a part without material has no mass in CAD")
def mass_missing(tree: Element, rng: Random) -> Mutant:
    """Delete the mass of one link."""
    link = rng.choice(named(tree, "link", "(thigh|calf|knee_link|hip_pitch_link)$"))
    inertial = link.find("inertial")
    inertial.remove(inertial.find("mass"))
    return of(link)


@DEFECTS("children", "a1 h1 biped", "an attribute is lost in a search and replace")
def moment_missing(tree: Element, rng: Random) -> Mutant:
    """Delete izz of one link."""
    link = rng.choice(named(tree, "link", "(thigh|knee_link|hip_pitch_link)$"))
    link.find("inertial/inertia").attrib.pop("izz")
    return of(link)


@DEFECTS("children", "a1 biped", "a degree sign is typed in an editor set to Latin-1")
def comment_in_latin1(tree: Element, rng: Random) -> Mutant:
    """Write a degree sign in Latin-1 under a declaration of UTF-8."""
    joint = limited(tree)[0]
    joint.append(joint.makeelement("limit_comment"))
    joint[-1].text = "±46°"
    tree_comment = "encod|utf|latin|parse|byte|character"

    def encode(text: str) -> bytes:
        block = "<limit_comment>±46°</limit_comment>"
        return text.replace(block, "<!-- ±46° -->").encode("latin-1")

    return Mutant(about=tree_comment, encode=encode)


@DEFECTS("children", "go2 quadruped", "a German locale writes a decimal comma")
def decimal_comma(tree: Element, rng: Random) -> Mutant:
    """Write the origin of one joint with decimal commas."""
    joint = rng.choice(named(tree, "joint", "hip_joint$"))
    origin = joint.find("origin")
    origin.set("xyz", origin.get("xyz").replace(".", ","))
    return of(joint)


@DEFECTS("children", "g1 a1", "<limit> is deleted to make a joint free")
def limit_missing(tree: Element, rng: Random) -> Mutant:
    """Delete the limit of a revolute joint."""
    joint = rng.choice(named(tree, "joint", KNEE))
    joint.remove(joint.find("limit"))
    return of(joint)


@DEFECTS("children", "a1 quadruped go2", "a block is pasted one line too low")
def inertial_in_visual(tree: Element, rng: Random) -> Mutant:
    """Put <inertial> into <visual>: no parser reads it there."""
    link = rng.choice(named(tree, "link", "(thigh|calf)$"))
    link.find("visual").append(link.find("inertial"))
    return of(link)


@DEFECTS("children", "quadruped.xml go2.xml", "a material is renamed")
def geom_material_undefined(tree: Element, rng: Random) -> Mutant:
    """Use a material that no asset defines."""
    geom = rng.choice([g for g in tree.iter("geom") if g.get("material") and g.get("class")])
    geom.set("material", "rubber")
    return Mutant(names=("rubber",))


@DEFECTS("children", "go2 biped", "a mesh that did not load is deleted from its <geometry>")
def geometry_empty(tree: Element, rng: Random) -> Mutant:
    """Leave the collision geometry of a link empty."""
    link = rng.choice([x for x in tree.iter("link") if x.find("collision") is not None])
    geometry = link.find("collision/geometry")
    geometry.remove(geometry[0])
    return of(link)


@DEFECTS("children", "a1 g1 quadruped", "a typo: the limit then defaults to 0")
def limit_attribute_misspelled(tree: Element, rng: Random) -> Mutant:
    """Misspell the upper limit of a joint."""
    joint = rng.choice(named(tree, "joint", THIGH))
    limit = joint.find("limit")
    limit.set("uper", limit.attrib.pop("upper"))
    return of(joint)


# References


def _ros2_control(tree: Element) -> None:
    """Declare every joint to ros2_control."""
    names = [j.get("name") for j in tree.findall("joint") if j.get("type") == "revolute"]
    system = add(tree, "ros2_control", name="System", type="system")
    add(add(system, "hardware"), "plugin").text = "gz_ros2_control/GazeboSimSystem"
    for name in names:
        joint = add(system, "joint", name=name)
        add(joint, "command_interface", name="effort")
        for state in ("position", "velocity", "effort"):
            add(joint, "state_interface", name=state)


@DEFECTS("references", "a1 go2", "a joint is renamed, its interface is not", prepare=_ros2_control)
def controlled_joint_missing(tree: Element, rng: Random) -> Mutant:
    """Let <ros2_control> name a joint that is not there."""
    joint = rng.choice(tree.findall("ros2_control/joint"))
    lost = joint.get("name")
    joint.set("name", lost.replace("_joint", ""))
    return Mutant(names=(lost,), about=f"ros2_control|{joint.get('name')}.*(not|no joint|missing)")


@DEFECTS("references", "go2 quadruped", "names differ in case between two files")
def gazebo_joint_in_lower_case(tree: Element, rng: Random) -> Mutant:
    """Let <gazebo reference> name a joint in lower case."""
    name = rng.choice(named(tree, "joint", KNEE)).get("name").lower()
    add(add(tree, "gazebo", reference=name), "implicitSpringDamper").text = "true"
    return Mutant(names=(name,))


@DEFECTS("references", "a1 h1", "the plugin is copied from another robot")
def plugin_body_missing(tree: Element, rng: Random) -> Mutant:
    """Let a Gazebo plugin publish the pose of a body that is not there."""
    gazebo = add(tree, "gazebo")
    plugin = add(gazebo, "plugin", name="ground_truth", filename="libgazebo_ros_p3d.so")
    add(plugin, "bodyName").text = "chassis_link"
    return Mutant(names=("chassis_link",))


@DEFECTS("references", "quadruped.xml biped.xml", "sides are exchanged in copying")
def touch_sensors_swapped(tree: Element, rng: Random) -> Mutant:
    """Exchange the sites of the left and the right foot's touch sensors."""
    left, right = list(tree.find("sensor").iter("touch"))[:2]
    a, b = left.get("site"), right.get("site")
    left.set("site", b)
    right.set("site", a)
    return Mutant(names=(left.get("name"), right.get("name")))


@DEFECTS("references", "quadruped.xml biped.xml", "a sensor line is copied from the foot's")
def gyro_on_foot(tree: Element, rng: Random) -> Mutant:
    """Let the gyro of the trunk measure a foot."""
    gyro = next(tree.find("sensor").iter("gyro"))
    gyro.set("site", next(tree.find("sensor").iter("touch")).get("site"))
    return Mutant(names=(gyro.get("name"),))


@DEFECTS("references", "g1 go2", "the SRDF is that of another version of the robot")
def semantic_chain_missing(tree: Element, rng: Random) -> Mutant:
    """Put an SRDF next to the robot whose chain ends at a link that is not there."""
    base = tree.find("link").get("name")
    text = (
        f'<?xml version="1.0"?>\n<robot name="{tree.get("name")}">\n'
        f'  <group name="leg"><chain base_link="{base}" tip_link="left_sole_frame"/></group>\n'
        "</robot>\n"
    )
    return Mutant(names=("left_sole_frame",), files={f"{tree.get('name')}.srdf": text})


@DEFECTS("references", "h1.xml biped.xml", "a body is renamed, <exclude> is not")
def excluded_body_missing(tree: Element, rng: Random) -> Mutant:
    """Exclude a contact of a body that is not there."""
    add(add(tree, "contact"), "exclude", body1="pelvis", body2="left_thigh_link")
    return Mutant(names=("left_thigh_link",))


@DEFECTS("references", "a1 go2", "gazebosim: names of collisions change when links are lumped")
def contact_sensor_collision_missing(tree: Element, rng: Random) -> Mutant:
    """Let a contact sensor listen to a collision that is not there."""
    gazebo = add(tree, "gazebo", reference="FL_calf")
    sensor = add(gazebo, "sensor", name="FL_contact", type="contact")
    add(add(sensor, "contact"), "collision").text = "FL_shank_sole_collision"
    return Mutant(names=("FL_shank_sole_collision", "FL_contact"))


# Copy and paste between legs


@DEFECTS("copy_paste", "a1 go2", "the child is not renamed after copying the leg")
def child_of_other_leg(tree: Element, rng: Random) -> Mutant:
    """Let two joints move the same thigh."""
    joint = named(tree, "joint", "FR_thigh_joint$")[0]
    joint.find("child").set("link", "FL_thigh")
    return Mutant(names=("FR_thigh_joint", "FL_thigh", "FR_thigh"))


@DEFECTS("copy_paste", "go2 quadruped h1.xml", "digits are exchanged in one leg")
def length_of_one_leg(tree: Element, rng: Random) -> Mutant:
    """Make one thigh a little longer than the others."""
    if tree.tag == "mujoco":
        body = rng.choice(named(tree, "body", "knee_link$"))
        body.set("pos", "0 0 -0.44")
        return of(body)
    joint = rng.choice(named(tree, "joint", KNEE))
    joint.find("origin").set("xyz", "0 0 -0.231")
    return of(joint)


@DEFECTS("copy_paste", "go2 h1 quadruped.xml", "digits are exchanged in one leg")
def mass_of_one_leg(tree: Element, rng: Random) -> Mutant:
    """Exchange two digits of one thigh's mass."""
    part = rng.choice(named(tree, "body" if tree.tag == "mujoco" else "link",
                            "(thigh|hip_pitch_link)$"))  # fmt: skip
    mass = part.find("inertial" if tree.tag == "mujoco" else "inertial/mass")
    key = "mass" if tree.tag == "mujoco" else "value"
    mass.set(key, {"1.152": "1.512", "4.152": "4.512"}[mass.get(key)])
    return of(part)


@DEFECTS("copy_paste", "a1 go2 quadruped.xml", "the sign of x is not changed after copying")
def rear_leg_in_front(tree: Element, rng: Random) -> Mutant:
    """Put a rear leg where the front one is."""
    part = rng.choice(named(tree, "body", "^(RL|RR)_hip$")
                      or named(tree, "joint", "^(RL|RR)_hip_joint$"))  # fmt: skip
    origin, key = (part, "pos") if part.tag == "body" else (part.find("origin"), "xyz")
    x, y, z = numbers(origin.get(key))
    origin.set(key, format_numbers((-x, y, z)))
    return of(part)


@DEFECTS("copy_paste", "quadruped.xml go2.xml", "the class of the joint above is pasted")
def class_of_other_joint(tree: Element, rng: Random) -> Mutant:
    """Give a thigh the class, and so the axis, of the hip."""
    joint = rng.choice(named(tree, "joint", "thigh_joint$"))
    joint.set("class", named(tree, "joint", "hip_joint$")[0].get("class"))
    return of(joint)


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


@DEFECTS("copy_paste", "a1 quadruped", "a sign is changed for the right", prepare=_mimic_joints)
def mimic_with_other_sign(tree: Element, rng: Random) -> Mutant:
    """Let one rod turn against its knee."""
    joint = named(tree, "joint", "FR_rod_joint")[0]
    joint.find("mimic").set("multiplier", "-1")
    return of(joint)


@DEFECTS("copy_paste", "go2 g1 quadruped", "walk-these-ways#13: efforts of two versions")
def effort_of_one_leg(tree: Element, rng: Random) -> Mutant:
    """Give one leg the effort of another version of the robot."""
    joint = rng.choice(named(tree, "joint", KNEE))
    multiply(joint.find("limit"), 1.4, "effort")
    return of(joint)


@DEFECTS("copy_paste", "h1.xml g1.xml", "left and right are seen from the front")
def meshes_of_sides_swapped(tree: Element, rng: Random) -> Mutant:
    """Exchange the meshes of the left and the right hip."""
    part = "hip_pitch_link"
    for geom in list(tree.iter("geom")):
        side, _, rest = (geom.get("mesh") or "").partition("_")
        if rest == part:
            geom.set("mesh", f"{'right' if side == 'left' else 'left'}_{part}")
    return of(*named(tree, "body", f"^(left|right)_{part}$"))


@DEFECTS("copy_paste", "g1 g1.xml", "the rotation of the left shoulder is pasted on the right")
def shoulder_not_mirror_image(tree: Element, rng: Random) -> Mutant:
    """Give the right shoulder the rotation of the left one."""
    if tree.tag == "mujoco":
        left, right = named(tree, "body", "(left|right)_shoulder_pitch_link$")
        right.set("quat", left.get("quat"))
        return of(right)
    left, right = named(tree, "joint", "(left|right)_shoulder_pitch_joint$")
    right.find("origin").set("rpy", left.find("origin").get("rpy"))
    return of(right)


@DEFECTS("copy_paste", "a1 quadruped.xml", "left and right are seen from the front")
def legs_named_for_other_side(tree: Element, rng: Random) -> Mutant:
    """Exchange the names of the front legs."""
    for element in tree.iter():
        for key, value in element.attrib.items():
            if value.startswith("FL_"):
                element.set(key, f"FR_{value[3:]}")
            elif value.startswith("FR_"):
                element.set(key, f"FL_{value[3:]}")
    names = of(*named(tree, "joint", "^(FL|FR)_"), *named(tree, "link", "^(FL|FR)_")).names
    return Mutant(names=(*names, "FL", "FR"), about="left|right")


# Inertia


@DEFECTS("inertia", "a1 go2 quadruped", "the placeholder of a template is left")
def inertia_is_placeholder(tree: Element, rng: Random) -> Mutant:
    """Leave the trunk an inertia of 0.001 about each axis."""
    trunk = named(tree, "link", "^(base|trunk)$")[-1]
    moments = {"ixx": "0.001", "iyy": "0.001", "izz": "0.001"}
    for key, value in ({"ixy": "0", "ixz": "0", "iyz": "0"} | moments).items():
        trunk.find("inertial/inertia").set(key, value)
    return of(trunk)


@DEFECTS("inertia", "go2 quadruped a1", "x is across the robot in the CAD program")
def base_axes_swapped(tree: Element, rng: Random) -> Mutant:
    """Exchange ixx and iyy of the trunk."""
    trunk = named(tree, "link", "^(base|trunk)$")[-1]
    inertia = trunk.find("inertial/inertia")
    ixx, iyy = inertia.get("ixx"), inertia.get("iyy")
    inertia.set("ixx", iyy)
    inertia.set("iyy", ixx)
    return of(trunk)


@DEFECTS("inertia", "a1 go2 h1", "onshape-to-robot#85: the tensor is turned already")
def inertia_rotation_repeated(tree: Element, rng: Random) -> Mutant:
    """Turn the inertia of a long link by 90 degrees."""
    link = rng.choice(named(tree, "link", SHANK))
    link.find("inertial/origin").set("rpy", "1.5707963 0 0")
    return of(link)


@DEFECTS("inertia", "go2 h1 quadruped.xml", "the sign of z is lost")
def center_of_mass_above_joint(tree: Element, rng: Random) -> Mutant:
    """Put the center of mass of a shank above its joint."""
    if tree.tag == "mujoco":
        part = rng.choice(named(tree, "body", SHANK))
        origin, key = part.find("inertial"), "pos"
    else:
        part = rng.choice(named(tree, "link", SHANK))
        origin, key = part.find("inertial/origin"), "xyz"
    x, y, z = numbers(origin.get(key))
    origin.set(key, format_numbers((x, y, -z)))
    return of(part)


@DEFECTS("inertia", "quadruped.xml biped.xml", "the inertia of the left part is pasted")
def full_inertia_not_mirror_image(tree: Element, rng: Random) -> Mutant:
    """Give a right thigh the products of inertia of the left one."""
    body = rng.choice(named(tree, "body", "((FR|RR)_thigh|right_hip_yaw_link)$"))
    inertial = body.find("inertial")
    xx, yy, zz, xy, xz, yz = numbers(inertial.get("fullinertia"))
    inertial.set("fullinertia", format_numbers((xx, yy, zz, -xy, xz, -yz)))
    return of(body)


@DEFECTS("inertia", "go2 g1", "SolidWorks' products have the other sign, in all parts")
def all_products_negative(tree: Element, rng: Random) -> Mutant:
    """Negate the products of inertia of all links."""
    for inertia in tree.iter("inertia"):
        multiply(inertia, -1, "ixy", "ixz", "iyz")
    return of(*tree.iter("link"))


@DEFECTS("inertia", "h1.xml g1.xml", "moments are sorted, the rotation is not")
def diagonal_inertia_in_other_order(tree: Element, rng: Random) -> Mutant:
    """Rotate the principal moments of one body among its axes."""
    body = rng.choice(named(tree, "body", "(knee|ankle_roll|ankle)_link$"))
    inertial = body.find("inertial")
    a, b, c = numbers(inertial.get("diaginertia"))
    inertial.set("diaginertia", format_numbers((c, a, b)))
    return of(body)
