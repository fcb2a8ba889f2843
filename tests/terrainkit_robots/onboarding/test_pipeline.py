"""Robots brought in, whole: the bundled ones always, the real ones where they are at hand."""

import shutil
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.compare.kinematics import largest_difference
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.runner import lint
from terrainkit_robots.onboarding.frameworks import frameworks
from terrainkit_robots.onboarding.pipeline import Wishes, bring_in
from terrainkit_robots.onboarding.summary import summary
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.spec.robot_spec import RobotSpec

REAL = [
    "a1/urdf/a1.urdf",
    "go2/urdf/go2.urdf",
    "go2_mjcf/go2.xml",
    "h1/urdf/h1.urdf",
    "h1/h1.xml",
    "g1/g1_29dof.urdf",
    "g1/g1_29dof.xml",
    "anymal_c/urdf/anymal_c.urdf",
]
COMPARED = [rule for rule in rules() if {"against", "spec"} & set(rule.needs)]


def wishes(folder, **more):
    return Wishes(target=folder / "robot", pictures=False, unsafe=True, **more)


@pytest.mark.parametrize("name", REAL)
def test_a_real_robot_is_brought_in(name, robot_file, tmp_path):
    check(robot_file(name), tmp_path)


@pytest.mark.parametrize("name", ["quadruped", "biped"])
@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
def test_a_bundled_robot_is_brought_in(name, suffix, tmp_path):
    check(bundled.find(name).with_suffix(suffix), tmp_path)


def check(file, tmp_path):
    """Bring a robot in, and look at its folder as anybody who gets it would."""
    before = file.read_bytes()
    done = bring_in(file, wishes(tmp_path))
    assert file.read_bytes() == before
    folder = done.folder
    assert done.proof.stood
    assert done.proof.locked == (len(done.made.facts.legs) == 2)
    source = Facts(load_robot(file))
    urdf, mjcf = (load_robot(folder / name) for name in ("robot.urdf", "robot.xml"))
    spec = RobotSpec.load(folder / "robot.toml")
    assert not urdf.problems
    assert not mjcf.problems
    # The two agree with each other and with the spec, as the rules see it,
    report = lint(Facts(urdf, against=Facts(mjcf), spec=spec), COMPARED)
    assert not report.skipped
    assert not [f for f in report.findings if f.severity != "info"], report.findings
    # and with the source: by yourdfpy for the URDF, by MuJoCo for the MJCF.
    for written in (urdf, mjcf):
        seen = largest_difference(source, Facts(written), poses=100)
        assert seen.distance < 1e-4, seen
        if source.total_mass == source.total_mass:  # NaN where MuJoCo takes it from meshes
            assert Facts(written).total_mass == pytest.approx(source.total_mass, rel=1e-3)
    check_scene(folder, done.made.facts, spec)


def check_scene(folder, facts, spec):
    with quiet_mujoco():
        model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    assert [model.actuator(k).name for k in range(model.nu)] == list(spec.joint_order)
    for foot in spec.feet:
        assert model.sensor(f"{foot}_contact").type[0] == mujoco.mjtSensor.mjSENS_TOUCH
        assert model.site(foot).bodyid[0] == model.body(foot).id
    assert model.joint("root").type[0] == mujoco.mjtJoint.mjJNT_FREE
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    height = data.body(facts.bodies[0].top.name).xpos[2]
    assert height == pytest.approx(spec.base_height_target, abs=1e-5)
    # At rest it stands on the floor, and is not inside itself.
    inside = [c.dist for c in data.contact if c.dist < -1e-3]
    assert not inside


def test_the_folder_holds_what_is_promised(tmp_path):
    done = bring_in(bundled.find("quadruped"), wishes(tmp_path, configs=("mjlab", "genesis")))
    assert sorted(path.name for path in done.folder.iterdir()) == [
        "genesis_config.py",
        "mjlab_config.py",
        "report.md",
        "robot.toml",
        "robot.urdf",
        "robot.xml",
        "scene.xml",
    ]
    told = dict(summary(done))
    assert told["stands"].startswith("yes: 5 s with the gains of robot.toml")
    assert told["pictures"] == "none: not wanted"


def test_pictures_are_drawn_where_that_can_be(tmp_path):
    done = bring_in(bundled.find("quadruped"), Wishes(target=tmp_path / "robot"))
    assert done.pictures or done.no_pictures
    for name in done.pictures:
        assert (done.folder / name).read_bytes().startswith(b"\x89PNG")
        assert name in (done.folder / "report.md").read_text()


def test_the_same_robot_gives_the_same_bytes(tmp_path):
    folders = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        done = bring_in(bundled.find("biped"), wishes(tmp_path / name))
        folders.append(done.folder)
    for path in sorted(folders[0].iterdir()):
        assert path.read_bytes() == (folders[1] / path.name).read_bytes(), path.name


