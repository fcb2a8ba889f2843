"""Stand-ins for packages that cannot be installed, such as the packages of Isaac Sim."""

from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from unittest.mock import MagicMock


class StandIn(MagicMock):
    """A mock that can also be a base class or the type of a field of Isaac Lab's classes."""

    __name__ = "stand_in"


class StandIns(MetaPathFinder, Loader):
    """Imports some packages as mocks."""

    def __init__(self, packages):
        self.packages = packages

    def find_spec(self, name, path, target=None):
        del path, target
        is_mock = name.split(".")[0] in self.packages
        return ModuleSpec(name, self, is_package=True) if is_mock else None

    def create_module(self, spec):
        module = StandIn(name=spec.name)
        module.__spec__, module.__path__, module.__name__ = spec, [], spec.name
        return module

    def exec_module(self, module):
        pass
