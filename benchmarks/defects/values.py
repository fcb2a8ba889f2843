"""Defects of values that are valid but implausible: units, losses, options and copies."""

from lxml import etree

from defects.mutant import (
    Mutant,
    NotApplicableError,
    Subjects,
    child,
    limit,
    mirror_names,
    mutation,
    origin,
    parent,
)


@mutation("XML018", "warning", "rotation in degrees")
def rotation_in_degrees(robot: Mutant) -> Subjects:
    link = robot.pick(robot.links("collision"))
    origin(link.find("collision")).set("rpy", robot.pick(["90 0 0", "0 -90 0", "0 0 45"]))
    return [link.get("name")]


@mutation("JNT018", "warning", "limits converted to radians twice")
def narrow_limits(robot: Mutant) -> Subjects:
    for joint in robot.leg_joints():
        for name in ("lower", "upper"):
            limit(joint).set(name, f"{float(limit(joint).get(name)) / 57.29578:.6g}")
    return ()


@mutation("JNT020", "error", "negative damping or friction")
def negative_loss(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    _dynamics(joint).set(robot.pick(["damping", "friction"]), "-0.5")
    return [joint.get("name")]


@mutation("JNT021", "warning", "friction above the effort")
def friction(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    _dynamics(joint).set("friction", f"{1.5 * float(limit(joint).get('effort')):g}")
    return [joint.get("name")]


@mutation("JNT022", "warning", "gain as damping")
def damping(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.actuated_joints())
    _dynamics(joint).set("damping", "2000")
    return [joint.get("name")]


def _dynamics(joint: etree._Element) -> etree._Element:
    element = joint.find("dynamics")
    return etree.SubElement(joint, "dynamics") if element is None else element


@mutation("COL009 COL010 SYM013", "warning", "shifted collision shape")
def shifted_collision(robot: Mutant) -> Subjects:
    link = robot.pick(link for link in robot.leg_links() if link.find("collision") is not None)
    origin(link.find("collision")).set("xyz", "0 0 0.25")
    return [name for part in robot.body_names(link.get("name")) for name in mirror_names(part)]


@mutation("SYM012", "warning", "mimic on one side")
def mimic(robot: Mutant) -> Subjects:
    joint, other = robot.rng.sample(robot.leg_joints(), 2)
    if other.get("name") in mirror_names(joint.get("name")):
        raise NotApplicableError
    etree.SubElement(joint, "mimic", joint=other.get("name"))
    return mirror_names(joint.get("name"))


def _option(robot: Mutant) -> etree._Element:
    element = robot.root.find("option")
    if element is None:
        element = etree.Element("option")
        robot.root.insert(1, element)
    return element


@mutation("OPT001", "error", "MJCF: wrong gravity", "mjcf")
def gravity(robot: Mutant) -> Subjects:
    _option(robot).set("gravity", robot.pick(["0 0 0", "0 0 9.81", "0 -9.81 0"]))
    return ()


@mutation("OPT002", "warning", "MJCF: long time step", "mjcf")
def time_step(robot: Mutant) -> Subjects:
    _option(robot).set("timestep", robot.pick(["0.02", "0.05", "1"]))
    return ()


@mutation("OPT003", "warning", "MJCF: disabled physics", "mjcf")
def disabled(robot: Mutant) -> Subjects:
    option = _option(robot)
    flag = option.find("flag")
    flag = etree.SubElement(option, "flag") if flag is None else flag
    flag.set(robot.pick(["contact", "constraint", "limit", "actuation"]), "disable")
    return ()


@mutation("JNT024", "error", "MJCF: gear of zero", "mjcf")
def zero_gear(robot: Mutant) -> Subjects:
    motor = robot.pick(robot.root.iterfind("actuator/motor"))
    motor.set("gear", "0")
    return [motor.get("joint")]


@mutation("JNT019 JNT008 SYM004", "warning", "limits shifted by a turn")
def shifted_limits(robot: Mutant) -> Subjects:
    joint = robot.pick(robot.leg_joints())
    for name in ("lower", "upper"):
        limit(joint).set(name, f"{float(limit(joint).get(name)) + 6.283185:.6g}")
    return mirror_names(joint.get("name"))


@mutation("JNT026 JNT011", "warning", "efforts in kg cm")
def large_efforts(robot: Mutant) -> Subjects:
    for joint in robot.leg_joints():
        limit(joint).set("effort", f"{10.2 * float(limit(joint).get('effort')):.5g}")
    return ()


@mutation("JNT027", "warning", "velocity converted from degrees twice")
def low_velocities(robot: Mutant) -> Subjects:
    for joint in robot.leg_joints():
        limit(joint).set("velocity", f"{float(limit(joint).get('velocity')) / 3282.8:.4g}")
    return ()


@mutation("JNT022", "warning", "damping per degree")
def damping_per_degree(robot: Mutant) -> Subjects:
    for joint in robot.leg_joints():
        _dynamics(joint).set("damping", "5.73")
    return ()


@mutation("SYM009", "warning", "damping of one joint")
def one_damping(robot: Mutant) -> Subjects:
    for joint in robot.leg_joints():
        _dynamics(joint).set("damping", "0.1")
    joint = robot.pick(robot.leg_joints())
    _dynamics(joint).set("damping", f"{0.03 * float(limit(joint).get('effort')):.4g}")
    return mirror_names(joint.get("name"))


@mutation("COL009 SYM013", "warning", "diameter as radius")
def diameter(robot: Mutant) -> Subjects:
    link, shape = robot.pick(
        (link, shape)
        for link in robot.links("collision/geometry")
        for tag in ("cylinder", "sphere")
        for shape in link.iterfind(f"collision/geometry/{tag}")
        if link in robot.leg_links()
    )
    shape.set("radius", f"{2 * float(shape.get('radius')):.6g}")
    return [name for part in robot.body_names(link.get("name")) for name in mirror_names(part)]


@mutation("MSH016 MSH015 COL009 SYM013", "warning", "mesh of the other side")
def other_mesh(robot: Mutant) -> Subjects:
    meshes = {e.get("name"): e.find("visual/geometry/mesh") for e in robot.leg_links()}
    names = [
        name
        for name, mesh in meshes.items()
        if mesh is not None and len(mirror_names(name)) == 2
        if (other := meshes.get(mirror_names(name)[1])) is not None
        if other.get("filename") != mesh.get("filename")
    ]
    name = robot.pick(names)
    meshes[name].set("filename", meshes[mirror_names(name)[1]].get("filename"))
    return [name]


@mutation("MSH016 MSH015 SYM013", "warning", "mesh of another joint")
def mesh_of_calf(robot: Mutant) -> Subjects:
    calves = [robot.link(child(joint)) for joint in robot.knee_joints()]
    meshes = [m for calf in calves if (m := calf.find("visual/geometry/mesh")) is not None]
    link = robot.pick(e for e in robot.leg_links() if e not in calves)
    mesh = link.find("visual/geometry/mesh")
    if len(meshes) < 4 or mesh is None:
        raise NotApplicableError
    mesh.set("filename", meshes[0].get("filename"))
    return robot.body_names(link.get("name"))


@mutation("TRE011", "warning", "parent of another leg")
def crossed_parent(robot: Mutant) -> Subjects:
    joint = robot.pick(j for j in robot.leg_joints() if len(mirror_names(parent(j))) == 2)
    joint.find("parent").set("link", mirror_names(parent(joint))[1])
    return [joint.get("name")]


@mutation("INR012 SYM011 SYM003", "warning", "exchanged moments of inertia")
def exchanged_moments(robot: Mutant) -> Subjects:
    def moments(link: etree._Element) -> tuple[float, float]:
        element = link.find("inertial/inertia")
        return float(element.get("ixx")), float(element.get("izz"))

    link = robot.pick(link for link in robot.leg_links() if moments(link)[0] > 2 * moments(link)[1])
    ixx, izz = moments(link)
    link.find("inertial/inertia").set("ixx", f"{izz:g}")
    link.find("inertial/inertia").set("izz", f"{ixx:g}")
    return [name for part in robot.body_names(link.get("name")) for name in mirror_names(part)]


@mutation("SYM011", "warning", "products of inertia with the wrong sign")
def product_sign(robot: Mutant) -> Subjects:
    def products(link: etree._Element) -> tuple[float, float]:
        element = link.find("inertial/inertia")
        largest = max(float(element.get(name)) for name in ("ixx", "iyy", "izz"))
        share = max(abs(float(element.get(name))) for name in ("ixy", "iyz")) / largest
        return share, float(link.find("inertial/mass").get("value"))

    link = robot.pick(
        link
        for link in robot.leg_links()
        if products(link)[0] > 0.08
        and products(link)[1] > 0.7 * robot.facts.body_of[link.get("name")].mass
    )
    for name in ("ixy", "iyz"):
        element = link.find("inertial/inertia")
        element.set(name, f"{-float(element.get(name)):g}")
    return [name for part in robot.body_names(link.get("name")) for name in mirror_names(part)]


@mutation("JNT023", "warning", "MJCF: armature of the wrong unit", "mjcf")
def armature(robot: Mutant) -> Subjects:
    for joint in robot.root.iter("joint"):
        joint.set("armature", "20")
    return ()


@mutation("JNT025", "warning", "MJCF: one-sided control range", "mjcf")
def one_sided(robot: Mutant) -> Subjects:
    motor = robot.pick(robot.root.iterfind("actuator/motor"))
    motor.set("ctrlrange", robot.pick(["0 20", "-20 0", "-20 2"]))
    return [motor.get("joint")]


@mutation("JNT026", "warning", "MJCF: gear on a torque", "mjcf")
def geared_torque(robot: Mutant) -> Subjects:
    if any(joint.get("actuatorfrcrange") for joint in robot.root.iter("joint")):
        raise NotApplicableError  # the joint limits the torque
    for motor in robot.root.iterfind("actuator/motor"):
        motor.set("gear", "10")
    return ()


@mutation("JNT028", "warning", "MJCF: position actuators without a gain", "mjcf")
def no_gain(robot: Mutant) -> Subjects:
    for motor in robot.root.iterfind("actuator/motor"):
        motor.tag = "position"
        motor.attrib.pop("class", None)
        motor.set("ctrlrange", "-3 3")
    return ()


@mutation("NAM005", "warning", "MJCF: motors that drive each other's joints", "mjcf")
def exchanged_motors(robot: Mutant) -> Subjects:
    motors = {m.get("joint"): m for m in robot.root.iterfind("actuator/motor")}
    name = robot.pick(n for n in motors if len(mirror_names(n)) == 2)
    other = mirror_names(name)[1]
    motors[name].set("joint", other)
    motors[other].set("joint", name)
    return [name, other]


@mutation("SYM010", "warning", "MJCF: inverted gear", "mjcf")
def gear_sign(robot: Mutant) -> Subjects:
    motors = robot.root.iterfind("actuator/motor")
    motor = robot.pick(motor for motor in motors if len(mirror_names(motor.get("joint"))) == 2)
    motor.set("gear", "-1")
    return mirror_names(motor.get("joint"))


@mutation("COL008", "warning", "MJCF: feet without friction", "mjcf")
def slippery(robot: Mutant) -> Subjects:
    for geom in robot.root.iter("geom"):
        if geom.get("class") != "visual" and geom.get("contype") != "0":
            geom.set("condim", "1")
            geom.set("priority", "1")
    return ()


@mutation("SYM013 COL009", "warning", "MJCF: full size instead of half size", "mjcf")
def full_size(robot: Mutant) -> Subjects:
    body, geom = robot.pick(
        (body, geom)
        for body in robot.root.iter("body")
        for geom in body.findall("geom")
        if geom.get("type") in ("box", "cylinder", "capsule") and geom.get("class") != "visual"
        if geom.get("size") and len(mirror_names(body.get("name"))) == 2
        if geom.get("contype") != "0"
    )
    geom.set("size", " ".join(f"{2 * float(word):g}" for word in geom.get("size").split()))
    return mirror_names(body.get("name"))
