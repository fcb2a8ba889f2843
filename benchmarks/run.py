"""Run every subject in this folder, or those named, and print `name value` lines.

python benchmarks/run.py [SUBJECT ...]

Values are ratios, measured in one run against the limit of what is possible (copying the same
bytes, importing numpy), so that they mean the same on any machine. What each may be at most stands
beside it.
"""

import importlib
import sys
from pathlib import Path


def main() -> int:
    own = {"run", "clock"}
    found = sorted({path.stem for path in Path(__file__).parent.glob("*.py")} - own)
    if unknown := [word for word in sys.argv[1:] if word not in found]:
        print(f"no subject {unknown[0]}; there are: {', '.join(found)}", file=sys.stderr)
        return 2
    for subject in sys.argv[1:] or found:
        for name, value in importlib.import_module(subject).run():
            print(f"{subject}.{name} {value:.3g}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
