"""Onboard robots of Python packages and public repositories, and write docs/field_robots.md.

python docs/field_robots.py FOLDER...    each folder holds unpacked wheels and checkouts
    --results FOLDER    keep the result of each robot there, and use those that are there

The robots are listed in field_robots.toml. None of their files is kept.
"""

import argparse
import hashlib
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

from published_gains import read_published, values_of

from terrainkit.errors import TerrainkitError
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.onboarding.onboard_options import OnboardOptions
from terrainkit_robots.onboarding.pipeline import onboard
from terrainkit_robots.onboarding.result import OnboardResult
from terrainkit_robots.onboarding.verify import Verification
from terrainkit_robots.simulation.assessment import assess
from terrainkit_robots.simulation.pd_gains import suggest_gains
from terrainkit_robots.simulation.standing import StandResult
from terrainkit_robots.text import names

DOCS = Path(__file__).parent
SECONDS = 600

OPTIONS = OnboardOptions(unsafe_fixes=True, render_images=False)

ABOUT = """\
# Robots of the field

<!-- Written by docs/field_robots.py: change that or docs/field_robots.toml, not this file. -->

Results of `terrainkit onboard FILE -o OUT --unsafe-fixes --no-pictures` for unmodified robots of
Python packages and of public repositories: {count} files, of which {legged} describe robots with
legs. {summary}

- **onboarded**: the folder was written; `robot.urdf` and `robot.xml` load in MuJoCo and match the
  source (link positions within 0.1 mm at 100 poses, mass within 0.1 %).
- **rejected**: nothing was written. Rule codes are errors in the XML, the tree, joints, meshes or
  masses, which `--force` ignores. Other errors do not prevent onboarding.
- **actuators**: number of actuated joints; tendon actuators are omitted.
- **stands**: whether a robot with legs and a floating base stands for 5 s: with three or more legs
  with the suggested gains (tilt under 3 degrees, only feet touch the ground), with fewer legs with
  locked joints.
- **notes**: rules whose findings are errors, then what reading the file showed about a result.

The repositories were read without their files of 4 MiB and more, so that large visual meshes are
missing (MSH001).

All rows are of 2026-11-29.

To reproduce the tables:

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

| package | robot | kind | result | legs | actuators | mass | base | stands | notes |
|---|---|---|---|---|---|---|---|---|---|"""

ABOUT_PUBLISHED = """\
## Published gains and poses

The robots above whose gains or pose are published, by their makers or in a collection for
training, or declared in the file by position actuators and keyframes. Each was onboarded once more
with these values in `robot.toml` (`--spec`). {summary}

- **stiffness**, **damping**: suggested over published, median (smallest to largest joint).
- **pose**: the largest difference of a joint between the solved pose and the published one, or the
  first keyframe of the file, in rad or m; nothing if no pose is published.
- **stands as published**: with fewer than three legs with locked joints, then with released joints
  and the published gains, where most robots need a controller.

| package | robot | published in | stiffness | damping | pose | stands as published |
|---|---|---|---|---|---|---|"""

LEGGED = ("quadruped", "biped", "hexapod", "leg")
"""Words in the kinds of robots with legs."""


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A robot file in a package."""

    package: str
    under: str
    file: str
    kind: str
    published: str = ""
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The result of onboarding a robot, and how its published gains compare, if there are any."""

    result: str
    legs: int = 0
    actuators: str = ""
    mass: str = ""
    base: str = ""
    stands: str = ""
    errors: str = ""
    stiffness_ratio: str = ""
    damping_ratio: str = ""
    pose_difference: str = ""
    stands_as_published: str = ""


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


def measure(robot: Robot, folders: Sequence[Path], results: Path | None) -> Outcome:
    """Return the kept result of a robot, else onboard it and keep the result."""
    if results is None:
        return onboard_in_subprocess(robot, folders)
    key = f"{robot.package} {robot.file} {robot.published}"
    kept = results / f"{hashlib.sha256(key.encode()).hexdigest()[:16]}.json"
    if kept.exists():
        return Outcome(**json.loads(kept.read_text()))
    outcome = onboard_in_subprocess(robot, folders)
    kept.write_text(json.dumps(asdict(outcome)))
    return outcome


