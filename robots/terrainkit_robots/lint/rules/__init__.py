"""Lint rules: one package per family, one module per concept. Functions decorated with `rule`."""
