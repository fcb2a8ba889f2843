"""The entry point: select the command, run it, and report errors as one line."""

import gc
import importlib
import os
import re
import signal
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit_cli import render, signals

if TYPE_CHECKING:
    from terrainkit_cli.parse import Command

COMMAND_GROUPS = {
    "": {"demo": "Walk the bundled quadruped over a course, live in the browser."},
    "Terrain": {
        "generate": "Generate a map of terrain patches and write it to a file.",
        "import": "Import heights, meshes or point clouds as a map.",
        "list": "List terrains, overlays and presets, or the contents of one.",
        "suite": "List, show or generate suites: fixed maps to compare policies.",
        "info": "Print the size, terrains and difficulty of a map, or one patch.",
        "preview": "Render a map from above, with terrain names and spawn origins.",
        "view": "Show a map, a robot or a policy in the browser, in 3D.",
        "check-map": "Validate a map: spawn origins, patches, sizes, difficulty, mesh.",
        "feasibility": "Show whether a robot can cross each patch, and what blocks it.",
        "diff": "Compare two maps: config, and each patch.",
        "export": "Export a map to other formats, or a policy to ONNX.",
    },
    "Robots": {
        "check-robot": "Check URDF, xacro and MJCF files for errors.",
        "rule": "Explain a rule of check-robot or check-task, or list all rules.",
        "onboard": "Convert a robot file into a folder that is ready for training.",
        "check-task": "Measure what a task pays for before it is trained.",
        "train": "Train a policy for a robot on a terrain, and save it as a run.",
        "evaluate": "Measure velocity errors, gait, falls and success of a policy.",
        "play": "Record a video of a policy, and print its errors and falls.",
        "check-policy": "Check whether a policy, its contract and a robot fit together.",
    },
}
"""Summary of each command by the title of its group: the first line of the docstring of its class,
whose module is only imported to run it."""

_MODULES = {
    "demo": "view_command",
    **dict.fromkeys(("list", "info", "preview", "check-map", "diff"), "terrain_commands"),
    **dict.fromkeys(("check-robot", "rule"), "robot_commands"),
}
"""Modules of the commands that have no module of their own."""

_UNLISTED = ["average", "import-config", "completion"]
"""Commands without a line in the overview, which has no more lines than a terminal."""

COMMANDS = [name for group in COMMAND_GROUPS.values() for name in group] + _UNLISTED

_OUT_OF_MEMORY = re.compile("allocate memory|start new thread|failed to map segment")
"""Errors of torch, of threads and of shared libraries under a small limit of the memory."""

_PACKAGES = {"collada": "pycollada", "cv2": "opencv-python-headless", "yaml": "pyyaml"}
"""Packages whose module has another name."""

_BYTES_PER_JOB = 1 << 27
"""Memory of a process that has imported SciPy [bytes]."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line, and return its exit code.

    0: success. 1: a check found errors. 2: any other error; one line on stderr says what and why.
    128 + n: ended by signal n.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    _open_closed_streams()
    # Imports create some 200,000 objects and no garbage; looking for it took 5 % of a command.
    gc.set_threshold(300_000)
    # Child processes render. Here, `import mujoco` would load a graphics library, which takes time
    # and fails where it is missing. gl_backend.py reads the other name.
    if os.environ.get("MUJOCO_GL") != "disable":
        os.environ["TERRAINKIT_MUJOCO_GL"] = os.environ.get("MUJOCO_GL", "")
        os.environ["MUJOCO_GL"] = "disable"
    if arguments[:1] != ["train"]:  # only training multiplies large matrices
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # idle threads of OpenBLAS spin
    if "_ARGCOMPLETE" in os.environ:
        from terrainkit_cli.completion_command import complete

        complete(COMMANDS, command)
    warnings.showwarning = render.show_warning
    signals.raise_on_signals()
    from terrainkit.errors import TerrainkitError

    try:
        with _package_errors():
            code = _run(arguments)
        sys.stdout.flush()
        return code
    except TerrainkitError as error:
        render.error(str(error))
        return 2
    except MemoryError:
        render.error("out of memory; use fewer environments, a smaller map or larger cells")
        return 2
    except BrokenPipeError:  # the reader is gone, as in `terrainkit list | head -1`
        render.drop_stdout()
        return 0
    except OSError as error:
        render.drop_stdout()
        render.error(error.strerror or str(error))
        return 2
    except KeyboardInterrupt:
        render.error("interrupted")
        return 128 + signal.SIGINT
    except signals.Terminated as end:
        render.error(f"ended by {end.signal.name}")
        return 128 + end.signal


def _open_closed_streams() -> None:
    """Open closed standard streams, or the next file that is opened takes their place."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open(mode))  # noqa: SIM115


