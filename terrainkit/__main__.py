"""Run the command line: `python -m terrainkit` is `terrainkit`."""

import runpy

runpy.run_module("terrainkit_cli.main", run_name="__main__")  # a layer above this package
