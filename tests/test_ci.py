"""The files that code hosts and pre-commit read, and docs/ci.md."""

import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

from terrainkit_cli.main import main
from terrainkit_cli.robot_commands import CheckRobot
from tests.robots import BOX

ROOT = Path(__file__).parent.parent
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
ACTION = yaml.safe_load((ROOT / "action.yml").read_text())
HOOKS = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())
PATH = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"


def steps(workflow):
    jobs = yaml.safe_load(workflow.read_text())["jobs"]
    return [step for job in jobs.values() for step in job["steps"]]


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.name)
def test_workflow_has_scripts_that_exist_and_least_permissions(workflow):
    commands = "\n".join(step.get("run", "") for step in steps(workflow))
    scripts = re.findall(r"^\.ci/\S+", commands, re.MULTILINE)
    assert scripts
    assert [each for each in scripts if not os.access(ROOT / each, os.X_OK)] == []
    document = yaml.safe_load(workflow.read_text())
    assert document["permissions"] == {"contents": "read"}
    jobs = document["jobs"].items()
    granted = {name: job["permissions"] for name, job in jobs if "permissions" in job}
    assert granted in ({}, {"publish": {"id-token": "write"}})
    pinned = re.compile(r"\./|[\w./-]+@(v\d+|release/v\d+|[0-9a-f]{40})")
    assert all(pinned.fullmatch(step.get("uses", "./")) for step in steps(workflow))


def test_workflow_has_declared_python_versions():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    matrix = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())
    versions = matrix["jobs"]["tests"]["strategy"]["matrix"]["python-version"]
    prefix = "Programming Language :: Python :: "
    declared = {c.removeprefix(prefix) for c in project["classifiers"] if c.startswith(prefix)}
    assert declared - {"3"} <= set(versions)


def test_scripts_are_valid_bash():
    scripts = [path for path in (ROOT / ".ci").glob("[!.]*") if path.suffix != ".cjs"]
    assert scripts
    for script in scripts:
        subprocess.run(["bash", "-n", script], check=True)


# The hook of pre-commit.


def test_hook_is_a_command_of_this_package():
    (hook,) = HOOKS
    assert hook["entry"] == "terrainkit check-robot --changed"
    assert "changed" in CheckRobot.__dataclass_fields__
    names = ["a.urdf", "b/c.urdf.xacro", "scene.xml", "hull.STL", "urdf/notes.md", "a.xmlx"]
    assert [name for name in names if re.search(hook["files"], name)] == names[:4]


# The action.


@pytest.fixture
def repository(tmp_path):
    """Return a repository whose HEAD is the merge of a pull request that changes one robot."""
    folder = tmp_path / "repository"
    (folder / "robots").mkdir(parents=True)

    def git(*words):
        identity = ("-c", "user.name=a", "-c", "user.email=a@localhost")
        subprocess.run(["git", *identity, *words], cwd=folder, check=True, capture_output=True)

    git("init", "--initial-branch", "main")
    for name, mass in {"old bad": -1, "new": 1, "good": 1}.items():
        (folder / "robots" / f"{name}.urdf").write_text(BOX.format(name=name[:3], mass=mass))
    git("add", ".")
    git("commit", "--message", "first")
    git("switch", "--create", "feature")
    (folder / "robots/new.urdf").write_text(BOX.format(name="new", mass=-3))
    git("commit", "--all", "--message", "second")
    git("switch", "main")
    git("merge", "--no-ff", "feature")
    return folder


@pytest.fixture
def act(repository, tmp_path):
    """Run the step `check` as a runner does; return the process and the outputs of the step."""
    (step,) = (step for step in ACTION["runs"]["steps"] if step.get("id") == "check")
    output = tmp_path / "output"
    words = {
        name: re.fullmatch(r"\$\{\{ inputs\.([\w-]+) \}\}", text)[1]
        for name, text in step["env"].items()
    }
    fixed = {
        "GITHUB_ACTION_PATH": str(ROOT),
        "GITHUB_OUTPUT": str(output),
        "RUNNER_TEMP": str(tmp_path),
    }

    def run(event="pull_request", **inputs):
        values = {name: each["default"] for name, each in ACTION["inputs"].items()} | inputs
        given = {name: values[word] for name, word in words.items()}
        output.write_text("")
        variables = {**given, **fixed, "GITHUB_EVENT_NAME": event}
        done = bash(step["run"], repository, "-e", "-o", "pipefail", **variables)
        return done, dict(line.split("=", 1) for line in output.read_text().splitlines())

    return run


