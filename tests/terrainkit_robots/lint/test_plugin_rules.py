"""Rules of other packages, which come by entry points."""

import importlib.metadata
import sys

import pytest

from terrainkit.errors import PluginError
from terrainkit_robots.lint import rule as module
from terrainkit_robots.lint.check import check_robot
from terrainkit_robots.lint.rule import families, get_rule, rules
from terrainkit_robots.lint.settings import Settings
from tests.small_robots import link

RULES = '''
from terrainkit_robots.lint.rule import Violation, rule

@rule("ACM001", "unlabeled-link", "warning")
def unlabeled_link(robot):
    """A link has no label.

    The workshop finds parts by their labels.

    Fix:
        Start the name with acme_.

    Source:
        The manual of the workshop, chapter 2.
    """
    for link in robot.model.links:
        if not link.name.startswith("acme_"):
            yield Violation(element=link, message=f"link {link.name}: has no label")
'''


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Return a function that installs a module with rules as an entry point."""

    def install(text, family="ACM"):
        (tmp_path / "acme_rules.py").write_text(text)
        point = importlib.metadata.EntryPoint(family, "acme_rules", "terrainkit.rules")
        points = importlib.metadata.EntryPoints((point,))
        monkeypatch.setattr(importlib.metadata, "entry_points", points.select)

    def forget():
        sys.modules.pop("acme_rules", None)
        for cached in (module._plugins, module.rules):
            cached.cache_clear()

    monkeypatch.syspath_prepend(tmp_path)
    rules()  # the built-in rules register once, when they are imported
    monkeypatch.setattr(module, "_RULES", dict(module._RULES))
    forget()
    yield install
    forget()


def test_rule_of_another_package_runs(install, tmp_path):
    install(RULES)
    assert rules()[-1] is get_rule("unlabeled-link")
    assert families()["ACM"].title == "rules of acme_rules"
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r">{link("acme_arm")}{link("hand")}</robot>')
    (found,) = check_robot(path, Settings(select=("ACM",))).findings
    assert (found.code, found.subject, found.severity) == ("ACM001", "hand", "warning")
    assert found.hint == "Start the name with acme_."
    assert check_robot(path, Settings(simulate=False)).findings[-1] == found


@pytest.mark.parametrize(
    ("text", "family", "problem"),
    [
        ("import nothing_of_that_name", "ACM", "ModuleNotFoundError: No module named 'nothing_of"),
        ("raise SystemExit(0)", "ACM", "SystemExit: 0"),
        (RULES, "INR", "family: got INR; expected three other capital letters"),
        (RULES, "acme", "family: got acme; expected three other capital letters"),
        (RULES, "ACE", r"rule code: got ACM001; expected a family \(XML, .*TSK, ACE\) and three"),
        (RULES.replace("ACM001", "INR099"), "ACM", "got INR099; expected ACM and digits"),
        (RULES.replace("ACM001", "INR001"), "ACM", r"rule code INR001: got acme_rules\.unlabeled"),
    ],
)
def test_broken_rules_of_another_package_are_one_error(install, text, family, problem):
    install(text, family)
    with pytest.raises(PluginError, match=rf"^rules {family} \(acme_rules\) cannot be .*{problem}"):
        rules()
