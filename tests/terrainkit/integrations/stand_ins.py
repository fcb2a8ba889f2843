from types import SimpleNamespace


class Cfg(SimpleNamespace):
    """A configuration class of a framework: any fields."""

    def copy(self):
        return type(self)(**vars(self))
