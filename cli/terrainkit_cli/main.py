"""The entry point: find the command, run it, and turn every expected error into one line."""

import importlib
import os
import signal
import sys
import warnings
from collections.abc import Sequence

from terrainkit_cli import parse, render

COMMANDS = {
    "generate": "terrain_commands",
    "list": "terrain_commands",
    "info": "terrain_commands",
    "preview": "terrain_commands",
    "export": "export_command",
    "check-map": "terrain_commands",
    "check-robot": "robot_commands",
    "rule": "robot_commands",
    "onboard": "onboard_command",
    "train": "train_command",
    "smoke-test": "smoke_test_command",
    "evaluate": "evaluate_command",
    "play": "play_command",
}
"""Module of each command, so that only the one in use is imported."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line, and return its exit code.

    0: done. 1: a check found something. 2: bad input; one line on stderr says what and why.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    _rename_env(DRAWING)
    warnings.showwarning = render.show_warning
    from terrainkit.errors import TerrainkitError

    # Temporary files are removed when a scheduler or a closed terminal ends the process.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # nohup
        signal.signal(signal.SIGHUP, lambda *_: sys.exit(129))
    try:
        code = _run(arguments)
        sys.stdout.flush()
        return code
    except TerrainkitError as error:
        render.error(str(error))
        return 2
    except MemoryError:
        render.error("out of memory; a smaller map, or a coarser cell, would do")
        return 2
    except BrokenPipeError:
        render.drop_stdout()
        return 0
    except OSError as error:
        render.drop_stdout()
        render.error(error.strerror or str(error))
        return 2
    except KeyboardInterrupt:
        render.error("interrupted")
        return 130


DRAWING = "MUJOCO_GL"
"""The graphics library that MuJoCo draws with."""


def _rename_env(name: str) -> None:
    """Move a variable of the environment out of MuJoCo's sight.

    MuJoCo asks for the graphics library when it is imported, and fails where there is none, even
    for work that draws nothing. What draws asks for the other name.
    """
    if name in os.environ:
        os.environ[f"TERRAINKIT_{name}"] = os.environ.pop(name)


def _run(arguments: list[str]) -> int:
    from terrainkit import __version__
    from terrainkit.text import expected_names, truncate

    name = arguments[0] if arguments else "--help"
    if name in ("-h", "--help"):
        render.overview({name: command(name).__doc__ or "" for name in COMMANDS})
        return 0
    if name == "--version":
        render.result(f"terrainkit {__version__}")
        return 0
    if name not in COMMANDS:
        expected = expected_names(name, COMMANDS)
        raise parse.UsageError(f"no command {truncate(repr(name))}; {expected}")
    options = command(name).options(arguments[1:])
    parsed = parse.parse(options, f"terrainkit {name}", arguments[1:])
    return parsed.run()


def command(name: str) -> type[parse.Command]:
    """Return the class of the command `name`."""
    module = importlib.import_module(f"terrainkit_cli.{COMMANDS[name]}")
    found: type[parse.Command] = getattr(module, name.title().replace("-", ""))
    return found


if __name__ == "__main__":
    sys.exit(main())