def bash(script, folder, *options, **variables):
    return subprocess.run(
        ["bash", *options, "-c", script],
        cwd=folder,
        env=os.environ | {"PATH": PATH} | variables,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def results(outputs):
    (run,) = json.loads(Path(outputs["sarif-file"]).read_text())["runs"]
    return [
        (result["ruleId"], result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"])
        for result in run["results"]
    ]


NEW, OLD = ("INR002", "robots/new.urdf"), ("INR002", "robots/old%20bad.urdf")


@pytest.mark.parametrize(
    ("event", "shallow", "expected"),
    [
        ("pull_request", False, [NEW]),
        ("push", False, [NEW, OLD]),
        ("pull_request", True, [NEW, OLD]),
    ],
)
def test_action_checks_changed_or_all_robots(act, repository, event, shallow, expected):
    if shallow:
        head = (repository / ".git/refs/heads/main").read_text()
        (repository / ".git/shallow").write_text(head)
    # Modules of the repository are not imported.
    (repository / "json.py").write_text("raise SystemExit('executed')")
    done, outputs = act(event, args="--select INR002")
    assert done.returncode == 1, done.stderr
    assert "\nerror INR002 negative-mass\n" in done.stdout
    assert ("Checking all robots." in done.stdout) == (OLD in expected)
    assert results(outputs) == expected


def test_action_runs_no_module_of_the_repository():
    for step in ACTION["runs"]["steps"]:
        assert not re.search(r"\bpython\b\W* -(?!I)", step.get("run", ""), re.IGNORECASE)


def test_action_accepts_baseline_and_quoted_options(act, repository):
    baseline = {"version": 1, "robots": {"robots/new.urdf": {"INR002": ["trunk"]}}}
    (repository / "robots.baseline.json").write_text(json.dumps(baseline))
    options = "--select INR002,DYN --ignore 'DYN=too slow'"
    done, outputs = act(baseline="robots.baseline.json", args=options)
    assert done.returncode == 0, done.stderr
    assert "accepted in robots.baseline.json" in done.stdout
    assert "ignored: too slow" in done.stdout
    assert results(outputs) == []


def test_action_without_upload_prints_annotations(act):
    done, outputs = act(**{"upload-sarif": "false", "args": "--select INR002"})
    assert (done.returncode, outputs) == (1, {})
    assert "::error file=robots/new.urdf,line=3,title=INR002 negative-mass::" in done.stdout


def test_action_finds_suffixes_in_capitals_or_no_robots(act, repository):
    done, outputs = act("push", paths="'robots/good.urdf' ':!robots'")
    assert (done.returncode, outputs) == (0, {})
    assert done.stdout.endswith("No files.\n")
    (repository / "robots/new.urdf").rename(repository / "robots/new.URDF")
    subprocess.run(["git", "add", "."], cwd=repository, check=True)
    _, outputs = act("push", paths="robots/new.URDF", args="--select INR002")
    assert results(outputs) == [("INR002", "robots/new.URDF")]


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"args": "--selekt INR002"}, "no option --selekt"),
        ({"args": "--ignore INR002=don't"}, "unmatched single quote"),
        ({"paths": ":(unknown)"}, "Invalid pathspec magic"),
        ({"baseline": "none.json"}, "there is no file none.json"),
    ],
)
def test_action_reports_invalid_inputs(act, inputs, message):
    done, outputs = act(**inputs)
    assert done.returncode > 0
    assert outputs == {}
    assert message in done.stderr


# docs/ci.md.

PAGE = (ROOT / "docs/ci.md").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def test_page_shows_hook_action_and_job():
    hook, workflow, job = map(yaml.safe_load, blocks("yaml"))
    assert [each["id"] for each in hook["repos"][0]["hooks"]] == [each["id"] for each in HOOKS]
    (step,) = (s for s in workflow["jobs"]["check-robot"]["steps"] if "terrainkit" in s["uses"])
    assert set(step["with"]) <= set(ACTION["inputs"])
    assert len(job["check-robot"]["script"]) == 2
    listed = re.findall(r"^\| `([\w-]+)` \| (?:`(.*?)`)? ?\|", PAGE, re.MULTILINE)
    assert dict(listed) == {name: each["default"] for name, each in ACTION["inputs"].items()}


def test_page_baseline_commands_write_the_example(repository, monkeypatch, capsys):
    monkeypatch.chdir(repository)
    for path in Path("robots").iterdir():
        path.unlink()
    Path("robots/arm.urdf").write_text(
        BOX.format(name="arm", mass=-1).replace("trunk", "upper_link")
    )
    (commands,), (example,) = blocks("sh"), blocks("json")
    for line in commands.splitlines():
        words = shlex.split(line.replace("robots/*.urdf", "robots/arm.urdf"))
        assert main(words[1:]) == 0
    assert "1 finding accepted in robots.baseline.json" in capsys.readouterr().out
    assert Path("robots.baseline.json").read_text() == example


def test_page_job_of_gitlab_checks_changed_robots(repository):
    job = yaml.safe_load(blocks("yaml")[2])["check-robot"]
    (repository / "robots.baseline.json").write_text('{"version": 1, "robots": {}}')
    script = "\n".join(job["script"])
    done = bash(script, repository, "-e", CI_MERGE_REQUEST_DIFF_BASE_SHA="HEAD^1")
    assert done.returncode == 123, done.stderr  # xargs, of the exit code 1
    assert done.stdout.startswith("robots/new.urdf\n")
