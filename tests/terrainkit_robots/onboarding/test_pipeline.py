"""Tests of onboarding."""

import re
import shutil
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from terrainkit.errors import ExportError, TerrainkitError
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.lint.compare.pose_differences import compare_link_poses
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.runner import lint
from terrainkit_robots.onboarding.frameworks.frameworks import framework_names
from terrainkit_robots.onboarding.onboard_options import OnboardOptions
from terrainkit_robots.onboarding.pipeline import onboard
from terrainkit_robots.onboarding.statements import summarize
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.spec.robot_spec import RobotSpec
from tests.robots import ARM, BUNDLED, QUADRUPED
from tests.small_robots import box, joint, link

COMPARISON_RULES = [rule for rule in rules() if {"against", "spec"} & set(rule.needs)]


def options(**changes):
    return OnboardOptions(**{"render_images": False, "unsafe_fixes": True} | changes)


@pytest.mark.parametrize("name", [*BUNDLED, "tilted.urdf"])
def test_folder_of_robot_is_consistent(name, robot_file, onboarded):
    check_folder(robot_file(name), onboarded)


def check_folder(file, onboarded):
    """Onboard a robot, and check its folder independently."""
    before = file.read_bytes()
    result = onboarded(file)
    assert file.read_bytes() == before
    folder, facts = result.folder, result.robot.facts
    assert result.verification.is_stable
    assert result.verification.joints_locked == (len(facts.legs) == 2)
    source = Facts(load_robot(file))
    urdf, mjcf = (load_robot(folder / name) for name in ("robot.urdf", "robot.xml"))
    spec = RobotSpec.load(folder / "robot.toml")
    assert not urdf.problems
    assert not mjcf.problems
    # The two files are consistent with each other and with the spec.
    report = lint(Facts(urdf, against=Facts(mjcf), spec=spec), COMPARISON_RULES)
    assert not report.skipped
    assert not [f for f in report.findings if f.severity != "note"], report.findings
    # They match the source.
    for written in (urdf, mjcf):
        difference = compare_link_poses(source, Facts(written), poses=100)
        assert difference.distance < 1e-4, difference
        if source.total_mass == source.total_mass:  # NaN where MuJoCo computes it from meshes
            assert Facts(written).total_mass == pytest.approx(source.total_mass, rel=1e-3)
    check_scene(folder, facts, spec)


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
    penetrations = [c.dist for c in data.contact if c.dist < -1e-3]
    assert not penetrations


def test_onboard_writes_expected_files(onboarded):
    result = onboarded(QUADRUPED)
    configs = "genesis_config.py isaaclab_config.py legged_gym_config.py mjlab_config.py"
    robot = "__init__.py quadruped.py quadruped_config.py robot.toml robot.urdf robot.xml scene.xml"
    names = {path.name for path in result.folder.iterdir()}
    assert names == {*configs.split(), *robot.split(), "report.md"}
    assert dict(summarize(result))["pictures"] == "none: disabled"


def test_onboard_renders_pictures(tmp_path):
    result = onboard(QUADRUPED, tmp_path / "robot")
    report = (result.folder / "report.md").read_text()
    assert result.images or result.images_error
    for name in result.images:
        assert (result.folder / name).read_bytes().startswith(b"\x89PNG")
        assert name in report


def test_onboard_is_deterministic(onboarded, tmp_path):
    first = onboarded(QUADRUPED).folder
    second = onboard(QUADRUPED, tmp_path / "robot", options(frameworks=framework_names())).folder
    for path in sorted(first.iterdir()):
        assert path.read_bytes() == (second / path.name).read_bytes(), path.name


def test_onboard_accepts_its_own_output(onboarded, tmp_path):
    first = onboarded(QUADRUPED)
    for name in ("robot.urdf", "robot.xml"):
        again = onboard(first.folder / name, tmp_path / name, OnboardOptions(render_images=False))
        assert again.verification.is_stable
        assert again.robot.spec.joint_order == first.robot.spec.joint_order
        assert again.report.verdict == "pass"


def edit_spec(result, tmp_path, *replacements):
    """Return a robot.toml with texts replaced."""
    text = (result.folder / "robot.toml").read_text()
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    edited = tmp_path / "edited.toml"
    edited.write_text(text)
    return edited


