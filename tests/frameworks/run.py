"""Run the checks of the integrations, each in a virtual environment with its real framework.

python tests/frameworks/run.py [NAME ...] [--environments FOLDER]
"""

import argparse
import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

FOLDER = Path(__file__).parent
PACKAGES = {
    "mjlab": [["mjlab==1.6.0"]],
    "pybullet": [["pybullet==3.2.7"]],
    "warp": [["newton==1.8.0", "mujoco-warp==4.0.0"]],
    "mjx": [["mujoco-mjx==3.17.0"]],
    "isaaclab": [["torch", "packaging", "gymnasium"], ["--no-deps", "isaaclab==2.3.2.post1"]],
    "genesis": [["torch"], ["genesis-world==1.4.5"]],
    "playground": [["playground==0.2.0"], ["--no-deps", "mjlab==1.6.0"]],
    "drake": [["drake==1.51.1"]],
    "sdformat": [],
}
"""Arguments of `pip install` for each check."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=list(PACKAGES), metavar="NAME")
    parser.add_argument("--environments", type=Path, default=FOLDER.parents[1] / ".frameworks")
    arguments = parser.parse_args()
    failed = []
    for name in arguments.names:
        python = arguments.environments / name / "bin" / "python"
        if not python.exists():
            venv.create(python.parents[1], with_pip=True)
        for packages in [["-e", FOLDER.parents[1]], *PACKAGES[name]]:
            subprocess.run([python, "-m", "pip", "install", "-q", *packages], check=True)
        with tempfile.TemporaryDirectory() as folder:
            scripts = sorted(FOLDER.glob(f"{name}*_check.py"))
            checks = [subprocess.run([python, script, folder]) for script in scripts]
        if name == "mjlab":  # trains onboarded robots
            test = FOLDER.parent / "terrainkit_robots/onboarding/frameworks/test_mjlab.py"
            variables = os.environ | {"TERRAINKIT_MJLAB_PYTHON": str(python.absolute())}
            pytest = [sys.executable, "-m", "pytest", "-n", "0", test]
            checks.append(subprocess.run(pytest, env=variables))
        if any(each.returncode for each in checks):
            failed.append(name)
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    sys.exit(main())
