"""The summary: what was done to bring a robot in, step by step, a line each."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from terrainkit_robots.lint.report.summary import count, summarize_findings
from terrainkit_robots.onboarding.equivalence import POSES
from terrainkit_robots.text import names

if TYPE_CHECKING:
    from terrainkit_robots.onboarding.pipeline import BroughtIn
    from terrainkit_robots.onboarding.robot_files import Onboarded
    from terrainkit_robots.onboarding.verify import Proof


def summary(done: "BroughtIn") -> Iterator[tuple[str, str]]:
    """Yield what was done: a word and a sentence each."""
    yield "checked", summarize_findings([done.report])
    if done.repaired:
        codes = dict.fromkeys(finding.code for finding in done.repaired)
        yield "repaired", f"{count(len(done.repaired), 'defect')}: {names(codes)}"
    if done.made is None or done.proof is None:
        return
    yield "wrote", _files(done.made)
    yield "agrees", _agreement(done.proof)
    yield "stands", _standing(done.proof, done.made)
    if done.configs:
        yield "configs", names(done.configs)
    drawn = f"{count(len(done.pictures), 'picture')} in report.md"
    yield "pictures", drawn if done.pictures else f"none: {done.no_pictures}"
    if done.kept:
        yield "kept", f"what was edited before, as {names(done.kept)}; --spec takes values"
    missing = sum(finding.code == "MSH001" for finding in done.report.findings)
    if missing:
        yield "missing", f"{count(missing, 'mesh')}; --package NAME=DIR tells where a package is"
    if done.made.notes:
        yield "noted", f"{count(len(done.made.notes), 'thing')} left out or changed: see report.md"


def _files(made: "Onboarded") -> str:
    meshes = [data for name, data in made.files.items() if "/" in name]
    texts = [name for name in made.files if "/" not in name]
    size = sum(map(len, meshes)) / 1e6
    more = f", {count(len(meshes), 'mesh file')} ({size:.1f} MB)" if meshes else ""
    return f"{names(texts)}{more}"


def _agreement(proof: "Proof") -> str:
    distance = max(each.distance for each in proof.agreements)
    mass = max(abs(each.mass) for each in proof.agreements)
    files = " and ".join(each.file for each in proof.agreements)
    return (
        f"{files} with what was read: links within {1000 * distance:.2g} mm over {POSES} poses, "
        f"mass within {mass:.2g}"
    )


def _standing(proof: "Proof", made: "Onboarded") -> str:
    seen = proof.standing
    if proof.unknown:
        return f"not known: {proof.unknown}"
    if seen is None:
        return f"not asked: it has {'a fixed base' if made.facts.legs else 'no legs'}"
    held = "with its joints held, since two legs do not balance alone"
    how = held if proof.locked else "with the gains of robot.toml"
    tilt = f"tilt {math.degrees(seen.tilt):.1f} degrees"
    if proof.faults:
        return f"NO: {seen.seconds:g} s {how}; {'; '.join(proof.faults)}"
    return f"yes: {seen.seconds:g} s {how}, {tilt}, only its feet touch"