def test_onboard_applies_edited_spec(onboarded, tmp_path):
    first = onboarded(QUADRUPED)
    feet = tuple(foot.replace("foot", "calf") for foot in first.robot.spec.feet)
    edited = edit_spec(
        first,
        tmp_path,
        ('".*_thigh_joint" = 0.75', '"F.*_thigh_joint" = 0.85\n"R.*_thigh_joint" = 0.75'),
        *zip(first.robot.spec.feet, feet, strict=True),
    )
    changed = options(spec=edited, frameworks=framework_names())
    result = onboard(QUADRUPED, tmp_path / "robot", changed)
    spec = result.robot.spec
    assert spec.feet == feet
    assert replace(spec, provenance={}) == replace(RobotSpec.load(edited), provenance={})
    assert spec.provenance["default_pose.F.*_thigh_joint"].origin == "given"
    assert "default_pose.R.*_thigh_joint" not in spec.provenance
    assert spec.provenance["default_pose"].origin == "solved"
    model = read_mujoco(result)
    assert model.key("home").qpos[model.joint("FL_thigh_joint").qposadr[0]] == 0.85
    for foot in feet:
        assert model.site(foot).bodyid[0] == model.body(foot).id


def test_onboard_notes_warnings_of_spec(onboarded, tmp_path):
    heights = ("base_height_target = 0.33", "base_height_target = 0.23")
    edited = edit_spec(onboarded(QUADRUPED), tmp_path, heights)
    result = onboard(QUADRUPED, tmp_path / "robot", options(spec=edited))
    assert any("LEG009" in change for change in result.robot.changes)


def onboard_arm(tmp_path, *replacements, **changes):
    """Onboard an arm with texts replaced in its URDF."""
    text = ARM
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "arm.urdf").write_text(text)
    return onboard(tmp_path / "arm.urdf", tmp_path / "robot", options(**changes))


def read_mujoco(result, name="robot.xml"):
    with quiet_mujoco():
        return mujoco.MjModel.from_xml_path(str(result.folder / name))


def codes(findings):
    return [finding.code for finding in findings]


def test_onboard_reads_but_does_not_write_name_that_is_not_utf8(tmp_path):
    file = tmp_path / "\udcff.urdf"
    file.write_text(ARM)
    assert onboard(file, tmp_path / "robot", options()).folder == tmp_path / "robot"
    with pytest.raises(ExportError, match="its name is not UTF-8"):
        onboard(file, tmp_path / "\udcff", options())


def test_onboard_arm_without_legs(tmp_path):
    result = onboard_arm(tmp_path, frameworks=("legged_gym", "isaaclab"))
    spec = RobotSpec.load(result.folder / "robot.toml")
    assert (spec.feet, spec.floating, spec.base_height_target) == ((), False, None)
    assert result.verification.standing is None
    assert result.configs == {"isaaclab": ("isaaclab_config.py",)}
    assert "no legs" in result.skipped_configs["legged_gym"]
    assert not (result.folder / "legged_gym_config.py").exists()
    model = read_mujoco(result)
    assert (model.nq, model.nu) == (1, 1)


def with_imu(tmp_path, inertia, **changes):
    """Onboard an arm with a sensor of 1 g."""
    imu = link("imu", mass=1e-3, inertia=inertia)
    imu += joint("upper", "imu", "0 0 0.3", kind="fixed") + "</robot>"
    return onboard_arm(tmp_path, ("</robot>", imu), **changes)


def test_onboard_repairs_only_negligible_inertia(tmp_path):
    """Three equal products: two principal moments are 0."""
    large, small = (" ".join([value] * 6) for value in ("1e-3", "1e-6"))
    assert with_imu(tmp_path, large, unsafe_fixes=False).folder is None
    result = with_imu(tmp_path, small, unsafe_fixes=False)
    assert [(f.code, f.subject) for f in result.fixed] == [("INR003", "imu")]
    assert "the inertia of body upper changes by" in (result.folder / "report.md").read_text()


