import os

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.lint.rule import rules
from terrainkit_robots.lint.settings import Settings, matching, package_folder, read_settings


def codes(found):
    return {each.code for each in found}


def test_a_word_is_a_code_the_start_of_one_or_a_name():
    assert codes(matching("INR002")) == codes(matching("negative-mass")) == {"INR002"}
    assert codes(matching("inr002 ")) == {"INR002"}
    assert codes(matching("INR")) == {r.code for r in rules() if r.family == "INR"}
    assert codes(matching("INR00")) < codes(matching("INR"))


@pytest.mark.parametrize("word", ["", "INR2", "XYZ", "mass", "*"])
def test_another_word_is_an_error_that_says_what_there_is(word):
    with pytest.raises(ConfigError, match=r"no rule .* families XML, MSH, TRE"):
        matching(word)


def test_settings_of_the_command_line_go_before_those_of_a_file(tmp_path):
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


TABLE = """
select = ["INR", "unnamed-robot"]
ignore = { INR004 = "a dummy" }
package = { my_robot = "meshes" }
xacro-arg = { arm = true, legs = 4, name = "b" }
strict = true
"""


@pytest.mark.parametrize(
    ("name", "heading"),
    [("pyproject.toml", "[tool.terrainkit.check-robot]"), ("terrainkit.toml", "[check-robot]")],
)
def test_settings_are_found_in_a_folder_above(tmp_path, name, heading):
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


def test_the_nearest_folder_with_settings_is_taken_and_nothing_else(tmp_path):
    (tmp_path / "terrainkit.toml").write_text("[check-robot]\nstrict = true\n")
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "pyproject.toml").write_text(
        "[tool.terrainkit.check-robot]\nselect='INR,JNT'"
    )
    assert read_settings(tmp_path / "a") == Settings(select=("INR", "JNT"))


def test_a_file_of_somebody_else_is_not_even_parsed(tmp_path):
    (tmp_path / "pyproject.toml").write_text("[broken")
    assert read_settings(tmp_path) == Settings()


def test_a_fifo_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pyproject.toml")
    os.mkfifo(tmp_path / "terrainkit.toml")
    assert read_settings(tmp_path) == Settings()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "[check-robot]\nselct = []",
            "no key 'selct'; there are: select, ignore, package, xacro-arg",
        ),
        ("[check_robot]\nselect = []", "no key 'check_robot'; there are: check-robot"),
        ("check-robot = 3", "check-robot is 3; wanted a table"),
        ("[check-robot", "not a TOML file"),
        ("x = " + "[" * 5000, "nested too deeply"),
        ("x" + ".x" * 500_000 + " = 1", "500000 dots"),
        ("[check-robot]\nselect = [3]", "wanted a list of codes"),
        ("[check-robot]\nselect = ['XYZ']", "no rule 'XYZ'"),
        ("[check-robot]\nstrict = 'yes'", "strict is 'yes'; wanted true or false"),
        ("[check-robot]\nignore = ['INR001']", "ignore is ['INR001']; wanted a table"),
        ("[check-robot]\nignore = { INR001 = '' }", "ignore.INR001 is ''; wanted a reason"),
        ("[check-robot]\nignore = { INR001 = true }", "ignore.INR001 is True; wanted a reason"),
        ("[check-robot]\nignore = { NOPE = 'x' }", "no rule 'NOPE'"),
        ("[check-robot]\npackage = { p = 'none' }", "where there is no folder"),
        ("[check-robot]\nxacro-arg = { p = [1] }", "xacro-arg.p is [1]; wanted a text"),
        ("[check-robot]\nxacro-arg = 'p:=1'", "xacro-arg is 'p:=1'; wanted a table"),
        ("#" * (1 << 20) + "\n[check-robot]", "over 1048576 bytes"),
    ],
    ids=lambda text: text[:40],
)
def test_bad_settings_are_an_error_with_the_file(tmp_path, text, said):
    (tmp_path / "terrainkit.toml").write_text(text)
    with pytest.raises(ConfigError) as error:
        read_settings(tmp_path)
    assert str(error.value).startswith(f"{tmp_path / 'terrainkit.toml'}: ")
    assert said in str(error.value)


def test_settings_that_are_not_text_are_an_error(tmp_path):
    (tmp_path / "terrainkit.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match="not a TOML file"):
        read_settings(tmp_path)


def test_a_package_is_in_a_folder(tmp_path):
    assert package_folder("p", tmp_path) == tmp_path
    with pytest.raises(ConfigError, match=r"package p is to be in .*, where there is no folder"):
        package_folder("p", tmp_path / "none")
