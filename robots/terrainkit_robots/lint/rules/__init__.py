"""Lint rules: one module per family. A function with the decorator `rule` is a rule."""
