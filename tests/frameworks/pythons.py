"""The interpreters of other Python versions on this machine.

python tests/frameworks/pythons.py VERSION prints one; the exit code is 1 if there is none.
"""

import os
import subprocess
import sys
from pathlib import Path


def find_python(version, *modules):
    """Return an interpreter of a version such as 3.8 that has some modules, or None.

    It is searched for on PATH and in pyenv.
    """
    on_path = [Path(folder, f"python{version}") for folder in os.get_exec_path()]
    in_pyenv = sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python"))
    code = f"import {', '.join(('sys', *modules))}; print('%d.%d' % sys.version_info[:2])"
    for python in (*on_path, *in_pyenv):
        if python.is_file():
            found = subprocess.run([python, "-c", code], capture_output=True, text=True)
            if found.stdout.strip() == version:
                return str(python)
    return None


if __name__ == "__main__":
    python = find_python(sys.argv[1])
    if python is None:
        sys.exit(1)
    print(python)
