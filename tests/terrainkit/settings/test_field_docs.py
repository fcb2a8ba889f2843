from dataclasses import dataclass

from terrainkit.settings.field_docs import field_docs


@dataclass(frozen=True, kw_only=True)
class Body:
    mass: float = 1.0
    """Total mass,
    with all links [kg]."""

    name: str = ""


@dataclass(frozen=True, kw_only=True)
class Leg(Body):
    length: float = 1.0
    """Length [m]."""


def test_field_docs_are_on_one_line_and_inherited():
    mass = {"mass": "Total mass, with all links [kg]."}
    assert field_docs(Body) == mass
    assert (
        field_docs(Leg) == field_docs(type("Leg", (Leg,), {})) == mass | {"length": "Length [m]."}
    )


def test_field_docs_of_a_class_without_source_are_empty():
    names = {"dataclass": dataclass}
    exec("@dataclass\nclass Typed:\n    mass: float = 1.0\n", names)
    assert field_docs(names["Typed"]) == {}
