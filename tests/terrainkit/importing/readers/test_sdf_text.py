import cv2
import numpy as np
import pytest
import trimesh

from terrainkit.errors import HeightFileError, TerrainkitWarning
from terrainkit.importing.readers.height_source import open_source
from terrainkit.importing.readers.import_options import ReadOptions
from tests.tables import read_table


def save(folder, text, name="a.world"):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f'<?xml version="1.0"?><sdf version="1.7">{text}</sdf>')
    return path


def model(geometry, pose="0 0 0 0 0 0", static="true", name="m"):
    return (
        f"<model name='{name}'><static>{static}</static><link name='l'><pose>{pose}</pose>"
        f"<collision name='c'><geometry>{geometry}</geometry></collision></link></model>"
    )


def height(source, x, y):
    return float(source.heights(np.array([x]), np.array([y]))[0, 0])


def check(source, expected):
    for x, y, z in expected:
        assert height(source, x, y) == pytest.approx(z, abs=5e-3, nan_ok=True), (x, y)


@pytest.mark.parametrize(("text", "expected"), read_table(__file__, "worlds"))
def test_world_has_the_heights_of_its_shapes(tmp_path, text, expected):
    check(open_source(save(tmp_path, text), ReadOptions()), expected)


@pytest.mark.parametrize("suffix", [".dae", ".stl", ".obj", ".glb"])
def test_world_has_its_meshes(tmp_path, suffix):
    box = trimesh.creation.box((2.0, 2.0, 1.0))
    (tmp_path / "models/step/meshes").mkdir(parents=True)
    box.export(tmp_path / f"models/step/meshes/box{suffix}")
    mesh = "<mesh><uri>{}meshes/box" + suffix + "</uri><scale>1 1 {}</scale></mesh>"
    text = model(mesh.format("", 2), "0 0 0.5 0 0 0")
    save(tmp_path, text, "models/step/model.sdf")
    include = "<include><uri>model://step</uri><name>{}</name><pose>{} 0 0 0 0 0</pose></include>"
    text = include.format("a", 0) + include.format("b", 5)
    text += model(mesh.format("model:///step/", 6), "0 5 0 0 0 0")
    source = open_source(
        save(tmp_path, f"<world name='w'>{text}</world>", "worlds/a.world"), ReadOptions()
    )
    check(source, [(0.9, 0, 1.5), (5.9, 0, 1.5), (0, 5, 3), (3, 0, np.nan)])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_world_has_its_heightmaps(tmp_path, dtype):
    # 100 m x 50 m: row 0 has the highest y, and the largest value, 100, is 8 m.
    pixels = np.full((5, 5), 50, dtype)
    pixels[0], pixels[:, 4] = 75, 100
    cv2.imwrite(str(tmp_path / "h.png"), pixels)
    text = "<heightmap><uri>file://h.png</uri><size>100 50 8</size><pos>0 0 1</pos></heightmap>"
    source = open_source(save(tmp_path, model(text, "3 0 0 0 0 0"), "a.sdf"), ReadOptions())
    check(source, [(-40, -20, 5), (-40, 24.99, 7), (53, 0, 9), (40.5, -20, 7)])
    assert (*source.lower, *source.upper) == pytest.approx((-47, -25, 53, 25))


def test_world_leaves_out_what_moves(tmp_path):
    box = "<box><size>2 2 2</size></box>"
    text = model(box) + model("<mesh><uri>none.stl</uri></mesh>", static="false", name="robot")
    path = save(tmp_path, f"<world name='w'>{text}</world>")
    with pytest.warns(TerrainkitWarning, match=r"a\.world: bodies that move are left out: robot$"):
        source = open_source(path, ReadOptions())
    assert source.upper == pytest.approx((1, 1))


def test_world_of_an_exported_map_has_its_heights(tmp_path, solid_map):
    source = open_source(solid_map.save(tmp_path / "map.sdf"), ReadOptions())
    check(source, [(2.5, 2, 0), (1, 6, 0.6), (5, 6, 0), (2, 6, 0.7), (4.1, 6.1, 0.4)])


@pytest.mark.parametrize("variable", ["GZ_SIM_RESOURCE_PATH", "GAZEBO_MODEL_PATH"])
def test_world_finds_models_in_the_folders_of_gazebo(tmp_path, monkeypatch, variable):
    save(tmp_path, model("<box><size>2 2 2</size></box>", static="0"), "far/box/model.sdf")
    text = "<include><uri>model://box</uri><static>true</static></include>"
    path = save(tmp_path / "a/b/c/d/e/f", f"<world name='w'>{text}</world>")
    with pytest.raises(HeightFileError, match="'model://box' is not here and not fetched"):
        open_source(path, ReadOptions())
    monkeypatch.setenv(variable, f"/none:{tmp_path / 'far'}")
    assert open_source(path, ReadOptions()).upper == pytest.approx((1, 1))


@pytest.mark.parametrize(("text", "message"), read_table(__file__, "rejected"))
@pytest.mark.filterwarnings("ignore:.*bodies that move")
def test_world_that_cannot_be_read_is_rejected(tmp_path, text, message):
    save(tmp_path, "<model name='m'><include><uri>loop.sdf</uri></include></model>", "loop.sdf")
    with pytest.raises(HeightFileError, match=rf"a\.world: .*{message}"):
        open_source(save(tmp_path, text), ReadOptions())


def test_world_of_many_nested_models_is_rejected(tmp_path):
    text = "<model name='m'>" * 2000 + "</model>" * 2000
    with pytest.raises(HeightFileError, match=r"a\.world: .*cannot be read"):
        open_source(save(tmp_path, text), ReadOptions())
