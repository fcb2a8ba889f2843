"""Onboard robots of Python packages and public repositories, and write docs/field_robots.md.

python docs/field_robots.py FOLDER...    each folder holds unpacked wheels and checkouts

The robots are listed in field_robots.toml. None of their files is kept.
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
from terrainkit_robots.onboarding.pipeline import OnboardOptions, is_blocking, onboard
from terrainkit_robots.onboarding.verify import Verification
from terrainkit_robots.text import names

DOCS = Path(__file__).parent
SECONDS = 120

ABOUT = """\
# Robots of the field

<!-- Written by docs/field_robots.py: change that or docs/field_robots.toml, not this file. -->

Results of `terrainkit onboard FILE -o OUT --unsafe-fixes --no-pictures` for unmodified robots of
Python packages and of public repositories. Of {count} files {summary}

- **onboarded**: the folder was written; `robot.urdf` and `robot.xml` load in MuJoCo and match the
  source (link positions within 0.1 mm at 100 poses, mass within 0.1 %).
- **rejected**: nothing was written. Rule codes are errors in the XML, the tree, joints, meshes or
  masses, which `--force` ignores. Other errors do not prevent onboarding.
- **actuators**: number of actuated joints; tendon actuators are omitted.
- **stands**: whether a robot with legs and a floating base stands for 5 s: with three or more legs
  with the derived gains (tilt under 3 degrees, only feet touch the ground), with fewer legs with
  locked joints.

To reproduce the table:

```sh
pip download --no-deps -d wheels {pinned}
for wheel in wheels/*.whl; do unzip -q -o "$wheel" -d field; done
while read -r name commit; do
  git clone -q "https://github.com/$name" "field/$name"
  git -C "field/$name" checkout -q "$commit"
done <<'END'
{commits}
END
python docs/field_robots.py field
```
"""


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A robot file in a package."""

    package: str
    under: str
    file: str
    kind: str


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The result of onboarding a robot."""

    result: str
    legs: int = 0
    actuators: str = ""
    mass: str = ""
    base: str = ""
    stands: str = ""
    errors: str = ""


def robots() -> tuple[list[Robot], dict[str, str]]:
    """Return the robots of field_robots.toml in the same order, and the commits by repository."""
    with (DOCS / "field_robots.toml").open("rb") as file:
        packages = tomllib.load(file)
    listed = [
        Robot(package=package, under=table.get("under", package if "/" in package else ""), **row)
        for package, table in packages.items()
        for row in table["robots"]
    ]
    return listed, {name: table["commit"] for name, table in packages.items() if "commit" in table}


def version(package: str, folders: Sequence[Path], commit: str | None) -> str:
    """Return the commit of a repository, or the version of a package in the folders."""
    if commit is not None:
        return commit
    name = package.replace("-", "_")
    for folder in folders:
        for found in folder.glob(f"{name}-*.dist-info"):
            return found.name.removeprefix(f"{name}-").removesuffix(".dist-info")
    sys.exit(f"{package} is in none of the folders")


def onboard_in_subprocess(robot: Robot, folders: Sequence[Path]) -> Outcome:
    """Onboard a robot in a subprocess, into a temporary folder."""
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


def onboard_robot(file: Path, target: Path) -> Outcome:
    """Onboard a robot without pictures, and return the result."""
    try:
        done = onboard(file, target, OnboardOptions(unsafe_fixes=True, render_images=False))
    except TerrainkitError as error:
        return Outcome(result=f"rejected: {str(error).replace(f'{file}: ', '')}")
    errors = {f"{f.code} {f.name}": None for f in done.report.findings if f.severity == "error"}
    if done.robot is None:
        blocking = {f"{f.code} {f.name}": None for f in filter(is_blocking, done.report.findings)}
        return Outcome(result=f"rejected: {', '.join(blocking)}")
    spec, mass = done.robot.spec, done.robot.facts.total_mass
    return Outcome(
        result="onboarded",
        legs=len(spec.feet),
        base="floating" if spec.floating else "fixed",
        actuators=str(len(spec.joint_order)),
        mass=f"{mass:.4g} kg" if mass > 0 else "",
        stands=stands(done.verification) if spec.feet and spec.floating else "",
        errors=", ".join(errors),
    )


def stands(verification: Verification | None) -> str:
    """Return the result of the standing test."""
    if verification is None or verification.standing is None:
        return (
            f"not simulated: {verification.error or verification.skipped}" if verification else ""
        )
    standing = verification.standing
    locked = ", locked joints" if verification.joints_locked else ""
    contacts = (
        f", {names(standing.other_contacts, 2)} on the ground" if standing.other_contacts else ""
    )
    tilt = f"{math.degrees(standing.tilt):.1f} degrees"
    return f"{'yes' if verification.is_stable else 'NO'}: {tilt}{locked}{contacts}"


def row(robot: Robot, outcome: Outcome) -> str:
    """Return a row of the table."""
    legs = str(outcome.legs or "")
    cells = (robot.file, robot.kind, outcome.result, legs, outcome.actuators, outcome.mass)
    more = (outcome.base, outcome.stands, outcome.errors)
    return f"| {' | '.join(text.replace('|', '/') for text in (*cells, *more))} |"


def page(found: Sequence[tuple[Robot, Outcome]], versions: dict[str, str]) -> Iterator[str]:
    """Yield the lines of field_robots.md."""
    results = Counter(outcome.result.partition(":")[0] for _, outcome in found)
    legged = [outcome for _, outcome in found if outcome.stands]
    stood = sum(outcome.stands.startswith("yes") for outcome in legged)
    told = ", ".join(f"{count} were {result}" for result, count in results.most_common())
    repositories = [f"{name} {commit}" for name, commit in versions.items() if "/" in name]
    yield ABOUT.format(
        count=len(found),
        pinned=" ".join(f"{name}=={each}" for name, each in versions.items() if "/" not in name),
        commits="\n".join(repositories),
        summary=f"{told}.\n{stood} of {len(legged)} robots with legs and a floating base stand.",
    )
    for package, number in versions.items():
        yield f"## {package} {number}\n"
        yield "| robot | kind | result | legs | actuators | mass | base | stands | errors |"
        yield "|---|---|---|---|---|---|---|---|---|"
        yield from (row(robot, outcome) for robot, outcome in found if robot.package == package)
        yield ""


def main() -> int:
    """Write the page; return 1 if a robot crashed the command or took too long."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--into", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.into is not None:
        sys.stdout.write(json.dumps(asdict(onboard_robot(options.folders[0], options.into))))
        return 0
    folders = options.folders
    listed, commits = robots()
    packages = {robot.package: commits.get(robot.package) for robot in listed}
    versions = {name: version(name, folders, commit) for name, commit in packages.items()}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        outcomes = pool.map(partial(onboard_in_subprocess, folders=folders), listed)
        found = list(zip(listed, outcomes, strict=True))
    (DOCS / "field_robots.md").write_text("\n".join(page(found, versions)))
    return int(any("**" in outcome.result for _, outcome in found))


if __name__ == "__main__":
    sys.exit(main())