def onboard_in_subprocess(robot: Robot, folders: Sequence[Path]) -> Outcome:
    """Onboard a robot in a subprocess, into a temporary folder."""
    places = [folder / robot.under / robot.file for folder in folders]
    found = next((place for place in places if place.exists()), None)
    if found is None:
        return Outcome(result="not in the package")
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.executable, __file__, "--into", str(Path(scratch) / "robot"), str(found)]
        if robot.published:
            file = robot.published.partition(":")[0]
            folder = next(folder for folder in folders if (folder / file).exists())
            command += ["--published", str(folder / robot.published)]
        try:
            run = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS)
        except subprocess.TimeoutExpired:
            return Outcome(result=f"**took more than {SECONDS} s**")
    if run.returncode:
        return Outcome(result="**crashed**")
    return Outcome(**json.loads(run.stdout))


def onboard_robot(file: Path, target: Path, published: Path | None) -> Outcome:
    """Onboard a robot without pictures, and return the result."""
    try:
        done = onboard(file, target, OPTIONS)
    except TerrainkitError as error:
        return Outcome(result=f"rejected: {str(error).replace(f'{file}: ', '')}")
    errors = {f"{f.code} {f.name}": None for f in done.report.findings if f.severity == "error"}
    if done.robot is None:
        blocking = {f"{f.code} {f.name}": None for f in done.report.findings if f.is_blocking}
        return Outcome(result=f"rejected: {', '.join(blocking)}")
    spec, mass = done.robot.spec, done.robot.facts.total_mass
    legged = bool(spec.feet) and spec.floating
    outcome = Outcome(
        result="onboarded",
        legs=len(spec.feet),
        base="floating" if spec.floating else "fixed",
        actuators=str(len(spec.joint_order)),
        mass=f"{mass:.4g} kg" if mass > 0 else "",
        stands=stands(done.verification) if legged else "",
        errors=", ".join(errors),
    )
    return with_published(outcome, file, target, done, published) if legged else outcome


def with_published(
    outcome: Outcome, file: Path, target: Path, done: OnboardResult, place: Path | None
) -> Outcome:
    """Return the outcome with the comparison to published values: in a place, else in the file."""
    assert done.robot is not None
    spec, source = done.robot.spec, done.report.facts
    ours = {name: spec.per_joint(name) for name in ("default_pose", "stiffness", "damping")}
    keyframe = source.model.keyframe
    is_declared = any(p.origin == "declared" for k, p in spec.provenance.items() if "stiff" in k)
    theirs = {name: ours[name] if is_declared else {} for name in ours}
    theirs["default_pose"] = {j: keyframe[j] for j in spec.joint_order if j in keyframe}
    if place is not None:
        published = read_published(place)
        theirs = {name: values_of(published[name], spec.joint_order) for name in ours}
    if not any(theirs.values()):
        return outcome
    edited = replace(spec, **{name: {**ours[name], **theirs[name]} for name in ours})
    edited = replace(edited, spawn_height=None, base_height_target=None)  # of the solved pose
    toml = target.parent / "published.toml"
    toml.write_text(edited.to_toml())
    try:
        again = onboard(file, target.parent / "published", replace(OPTIONS, spec=toml)).verification
        stood = stands(again, released=True)
    except TerrainkitError as error:
        stood = f"rejected: {str(error).replace(f'{toml}: ', '')}"
    gains = suggest_gains(done.robot.facts)
    pose = Facts(replace(source.model, keyframe={}), source.meshes).default_pose
    differences = {j: abs(pose.get(j, q) - q) for j, q in theirs["default_pose"].items()}
    joint = max(differences, key=differences.__getitem__, default="")
    return replace(
        outcome,
        stiffness_ratio=ratios((gains[j].stiffness, kp) for j, kp in theirs["stiffness"].items()),
        damping_ratio=ratios((gains[j].damping, kd) for j, kd in theirs["damping"].items()),
        pose_difference=f"{differences[joint]:.2f} ({joint})" if joint else "",
        stands_as_published=stood,
    )


def ratios(pairs: Iterable[tuple[float, float]]) -> str:
    """Return the median, the least and the largest of suggested over published values."""
    found = sorted(ours / theirs for ours, theirs in pairs if theirs > 0)
    if not found:
        return ""
    middle, low, high = (
        f"{ratio:.2g}" for ratio in (statistics.median(found), found[0], found[-1])
    )
    return middle if low == high else f"{middle} ({low} to {high})"


