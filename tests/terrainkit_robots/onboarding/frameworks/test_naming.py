import keyword

import pytest

from terrainkit_robots.onboarding.frameworks.naming import class_name, constant_name, package_name
from tests.tables import read_table


@pytest.mark.parametrize(
    ("name", "class_", "constant", "package"), read_table(__file__, "names_are_identifiers")
)
def test_names_are_identifiers(name, class_, constant, package):
    made = (class_name(name), constant_name(name), package_name(name))
    assert made == (class_, constant, package)
    assert all(word.isidentifier() for word in (class_, constant, package))
    assert not keyword.iskeyword(package)


def test_class_name_is_truncated():
    assert len(class_name("a" * 10**6)) == 40