def test_onboard_keeps_frame_named_imu(tmp_path):
    model = read_mujoco(with_imu(tmp_path, "1e-6 1e-6 1e-6 0 0 0"))
    np.testing.assert_allclose(model.site("imu").pos, [0, 0, 0.3], atol=1e-9)
    assert model.site("imu").bodyid[0] == model.body("upper").id


def test_onboard_accepts_links_without_inertial(tmp_path):
    cover = link("cover", box("0.1 0.1 0.1"), mass=None)
    cover += joint("stand", "cover", "0.15 0 0", kind="fixed")
    result = onboard_arm(tmp_path, ("</robot>", cover + "</robot>"))
    assert codes(result.fixed) == ["INR011"]
    model = read_mujoco(result, "robot.urdf")
    assert model.body_mass.sum() == pytest.approx(6, rel=1e-3)


def test_onboard_stops_only_at_blocking_errors(tmp_path):
    result = onboard_arm(tmp_path, ('mass value="1"', 'mass value="-1"'))
    assert (result.folder, result.report.verdict) == (None, "fail")
    assert not (tmp_path / "robot").exists()
    result = onboard_arm(tmp_path, ('lower="-1.5" upper="1.5" ', ""))
    assert result.folder == tmp_path / "robot"
    assert codes(f for f in result.report.findings if f.severity == "error") == ["JNT006"]
    assert any("shoulder has no limits" in change for change in result.robot.changes)


def test_onboard_reports_mujoco_error_in_one_line(tmp_path):
    with pytest.raises(TerrainkitError, match=r"A \+ B >= C") as error:
        onboard_arm(tmp_path, ('izz="0.001"', 'izz="1"'), unsafe_fixes=False, force=True)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "robot").exists()


def cannot_check(reason):
    """Return a function that raises an error."""

    def fail(*_, **__):
        raise CannotCheckError(reason)

    return fail


def test_onboard_reports_failed_gain_derivation(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "terrainkit_robots.simulation.declared_gains.suggest_gains", cannot_check("why")
    )
    with pytest.raises(ExportError, match="cannot derive PD gains: why"):
        onboard(QUADRUPED, tmp_path / "robot", options())


def test_onboard_reports_failed_standing_test(tmp_path, monkeypatch):
    monkeypatch.setattr("terrainkit_robots.onboarding.verify.stand_test", cannot_check("why"))
    result = onboard(QUADRUPED, tmp_path / "robot", options())
    checks = result.verification
    assert (checks.standing, checks.is_stable) == (None, False)
    assert checks.failures == ("it could not be simulated: why",)
    assert [each.file for each in checks.comparisons] == ["robot.urdf", "robot.xml"]
    assert "Not simulated: why." in (result.folder / "report.md").read_text()


@pytest.mark.parametrize(
    ("written", "named", "code"),
    [("upper.ply", "upper.ply", "MSH005"), ("assets/upper.stl", "meshes/upper.stl", "MSH001")],
    ids=["other format", "other folder"],
)
def test_onboarded_folder_has_its_own_meshes(tmp_path, written, named, code):
    import trimesh

    (tmp_path / "assets").mkdir()
    trimesh.creation.box((0.05, 0.05, 0.3)).export(tmp_path / written)
    mesh = ('<box size="0.05 0.05 0.3"/>', f'<mesh filename="{named}"/>')
    result = onboard_arm(tmp_path, mesh, unsafe_fixes=False)
    assert code in codes(result.fixed)
    (tmp_path / written).unlink()
    shutil.move(result.folder, tmp_path / "elsewhere")
    for name in ("robot.urdf", "robot.xml", "scene.xml"):
        model = read_mujoco(replace(result, folder=tmp_path / "elsewhere"), name)
        assert (model.nmesh, model.nq) == (1, 1)


