from dataclasses import dataclass

from terrainkit.settings.field_docs import field_docs


@dataclass(frozen=True, kw_only=True)
class Body:
    """A body."""

    mass: float = 1.0
    """Total mass,
    with all links [kg]."""

    name: str = ""


@dataclass(frozen=True, kw_only=True)
class Leg(Body):
    """A leg."""

    length: float = 1.0
    """Length [m]."""


def test_field_docs_are_on_one_line():
    assert field_docs(Body) == {"mass": "Total mass, with all links [kg]."}


def test_field_docs_are_inherited():
    assert field_docs(Leg) == field_docs(Body) | {"length": "Length [m]."}
    assert field_docs(type("Leg", (Leg,), {})) == field_docs(Leg)


def test_field_docs_of_a_class_without_source_are_empty():
    names = {"dataclass": dataclass}
    exec("@dataclass\nclass Typed:\n    mass: float = 1.0\n", names)
    assert field_docs(names["Typed"]) == {}