def test_what_was_brought_in_can_be_brought_in(tmp_path):
    first = bring_in(bundled.find("quadruped"), wishes(tmp_path))
    for name in ("robot.urdf", "robot.xml"):
        again = bring_in(first.folder / name, Wishes(target=tmp_path / name, pictures=False))
        assert again.proof.stood
        assert again.made.spec.joint_order == first.made.spec.joint_order
        assert again.report.verdict == "pass"


def test_a_spec_that_was_edited_goes_before(tmp_path):
    first = bring_in(bundled.find("quadruped"), wishes(tmp_path))
    text = (first.folder / "robot.toml").read_text()
    assert "FL_thigh_joint = 0." in text
    lines = [
        "FL_thigh_joint = 0.85" if line.startswith("FL_thigh_joint = 0.") and k else line
        for k, line in enumerate(text.splitlines())
    ]
    edited = tmp_path / "mine.toml"
    edited.write_text("\n".join(lines))
    wanted = RobotSpec.load(edited)
    done = bring_in(
        bundled.find("quadruped"),
        Wishes(target=tmp_path / "again", pictures=False, spec=edited),
    )
    made = done.made.spec
    assert replace(made, provenance={}) == replace(wanted, provenance={})
    assert made.provenance["default_pose.FL_thigh_joint"].origin == "given"
    assert made.provenance["default_pose"].origin == "solved"
    model = mujoco.MjModel.from_xml_path(str(done.folder / "robot.xml"))
    joint = model.joint("FL_thigh_joint")
    assert model.key("home").qpos[joint.qposadr[0]] == wanted.default_pose["FL_thigh_joint"]


ARM = """<robot name="arm">
  <link name="stand"><inertial><mass value="5"/>
    <inertia ixx="0.05" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
  <link name="upper"><inertial><origin xyz="0 0 0.15"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.16"/><geometry><box size="0.05 0.05 0.3"/></geometry></collision>
  </link>
  <joint name="shoulder" type="revolute"><parent link="stand"/><child link="upper"/>
    <origin xyz="0 0 0.11"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="30" velocity="3"/></joint>
</robot>"""


def test_feet_may_be_called_by_any_link_that_moves_with_them(tmp_path):
    first = bring_in(bundled.find("quadruped"), wishes(tmp_path))
    text = (first.folder / "robot.toml").read_text()
    wanted = tuple(foot.replace("foot", "calf") for foot in first.made.spec.feet)
    before, after = (
        f"feet = {list(feet)}".replace("'", '"') for feet in (first.made.spec.feet, wanted)
    )
    assert before in text
    edited = tmp_path / "mine.toml"
    edited.write_text(text.replace(before, after))
    done = bring_in(
        bundled.find("quadruped"),
        Wishes(
            target=tmp_path / "again",
            pictures=False,
            spec=edited,
            configs=tuple(frameworks.names()),
        ),
    )
    assert done.made.spec.feet == wanted
    model = mujoco.MjModel.from_xml_path(str(done.folder / "robot.xml"))
    for foot in wanted:
        assert model.site(foot).bodyid[0] == model.body(foot).id


