from dataclasses import dataclass

import pytest

from terrainkit.terrain import parameter, registry
from terrainkit.terrain.parameter import parameters_of
from terrainkit.terrain.terrain_docs import class_doc, summary


@pytest.mark.parametrize("name", registry.terrain_names())
def test_terrain_doc_has_text_and_unit(name):
    about = class_doc(name, registry.get_terrain(name))
    assert about.text.partition("\n")[0].endswith("."), "the first line lacks a period"
    requested = registry.get_terrain(name).at(0).requested()
    assert [p.name for p in about.parameters] == [each for each in requested if "." not in each]
    unitless = {
        "grade",
        "opening",
        "opened",
        "vertical_exaggeration",
        "rank",
        "scale",
        "elements",
        "trees",
    }
    declared = parameters_of(registry.get_terrain(name))
    unitless |= {each for each, p in declared.items() if isinstance(p.easy, str | int | tuple)}
    for each in about.parameters:
        assert each.text.endswith("."), f"{each.name}: expected a docstring that ends with a period"
        has_unit = "[m]" in each.text or "[rad]" in each.text
        problem = f"{each.name}: expected [m] or [rad] in its docstring, or its name in `unitless`"
        assert has_unit != (each.name in unitless), problem


@pytest.mark.parametrize("name", registry.overlay_names())
def test_overlay_doc_has_text_and_parameters(name):
    about = class_doc(name, registry.get_overlay(name))
    assert about.text.partition("\n")[0] == summary(registry.get_overlay(name))
    assert about.text.partition("\n")[0].endswith(".")
    assert [p.name for p in about.parameters] == list(registry.get_overlay(name)().requested())
    assert all(each.text.endswith(".") for each in about.parameters)


def test_terrain_doc_has_both_ends_of_ranges_and_choices():
    stairs, hurdles = (registry.get_terrain(name) for name in ("pyramid_stairs", "hurdles"))
    step_height, step_width, *_ = class_doc("pyramid_stairs", stairs).parameters
    assert (step_height.easy, step_height.hard) == ("0.05", "0.23")
    assert (step_width.easy, step_width.hard) == ("0.31", "")
    top = class_doc("hurdles", hurdles).parameters[-1]
    assert top.text == "Shape of the top. One of: flat, round."


def test_terrain_doc_inherits_parameter_text():
    @dataclass(frozen=True, kw_only=True)
    class Hurdles(registry.get_terrain("stairs")):
        """Hurdles."""

        number: int = parameter.count(3)

    words = {each.name: each.text for each in class_doc("hurdles", Hurdles).parameters}
    assert words["step_height"] == "Rise of a step [m]."
    assert words["number"] == ""
