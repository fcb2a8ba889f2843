import logging
import os
import struct
from pathlib import Path

import pytest

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.simulator_conventions.loading import (
    NotAttemptedError,
    mujoco_load_error,
    yourdfpy_load_error,
)
from terrainkit_robots.description import bundled
from terrainkit_robots.description.load import load_robot

BODY = '<body><freejoint/><geom size="0.1"/></body>'


def load_in_mujoco(facts):
    return mujoco_load_error(facts.model)


def load_in_yourdfpy(facts):
    return yourdfpy_load_error(facts.model, facts.tree)


def facts_of(folder, text, name="robot.xml"):
    path = folder / name
    path.write_text(text)
    return Facts(load_robot(path))


@pytest.mark.parametrize("name", ["quadruped", "biped"])
def test_load_errors_of_bundled_robots_are_none(name):
    for suffix in (".urdf", ".xml"):
        facts = Facts(load_robot(bundled.urdf_path(name).with_suffix(suffix)))
        assert mujoco_load_error(facts.model) is None
    assert load_in_yourdfpy(Facts(load_robot(bundled.urdf_path(name)))) is None


def test_mujoco_load_error_names_element(tmp_path):
    text = bundled.urdf_path("quadruped").read_text().replace('ixx="', 'ixx="9', 1)
    refusal = mujoco_load_error(facts_of(tmp_path, text, "robot.urdf").model)
    assert refusal.message == "inertia must satisfy A + B >= C; use 'balanceinertia' to fix"
    assert refusal.element == "base"


def test_mujoco_load_error_has_no_line_with_repeated_shape_names(tmp_path):
    shape = '<collision name="c"><geometry><sphere radius="1"/></geometry></collision>'
    text = (
        f'<?xml version="1.0"?>\n<!-- a robot -->\n<robot name="r"><link name="a">{shape}{shape}'
        '</link><link name="b"/>\n<joint name="j" type="hinge"><parent link="a"/><child link="b"/>'
        "</joint></robot>"
    )
    refusal = mujoco_load_error(facts_of(tmp_path, text, "r.urdf").model)
    assert refusal.message == "invalid joint type in URDF joint definition"
    assert refusal.line == 0  # MuJoCo reads another text


@pytest.mark.parametrize("with_meshes", [True, False])
def test_mujoco_load_error_has_line_of_urdf(tmp_path, with_meshes):
    text = (
        bundled.urdf_path("quadruped").read_text().replace("<inertial>", "<inertial/><inertial>", 1)
    )
    text = text.replace("</robot>", '<gazebo><plugin filename="p.so"/></gazebo></robot>')
    refusal = mujoco_load_error(facts_of(tmp_path, text, "r.urdf").model, with_meshes=with_meshes)
    assert refusal.message == "repeated element: 'inertial'"
    line = text[: text.index("<inertial>")].count("\n") + 1
    assert refusal.line == (line if with_meshes else 0)


def test_mujoco_load_error_without_meshes(tmp_path):
    mesh = '<mesh filename="package://lost/lost.dae" scale="1 1 1"/>'
    text = (
        '<robot name="r"><mujoco><compiler meshdir="x"/></mujoco><link name="a"><collision>'
        f"<geometry>{mesh}</geometry></collision></link></robot>"
    )
    model = facts_of(tmp_path, text, "r.urdf").model
    assert "Error opening file" in mujoco_load_error(model).message
    assert mujoco_load_error(model, with_meshes=False) is None
    with pytest.raises(NotAttemptedError, match="only URDF"):
        mujoco_load_error(facts_of(tmp_path, f"<mujoco>{BODY}</mujoco>").model, with_meshes=False)


def test_yourdfpy_keeps_its_level_of_logging(tmp_path, monkeypatch):
    log = logging.getLogger("yourdfpy")
    monkeypatch.setattr(log, "level", logging.DEBUG)
    load_in_yourdfpy(facts_of(tmp_path, '<robot name="r"><link name="a"/></robot>', "robot.urdf"))
    assert log.level == logging.DEBUG


def test_yourdfpy_load_error_is_one_line(tmp_path):
    text = (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute"/></robot>'
    )
    refusal = load_in_yourdfpy(facts_of(tmp_path, text, "robot.urdf"))
    assert refusal is not None
    assert len(refusal.message.splitlines()) == 1


@pytest.mark.parametrize(
    ("inside", "why"),
    [
        ('<worldbody><replicate count="9"><body/></replicate></worldbody>', "<replicate>"),
        (
            '<worldbody><body><composite type="cable" count="9 1 1"/></body></worldbody>',
            "<composite>",
        ),
        ('<extension><plugin plugin="mujoco.pid"/></extension>', "<extension>"),
        ('<asset><hfield name="h" nrow="9" ncol="9" size="1 1 1 1"/></asset>', "<hfield"),
        ('<custom><numeric name="n" size="9"/></custom>', "<numeric size"),
        ('<size nuser_geom="1000000"/>', "<size nuser_geom"),
        (
            '<asset><texture name="t" type="2d" builtin="flat" width="9999" height="9"/></asset>',
            "texture: got 9999 pixels",
        ),
    ],
)
def test_mujoco_load_error_rejects_costly_elements(tmp_path, inside, why):
    text = f"<mujoco>{inside}<worldbody>{BODY}</worldbody></mujoco>"
    with pytest.raises(NotAttemptedError, match=why):
        mujoco_load_error(facts_of(tmp_path, text).model)


