"""Convert the name of a robot to Python identifiers."""

import keyword
import re
import unicodedata

_PACKAGE_WORDS = ("description", "urdf")
"""Last words of names that ROS packages and CAD exporters add to the name of a robot."""

_MAX_LENGTH = 40
"""Longer names are truncated."""


def words(name: str) -> list[str]:
    """Return the words of a name in ASCII letters and digits, at least one word."""
    ascii_name = unicodedata.normalize("NFKD", name[:1000]).encode("ascii", "ignore").decode()
    found = re.findall(r"[A-Za-z0-9]+", ascii_name[:_MAX_LENGTH]) or ["robot"]
    if len(found) > 1 and found[-1].lower() in _PACKAGE_WORDS:
        found.pop()
    return ["robot", *found] if found[0][0].isdigit() else found


def class_name(name: str) -> str:
    """Return a class name, such as `AnymalC` for anymal_c."""
    return "".join(word[0].upper() + word[1:] for word in words(name))


def constant_name(name: str) -> str:
    """Return a constant name, such as `ANYMAL_C` for anymal_c."""
    return "_".join(words(name)).upper()


def package_name(name: str) -> str:
    """Return the name of a package, task or experiment, such as `anymal_c` for ANYmal C."""
    joined = "_".join(words(name)).lower()
    return f"{joined}_robot" if keyword.iskeyword(joined) else joined