@pytest.mark.parametrize(
    ("suffix", "old", "new", "code", "written"),
    [
        ("urdf", 'axis xyz="0 1 0"', 'axis xyz="0 2 0"', "JNT005", 'axis xyz="0 1 0"'),
        ("urdf", "0 0.11", '0 0.11" quat_xyzw="0 0 1 1', "XML014", 'rpy="0 0 1.570796327"'),
        ("xacro", "0 0.11", '0 0.11" quat_xyzw="0 0 1 1', "XML014", 'rpy="0 0 1.570796327"'),
    ],
)
def test_onboard_fixes_written_files_only(tmp_path, suffix, old, new, code, written):
    file = tmp_path / f"arm.{suffix}"
    file.write_text(ARM.replace(old, new))
    result = onboard(file, tmp_path / "robot", options())
    assert codes(result.fixed) == [code]
    assert file.read_text() == ARM.replace(old, new) != ARM
    assert written in (result.folder / "robot.urdf").read_text()
    quat = [0.5**0.5, 0, 0, 0.5**0.5] if "quat" in new else [1, 0, 0, 0]
    np.testing.assert_allclose(read_mujoco(result, "robot.urdf").body_quat[-1], quat, atol=1e-9)


def test_onboard_replaces_crouching_keyframe(tmp_path):
    file = tmp_path / "quadruped.xml"
    text = QUADRUPED.with_suffix(".xml").read_text()
    file.write_text(text.replace("0 0.9 -1.8", "0 2.6 -2.6"))
    result = onboard(file, tmp_path / "robot", options())
    assert result.robot.spec.provenance["default_pose"].origin == "solved"
    assert result.verification.is_stable
    assert any("keyframe is not the default pose" in change for change in result.robot.changes)


def test_biped_on_points_is_not_expected_to_stand(tmp_path):
    file = tmp_path / "biped.urdf"
    file.write_text(
        bundled.urdf_path("biped").read_text().replace("0.18 0.066 0.03", "0.004 0.004 0.03")
    )
    checks = onboard(file, tmp_path / "robot", options()).verification
    assert checks.skipped == "the center of mass of the biped is not above its feet"
    assert checks.standing is None
    assert checks.is_stable


def test_onboard_training_gains(onboarded, tmp_path):
    stiff = onboarded(QUADRUPED)
    result = onboard(QUADRUPED, tmp_path / "robot", options(gains="train"))
    assert result.robot.spec.stiffness == {".*": 20.0}
    assert result.robot.spec.action_scale == {".*": 0.25}
    checks = result.verification
    assert checks.is_stable
    assert checks.stand_gains
    assert checks.standing == stiff.verification.standing
    assert checks.free_standing != checks.standing
    assert "with suggested gains" in dict(summarize(result))["standing"]
    assert "with suggested gains" in (result.folder / "report.md").read_text()


def test_onboard_uses_declared_gains(tmp_path):
    servo = r'<position \1 kp="35" kv="0.9" forcerange="-23.7 23.7"/>'
    text = QUADRUPED.with_suffix(".xml").read_text()
    file = tmp_path / "quadruped.xml"
    file.write_text(re.sub(r'<motor (name="\w+" joint="\w+") class="\w+"/>', servo, text))
    result = onboard(file, tmp_path / "robot", options())
    spec = result.robot.spec
    assert (spec.stiffness, spec.damping) == ({".*": 35.0}, {".*": 0.9})
    assert spec.provenance["stiffness"].origin == "declared"
    assert result.verification.stand_gains
    assert "| 35, 0.9 | 60, 2 |" in (result.folder / "report.md").read_text()


def test_onboard_biped_reports_free_standing(onboarded):
    result = onboarded(bundled.urdf_path("biped"))
    assert dict(summarize(result))["free"].startswith("no, a policy has to balance it: ")
    assert "With free joints: no, a policy has to" in (result.folder / "report.md").read_text()


def test_onboard_replaces_placeholder_efforts(tmp_path):
    file = tmp_path / "quadruped.urdf"
    file.write_text(QUADRUPED.read_text().replace('effort="23.7"', 'effort="1000"'))
    result = onboard(file, tmp_path / "robot", options())
    effort = result.robot.spec.per_joint("effort")
    assert effort["FL_hip_joint"] == 33.0
    assert effort["FL_calf_joint"] == 45.43
    assert "x weight x leg length" in str(result.robot.spec.provenance)
    assert any("is a placeholder (1000 N m)" in change for change in result.robot.changes)
    model = read_mujoco(result)
    assert model.actuator_forcerange[0, 1] == 33.0