def test_mujoco_load_error_rejects_many_bodies(tmp_path):
    links = "".join(f'<link name="l{k}"/>' for k in range(601))
    facts = facts_of(tmp_path, f'<robot name="r">{links}</robot>', "robot.urdf")
    with pytest.raises(NotAttemptedError, match="got 601; expected at most 600"):
        mujoco_load_error(facts.model)


def mesh_of(name, folder=""):
    return (
        f'<robot name="r"><mujoco><compiler meshdir="{folder}"/></mujoco><link name="a">'
        f'<collision><geometry><mesh filename="{name}"/></geometry></collision></link></robot>'
    )


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
@pytest.mark.parametrize(("name", "folder"), [("m.stl", ""), ("else/m.stl", ""), ("m.stl", "in")])
def test_mujoco_load_error_never_opens_pipe(tmp_path, name, folder):
    (tmp_path / "in").mkdir()
    os.mkfifo(tmp_path / (folder or ".") / "m.stl")
    with pytest.raises(NotAttemptedError, match=r"m\.stl is not passed to MuJoCo"):
        mujoco_load_error(facts_of(tmp_path, mesh_of(name, folder), "robot.urdf").model)


def test_mujoco_load_error_never_opens_device(tmp_path):
    if not Path("/dev/zero").exists():
        pytest.skip("no devices here")
    with pytest.raises(NotAttemptedError, match="zero is not passed"):
        mujoco_load_error(facts_of(tmp_path, mesh_of("/dev/zero"), "robot.urdf").model)


def test_mujoco_load_error_rejects_large_meshes(tmp_path):
    with (tmp_path / "m.stl").open("wb") as file:
        file.truncate(33 * 2**20)
    with pytest.raises(NotAttemptedError, match="33,554,432 bytes"):
        mujoco_load_error(facts_of(tmp_path, mesh_of("m.stl"), "robot.urdf").model)


def test_mujoco_load_error_rejects_large_textures(tmp_path):
    head = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 99999, 99999)
    (tmp_path / "t.png").write_bytes(head)
    text = f'<mujoco><asset><texture type="2d" name="t" file="t.png"/></asset><worldbody>{BODY}'
    with pytest.raises(NotAttemptedError, match="pixels"):
        mujoco_load_error(facts_of(tmp_path, f"{text}</worldbody></mujoco>").model)


def test_mujoco_load_error_checks_included_files(tmp_path):
    (tmp_path / "part.xml").write_text('<mujoco><size nkey="99999999"/></mujoco>')
    text = f'<mujoco><include file="part.xml"/><worldbody>{BODY}</worldbody></mujoco>'
    with pytest.raises(NotAttemptedError, match="nkey"):
        mujoco_load_error(facts_of(tmp_path, text).model)


def test_yourdfpy_load_error_rejects_entities(tmp_path):
    text = '<!DOCTYPE robot [<!ENTITY a "b">]><robot name="&a;"><link name="a"/></robot>'
    with pytest.raises(NotAttemptedError, match="entities"):
        load_in_yourdfpy(facts_of(tmp_path, text, "robot.urdf"))


def test_load_errors_reject_xacro(tmp_path):
    text = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r"><link name="a"/></robot>'
    facts = facts_of(tmp_path, text, "robot.xacro")
    for load in (load_in_mujoco, load_in_yourdfpy):
        with pytest.raises(NotAttemptedError, match="xacro"):
            load(facts)


def test_load_errors_reject_missing_file(tmp_path):
    facts = facts_of(tmp_path, '<robot name="r"><link name="a"/></robot>', "robot.urdf")
    facts.model.file.unlink()
    for load in (load_in_mujoco, load_in_yourdfpy):
        with pytest.raises(NotAttemptedError, match="there is no file"):
            load(facts)


def test_mujoco_load_error_writes_no_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    facts = facts_of(tmp_path, mesh_of("missing.stl"), "robot.urdf")
    assert "Error opening file" in mujoco_load_error(facts.model).message
    assert [path.name for path in tmp_path.iterdir()] == ["robot.urdf"]


@pytest.mark.parametrize("with_meshes", [True, False])
def test_repeated_shape_names_print_nothing(tmp_path, capfd, with_meshes):
    text = bundled.urdf_path("quadruped").read_text().replace("<collision>", '<collision name="c">')
    assert text.count('name="c"') > 1
    model = facts_of(tmp_path, text, "robot.urdf").model
    assert mujoco_load_error(model, with_meshes=with_meshes) is None
    assert capfd.readouterr() == ("", "")
