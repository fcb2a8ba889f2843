import keyword

import pytest

from terrainkit_robots.onboarding.frameworks.naming import class_name, constant_name, package_name


@pytest.mark.parametrize(
    ("name", "class_", "constant", "package"),
    [
        ("go2", "Go2", "GO2", "go2"),
        ("anymal_c", "AnymalC", "ANYMAL_C", "anymal_c"),
        ("go2 description!", "Go2", "GO2", "go2"),
        ("H1-2", "H12", "H1_2", "h1_2"),
        ("class", "Class", "CLASS", "class_robot"),
        ("1st", "Robot1st", "ROBOT_1ST", "robot_1st"),
        ("Z\u00fcrich", "Zurich", "ZURICH", "zurich"),
        ("\u673a\u5668\u4eba", "Robot", "ROBOT", "robot"),
        ("", "Robot", "ROBOT", "robot"),
        ('x"\nimport os', "XImportOs", "X_IMPORT_OS", "x_import_os"),
    ],
)
def test_names_are_identifiers(name, class_, constant, package):
    made = (class_name(name), constant_name(name), package_name(name))
    assert made == (class_, constant, package)
    assert all(word.isidentifier() for word in (class_, constant, package))
    assert not keyword.iskeyword(package)


def test_class_name_is_truncated():
    assert len(class_name("a" * 10**6)) == 40
