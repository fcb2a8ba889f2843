"""The rules: one family, one file. A function under `@rule` is all that a new one needs."""