def stands(verification: Verification | None, *, released: bool = False) -> str:
    """Return the result of the standing test, and that with released joints if asked for."""
    if verification is None or verification.standing is None:
        return (
            f"not simulated: {verification.error or verification.skipped}" if verification else ""
        )
    text = stand_text(verification.standing) + ", locked joints" * verification.joints_locked
    if released and verification.free_standing is not None:
        text += f"; released {stand_text(verification.free_standing)}"
    return text


def stand_text(standing: StandResult) -> str:
    """Return whether a robot stood, its tilt, and what touched the ground or else failed."""
    failures = assess(standing).failures
    why = "".join(f", {failure.partition(' (expected')[0]}" for failure in failures)
    if standing.other_contacts:
        why = f", {names(standing.other_contacts, 2)} on the ground"
    elif math.degrees(standing.tilt) > 3:
        why = ""
    return f"{'NO' if failures else 'yes'}: {math.degrees(standing.tilt):.1f} degrees{why}"


def row(*cells: str) -> str:
    """Return a row of a table."""
    return f"| {' | '.join(text.replace('|', '/') for text in cells)} |"


def page(found: Sequence[tuple[Robot, Outcome]], versions: dict[str, str]) -> Iterator[str]:
    """Yield the lines of field_robots.md."""
    results = Counter(outcome.result.partition(":")[0] for _, outcome in found)
    tested = [o.stands for _, o in found if o.stands and "not simulated" not in o.stands]
    others = sum("not simulated" in outcome.stands for _, outcome in found)
    told = ", ".join(f"{count} were {result}" for result, count in results.most_common())
    repositories = [f"{name} {commit}" for name, commit in versions.items() if "/" in name]
    yield ABOUT.format(
        count=len(found),
        legged=sum(any(word in robot.kind for word in LEGGED) for robot, _ in found),
        pinned=" ".join(
            f"{name}=={version}" for name, version in versions.items() if "/" not in name
        ),
        commits="\n".join(repositories),
        summary=f"{told}.\n{stood(tested)} of {len(tested)} tested robots stand; {others} stand "
        "only with a controller, or have too many joints to simulate, and were not tested.",
    )
    for robot, o in found:
        notes = "; ".join(filter(None, (o.errors, robot.note)))
        legs = str(o.legs or "")
        cells = (robot.kind, o.result, legs, o.actuators, o.mass, o.base, o.stands, notes)
        yield row(robot.package, robot.file, *cells)
    yield ""
    yield from published_table([(robot, o) for robot, o in found if o.stands_as_published])


def published_table(found: Sequence[tuple[Robot, Outcome]]) -> Iterator[str]:
    """Yield the lines of the table of published gains."""
    texts = [outcome.stands_as_published for _, outcome in found]
    locked = [text for text in texts if "locked" in text]
    free = [text for text in texts if "locked" not in text and "not simulated" not in text]
    released = sum("released yes" in text for text in locked)
    yield ABOUT_PUBLISHED.format(
        summary=f"Of {len(found)} robots, {stood(free)} of {len(free)} with three or more legs "
        f"stand as\npublished, and {stood(locked)} of {len(locked)} with fewer legs stand with "
        f"locked joints, {released} of them also with released joints."
    )
    for robot, o in found:
        place = robot.published or "the file"
        values = (o.stiffness_ratio, o.damping_ratio, o.pose_difference, o.stands_as_published)
        yield row(robot.package, robot.file, place, *values)
    yield ""


def stood(texts: Sequence[str]) -> int:
    """Return how many of the results are that the robot stood."""
    return sum(text.startswith("yes") for text in texts)


def main() -> int:
    """Write the page; return 1 if a robot crashed the command or took too long."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--results", type=Path, metavar="FOLDER")
    parser.add_argument("--into", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--published", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.into is not None:
        outcome = onboard_robot(options.folders[0], options.into, options.published)
        sys.stdout.write(json.dumps(asdict(outcome)))
        return 0
    if options.results is not None:
        options.results.mkdir(parents=True, exist_ok=True)
    folders = options.folders
    listed, commits = robots()
    packages = dict.fromkeys(robot.package for robot in listed) | commits
    versions = {name: version(name, folders, commit) for name, commit in packages.items()}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        outcomes = pool.map(partial(measure, folders=folders, results=options.results), listed)
        found = list(zip(listed, outcomes, strict=True))
    (DOCS / "field_robots.md").write_text("\n".join(page(found, versions)))
    return int(any("**" in outcome.result for _, outcome in found))


if __name__ == "__main__":
    sys.exit(main())