def test_an_arm_is_brought_in_without_legs(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(ARM)
    done = bring_in(file, wishes(tmp_path))
    spec = RobotSpec.load(done.folder / "robot.toml")
    assert (spec.feet, spec.floating, spec.base_height_target) == ((), False, None)
    assert done.proof.standing is None
    assert dict(summary(done))["stands"] == "not asked: it has no legs"
    model = mujoco.MjModel.from_xml_path(str(done.folder / "robot.xml"))
    assert (model.nq, model.nu) == (1, 1)


def test_an_arm_gets_no_configuration_for_legs(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(ARM)
    with pytest.raises(ConfigError, match="no legs"):
        bring_in(file, wishes(tmp_path, configs=("legged_gym",)))
    assert not (tmp_path / "robot").exists()


def test_errors_of_the_robot_keep_it_out(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(ARM.replace('mass value="1"', 'mass value="-1"'))
    done = bring_in(file, wishes(tmp_path))
    assert done.folder is None
    assert done.report.verdict == "fail"
    assert not (tmp_path / "robot").exists()


def test_errors_of_training_do_not(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(ARM.replace('lower="-1.5" upper="1.5" ', ""))
    done = bring_in(file, wishes(tmp_path))
    assert done.folder is not None
    assert {f.code for f in done.report.findings if f.severity == "error"} == {"JNT006"}
    assert any("shoulder has no limits" in note for note in done.made.notes)


def test_what_mujoco_refuses_is_one_line_even_if_forced(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(ARM.replace('izz="0.001"', 'izz="1"'))
    with pytest.raises(Exception, match="A \\+ B >= C") as error:
        bring_in(file, Wishes(target=tmp_path / "robot", force=True, pictures=False))
    assert "\n" not in str(error.value)
    assert not (tmp_path / "robot").exists()


def test_what_cannot_be_simulated_is_one_line(tmp_path, monkeypatch):
    def refuse(_facts):
        raise CannotCheckError("it is too much")

    monkeypatch.setattr("terrainkit_robots.simulation.pd_gains.suggest_gains", refuse)
    with pytest.raises(ExportError, match="no gains can be suggested: it is too much"):
        bring_in(bundled.find("quadruped"), wishes(tmp_path))


def test_what_takes_too_long_to_stand_is_written_and_told(tmp_path, monkeypatch):
    def refuse(*_arguments, **_more):
        raise CannotCheckError("300 contacts at once")

    monkeypatch.setattr("terrainkit_robots.simulation.standing.stand_still", refuse)
    done = bring_in(bundled.find("quadruped"), wishes(tmp_path))
    assert not done.proof.stood
    assert dict(summary(done))["stands"] == "not known: 300 contacts at once"
    assert "It was not simulated: 300 contacts at once." in (done.folder / "report.md").read_text()


def test_a_mesh_of_another_format_is_converted_wherever_it_is(tmp_path):
    import trimesh

    trimesh.creation.box((0.05, 0.05, 0.3)).export(tmp_path / "upper.ply")
    folder = tmp_path / "robots" / "arm"
    folder.mkdir(parents=True)
    file = folder / "arm.urdf"
    mesh = '<mesh filename="../../upper.ply"/></geometry></collision></link>\n  <joint'
    before, after = ARM.split('<box size="0.05 0.05 0.3"/>')
    file.write_text(before + mesh + after.split("<joint", 1)[1])
    done = bring_in(file, Wishes(target=tmp_path / "robot", pictures=False))
    assert "MSH005" in {f.code for f in done.repaired}
    assert done.report.verdict != "fail"
    assert (done.folder / "meshes/upper.stl").exists()


def test_repairs_are_made_in_what_is_written_only(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(ARM.replace('axis xyz="0 1 0"', 'axis xyz="0 2 0"'))
    done = bring_in(file, wishes(tmp_path))
    assert [f.code for f in done.repaired] == ["JNT005"]
    assert 'axis xyz="0 2 0"' in file.read_text()
    assert 'axis xyz="0 1 0"' in (done.folder / "robot.urdf").read_text()


@pytest.mark.parametrize("suffix", ["urdf", "xacro"])
def test_a_quaternion_is_written_as_everyone_reads_it(tmp_path, suffix):
    file = tmp_path / f"arm.{suffix}"
    file.write_text(ARM.replace('xyz="0 0 0.11"', 'xyz="0 0 0.11" quat_xyzw="0 0 1 1"'))
    done = bring_in(file, wishes(tmp_path))
    assert [f.code for f in done.repaired] == ["XML014"]
    assert done.proof is not None
    assert 'rpy="0 0 1.570796327"' in (done.folder / "robot.urdf").read_text()
    turned = mujoco.MjModel.from_xml_path(str(done.folder / "robot.urdf")).body_quat
    np.testing.assert_allclose(turned[-1], [0.5**0.5, 0, 0, 0.5**0.5], atol=1e-9)


def test_a_folder_that_is_there_is_left_alone(tmp_path):
    bring_in(bundled.find("quadruped"), wishes(tmp_path))
    spec = tmp_path / "robot/robot.toml"
    spec.write_text("mine")
    with pytest.raises(ExportError, match="exists"):
        bring_in(bundled.find("quadruped"), wishes(tmp_path))
    assert spec.read_text() == "mine"


def test_a_robot_with_meshes_is_whole_wherever_its_folder_goes(robot_file, tmp_path):
    done = bring_in(robot_file("a1/urdf/a1.urdf"), wishes(tmp_path))
    moved = tmp_path / "elsewhere"
    shutil.move(done.folder, moved)
    for name in ("robot.urdf", "robot.xml", "scene.xml"):
        with quiet_mujoco():
            model = mujoco.MjModel.from_xml_path(str(moved / name))
        assert np.isclose(model.body_mass.sum(), done.made.facts.total_mass, rtol=1e-3), name


def test_what_is_odd_about_a_spec_is_noted(tmp_path):
    first = bring_in(bundled.find("quadruped"), wishes(tmp_path))
    text = (first.folder / "robot.toml").read_text()
    assert "base_height_target = 0.33" in text
    edited = tmp_path / "mine.toml"
    edited.write_text(text.replace("base_height_target = 0.33", "base_height_target = 0.23"))
    done = bring_in(
        bundled.find("quadruped"),
        Wishes(target=tmp_path / "again", pictures=False, spec=edited),
    )
    assert any("LEG009" in note for note in done.made.notes)
