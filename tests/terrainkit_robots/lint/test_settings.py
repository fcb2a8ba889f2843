import os
import tomllib
from pathlib import Path

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.settings import Settings, matching, package_folder, read_settings
from tests.tables import read_table


def codes(found):
    return {each.code for each in found}


def test_matching_accepts_codes_prefixes_and_names():
    assert codes(matching("INR002")) == codes(matching("negative-mass")) == {"INR002"}
    assert codes(matching("inr002 ")) == {"INR002"}
    assert codes(matching("INR")) == {r.code for r in rules() if r.family == "INR"}
    assert codes(matching("INR00")) < codes(matching("INR"))


def test_matching_suggests_nearest_name():
    with pytest.raises(ConfigError, match=r"'negativ-mass'; did you mean negative-mass\? Expected"):
        matching("negativ-mass")


@pytest.mark.parametrize("word", ["", "INR2", "XYZ", "mass", "*"])
def test_matching_rejects_other_words(word):
    with pytest.raises(ConfigError, match=r"no rule .* families XML, UNI, MSH, TRE"):
        matching(word)


def test_command_line_overrides_file(tmp_path):
    ours = Settings(select=("INR",), ignore={"INR001": "a"}, xacro_arguments={"x": "1"})
    theirs = Settings(
        select=("JNT",),
        ignore={"INR001": "b", "INR002": "c"},
        packages={"p": tmp_path},
        xacro_arguments={"x": "2", "y": "3"},
        strict=True,
    )
    assert ours.over(theirs) == Settings(
        select=("INR",),
        ignore={"INR001": "a", "INR002": "c"},
        packages={"p": tmp_path},
        xacro_arguments={"x": "1", "y": "3"},
        strict=True,
    )
    assert Settings().over(theirs) == theirs
    assert Settings(strict=False, simulate=True).over(Settings(strict=True, simulate=False)) == (
        Settings(strict=False, simulate=True)
    )


TABLE = read_table(__file__, "table")


@pytest.mark.parametrize(
    ("name", "heading"),
    [("pyproject.toml", "[tool.terrainkit.check-robot]"), ("terrainkit.toml", "[check-robot]")],
)
def test_read_settings_searches_parent_folders(tmp_path, name, heading):
    (tmp_path / name).write_text(heading + TABLE)
    (tmp_path / "meshes").mkdir()
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "a" / "pyproject.toml").write_text('[project]\nname = "terrainkit_user"\n')
    assert read_settings(tmp_path / "a" / "b") == Settings(
        select=("INR", "unnamed-robot"),
        ignore={"INR004": "a dummy"},
        packages={"my_robot": tmp_path / "meshes"},
        xacro_arguments={"arm": "true", "legs": "4", "name": "b"},
        strict=True,
    )


def test_read_settings_uses_nearest_file_only(tmp_path):
    (tmp_path / "terrainkit.toml").write_text("[check-robot]\nstrict = true\n")
    (tmp_path / "a").mkdir()
    text = "[tool.terrainkit.check-robot]\nselect='INR,JNT'"
    (tmp_path / "a" / "pyproject.toml").write_text(text)
    assert read_settings(tmp_path / "a") == Settings(select=("INR", "JNT"))


def test_read_settings_skips_other_pyproject_and_pipes(tmp_path):
    (tmp_path / "pyproject.toml").write_text("[broken")
    os.mkfifo(tmp_path / "terrainkit.toml")
    assert read_settings(tmp_path) == Settings()


INVALID = tomllib.loads(Path(__file__).with_name("settings.toml").read_text())


@pytest.mark.parametrize(("text", "said"), INVALID["rejected"])
def test_read_settings_error_names_the_file(tmp_path, text, said):
    (tmp_path / "terrainkit.toml").write_text(text)
    with pytest.raises(ConfigError) as error:
        read_settings(tmp_path)
    assert str(error.value).startswith(f"{tmp_path / 'terrainkit.toml'}: ")
    assert said in str(error.value)


def test_package_folder_must_exist(tmp_path):
    assert package_folder("p", tmp_path) == tmp_path
    with pytest.raises(ConfigError, match=r"package p: got .*; expected an existing folder"):
        package_folder("p", tmp_path / "none")
