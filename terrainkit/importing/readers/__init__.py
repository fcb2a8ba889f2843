"""Read files of heights and meshes.

Each module in this folder that defines `SUFFIXES` is a reader. Its function `read(path, options)`
returns a `Source`.
"""
