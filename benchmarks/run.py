"""Run the benchmarks in this folder, or the named ones, and print `name value` lines.

python benchmarks/run.py [BENCHMARK ...]

Values are ratios to a lower bound that is measured in the same run, such as copying the same bytes
or importing numpy, so that they do not depend on the machine. Each name includes its limit.
"""

import importlib
import sys
import warnings
from pathlib import Path

import terrainkit


def main() -> int:
    names = sorted({path.stem for path in Path(__file__).parent.glob("*.py")} - {"run", "clock"})
    if unknown := [name for name in sys.argv[1:] if name not in names]:
        print(f"benchmark: got {unknown[0]}; expected {', '.join(names)}", file=sys.stderr)
        return 2
    warnings.simplefilter("ignore", terrainkit.TerrainkitWarning)  # cliffs, as expected
    for benchmark in sys.argv[1:] or names:
        for name, value in importlib.import_module(benchmark).run():
            print(f"{benchmark}.{name} {value:.3g}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
