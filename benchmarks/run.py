"""Run every subject in this folder, or those named, and print `name value` lines.

python benchmarks/run.py [SUBJECT ...]

Values are ratios, measured in one run against the limit of what is possible (copying the same
bytes, importing numpy), so that they mean the same on any machine. What each may be at most stands
beside it.
"""

import importlib
import sys
from pathlib import Path


def main() -> None:
    own = {"run", "clock"}
    found = sorted(path.stem for path in Path(__file__).parent.glob("*.py"))
    for subject in sys.argv[1:] or [name for name in found if name not in own]:
        for name, value in importlib.import_module(subject).run():
            print(f"{subject}.{name} {value:.3g}", flush=True)


if __name__ == "__main__":
    main()