def _run(arguments: list[str]) -> int:
    from terrainkit import __version__
    from terrainkit.errors import ConfigError
    from terrainkit.settings.text import expected_names, truncate

    name = arguments[0] if arguments else "--help"
    if name in ("-h", "--help"):
        _print_overview()
        return 0
    if name == "--version":
        render.result(f"terrainkit {__version__}")
        return 0
    if name not in COMMANDS:
        known = expected_names(name, COMMANDS)
        raise ConfigError(f"no command {truncate(repr(name))}; {known}")
    return _run_command(name, arguments[1:])


def _run_command(name: str, argv: list[str]) -> int:
    from terrainkit.files.memory import check_memory, limit_allocations
    from terrainkit.settings.text import truncate
    from terrainkit_cli.parse import HELP, UsageError, format_help, is_option

    prog, command_class = f"terrainkit {name}", command(name)
    # Names of files may come from `*.urdf` in a shell, or from a program that passes changed files.
    for word in filter(is_option, [] if "--" in argv else argv):
        if os.path.lexists(word):
            expected = "expected -- between options and files"
            raise UsageError(f"{truncate(word)}: got an option that is also a file; {expected}")
    if {*HELP} & {*takewhile(lambda word: word != "--", argv)}:
        options, doc = command_class.options(argv), command_class.__doc__ or ""
        render.help_page(format_help(prog, doc, options, render.width()))
        return 0
    try:
        parsed = command_class.parse(argv)
    except UsageError as error:
        raise UsageError(f"{error}; see {prog} --help") from None
    if name in COMMAND_GROUPS["Terrain"]:
        jobs = getattr(parsed, "jobs", 1)
        if jobs > 1:
            check_memory(jobs * _BYTES_PER_JOB, f"--jobs {jobs}", ("--jobs", jobs))
        limit_allocations(jobs if jobs > 1 else 0)
    return parsed.run()


@contextmanager
def _package_errors() -> Iterator[None]:
    """Replace the errors of packages that are missing, or run out of memory."""
    from terrainkit.errors import TerrainkitError

    try:
        yield
    except ModuleNotFoundError as error:
        module = str(error.name).partition(".")[0]
        if module.startswith("terrainkit"):
            raise
        package = _PACKAGES.get(module, module)
        raise TerrainkitError(f"missing package: {package}; run: pip install {package}") from error
    except (RuntimeError, ImportError) as error:
        if _OUT_OF_MEMORY.search(str(error)):
            raise MemoryError from error
        raise


def _print_overview() -> None:
    # The text fits into 24 lines, the size of a terminal.
    render.result(f"usage: terrainkit COMMAND [-h]; --version, {', '.join(_UNLISTED)}.")
    rows: list[tuple[str, str]] = []
    for group, summaries in COMMAND_GROUPS.items():
        rows += [(f"{group}:", "")] if group else []
        rows += [(f"  {name}", summary) for name, summary in summaries.items()]
    render.table(rows)


def command(name: str) -> "type[Command]":
    """Return the class of the command `name`: `check-map` is the class `CheckMap` of its module."""
    own = f"{name.replace('-', '_')}_command"
    module = importlib.import_module(f"terrainkit_cli.{_MODULES.get(name, own)}")
    found: type[Command] = getattr(module, name.title().replace("-", ""))
    return found


if __name__ == "__main__":
    sys.exit(main())
