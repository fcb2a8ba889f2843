"""The files that code hosts and pre-commit read, and docs/ci.md."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from functools import partial
from pathlib import Path

import pytest
import yaml

from terrainkit_cli.main import main
from terrainkit_cli.robot_commands import CheckRobot
from tests.robots import BOX

ROOT = Path(__file__).parent.parent
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
PERMISSIONS = {
    "release.yml": {"publish": {"id-token": "write"}},
    "docs.yml": {"deploy": {"id-token": "write", "pages": "write"}},
}
"""Permissions of the jobs of a workflow, besides reading the repository."""

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
    assert granted == PERMISSIONS.get(workflow.name, {})
    pinned = re.compile(r"\./|[\w./-]+@(v\d+|release/v\d+|[0-9a-f]{40})")
    assert all(pinned.fullmatch(step.get("uses", "./")) for step in steps(workflow))


def test_containers_run_the_commands_of_the_readme():
    commands = re.findall(r"^pip install .* && .*$", (ROOT / "README.md").read_text(), re.MULTILINE)
    text = (ROOT / ".devcontainer/devcontainer.json").read_text()
    container = json.loads(re.sub(r"^//.*$", "", text, flags=re.MULTILINE))
    assert f"RUN {commands[0]}\n" in (ROOT / "Dockerfile").read_text()
    assert container["postCreateCommand"] == commands[1]
    assert f"AS {container['build']['target']}\n" in (ROOT / "Dockerfile").read_text()


def test_api_check_finds_what_breaks(tmp_path):
    for folder in ("terrainkit", "robots/terrainkit_robots", ".ci"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    changelog = tmp_path / "CHANGELOG.md"
    changelog.write_text("### What breaks\n\n- `torques` is gone.\n\n### Added\n")
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@b.c"]
    for words in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "First"]):
        subprocess.run([*git, *words], cwd=tmp_path, check=True)
    for path, old, new in (
        ("terrainkit/map/terrain_map.py", "def assign(self, num_envs", "def assign(self, num"),
        ("terrainkit/map/map_config.py", "    rows: Count", "    lines: Count"),
        ("terrainkit/perception/height_scan.py", "def below(", "def under("),
        ("terrainkit/views/preview.py", "def render_preview(", "def render("),  # not public
        ("terrainkit/__init__.pyi", "import Flight as Flight", "import Flight as _Flight"),
        ("robots/terrainkit_robots/rl/rewards.py", "def torques(", "def torque("),
        ("robots/terrainkit_robots/rl/rewards.py", "def collision(", "def collisions("),
    ):
        text = (tmp_path / path).read_text()
        assert old in text
        (tmp_path / path).write_text(text.replace(old, new, 1))
    check = partial(subprocess.run, [sys.executable, ".ci/api"], cwd=tmp_path, text=True)
    done = check(capture_output=True)
    assert done.returncode == 1
    assert {*re.findall(r"^\S+ ([\w.]+)", done.stdout, re.MULTILINE)[:-1]} == {
        *("MapConfig.__init__", "MapConfig.rows", "TerrainMap.assign"),
        *("HeightScan.below", "Flight", "collision"),
    }
    names = "`MapConfig`, `rows`, `assign`, `below`, `Flight`, `torques`, `collision`"
    changelog.write_text(f"### What breaks\n\n{names}\n\n### Added\n")
    assert check(capture_output=True).returncode == 0


@pytest.mark.parametrize(
    ("subject", "code"),
    [
        ("Reject inverted limits", 0),
        ("reject inverted limits", 1),
        ("Reject inverted limits.", 1),
        (f"R{71 * 'e'}", 0),
        (f"R{72 * 'e'}", 1),
        ("", 1),
    ],
)
def test_subject_of_a_commit_is_checked(tmp_path, subject, code):
    (tmp_path / "message").write_text(f"{subject}\n\nThe body may be longer.\n# a comment\n")
    done = subprocess.run([ROOT / ".ci/subject", tmp_path / "message"], capture_output=True)
    assert done.returncode == code


def test_workflow_has_declared_python_versions():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    matrix = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())
    versions = matrix["jobs"]["tests"]["strategy"]["matrix"]["python-version"]
    prefix = "Programming Language :: Python :: "
    declared = {c.removeprefix(prefix) for c in project["classifiers"] if c.startswith(prefix)}
    assert declared - {"3"} <= set(versions)


def test_scripts_are_valid_bash():
    files = (ROOT / ".ci").glob("[!.]*")
    scripts = [path for path in files if path.read_text().startswith("#!/usr/bin/env bash\n")]
    assert scripts
    for script in scripts:
        subprocess.run(["bash", "-n", script], check=True)


# A repository, and one with names that are options, commands of a log, or pathspecs of git.

HOSTILE_LINK = f"trunk {'a' * 90} ::error::link ##[warning]link"
"""Name of a link whose second half begins a line of the text report."""

OPTIONS = (
    "--output=../evil.xml",  # the folder `--output=..`
    "--baseline=x.xml",
    "--write-baseline",
    "--help",
    "-h",
    "-",
    "--diff",
    "-o..",
)
"""Names of files that are words of a command line."""

HOSTILE_NAMES = (
    *OPTIONS,
    "a\n::error::b.urdf",
    "a\r::error::c.urdf",
    "::warning::d.urdf",
    "  ::notice::e.urdf",
    "##[error]f.urdf",
    "spaces  and 'quotes\".urdf",
    "%0A::error::g%25.urdf",
    "\u2028::error::\u6a5f.urdf",
    f"{'long ' * 49}.urdf",
    ":(exclude)h.urdf",
    ":!i.urdf",
    "$(touch evil) `touch evil`;.urdf",
    "HEAD",
)


def git(folder, *words):
    identity = ("-c", "user.name=a", "-c", "user.email=a@localhost")
    subprocess.run(["git", *identity, *words], cwd=folder, check=True, capture_output=True)


@pytest.fixture
def repository(tmp_path):
    """Return a repository whose HEAD is the merge of a pull request that changes one robot."""
    folder = tmp_path / "repository"
    (folder / "robots").mkdir(parents=True)
    git(folder, "init", "--initial-branch", "main")
    for name, mass in {"old bad": -1, "new": 1, "good": 1}.items():
        (folder / "robots" / f"{name}.urdf").write_text(BOX.format(name=name[:3], mass=mass))
    git(folder, "add", ".")
    git(folder, "commit", "--message", "first")
    git(folder, "switch", "--create", "feature")
    (folder / "robots/new.urdf").write_text(BOX.format(name="new", mass=-3))
    git(folder, "commit", "--all", "--message", "second")
    merge(folder, "feature")
    return folder


def merge(folder, branch):
    git(folder, "switch", "main")
    git(folder, "merge", "--no-ff", branch)


@pytest.fixture
def hostile(repository):
    """Return a function that merges a pull request of robots with hostile names, of a mass [kg]."""

    def build(mass, names=HOSTILE_NAMES):
        git(repository, "switch", "--create", "hostile")
        git(repository, "rm", "-r", "robots")
        write_robots(repository, mass, names)
        # A job that writes the file `changed` writes another one.
        (repository / "changed").symlink_to("../evil")
        git(repository, "add", ".")
        git(repository, "commit", "--message", "third")
        merge(repository, "hostile")
        return repository

    return build


def write_robots(folder, mass, names):
    """Write robots, a baseline that accepts nothing, and x.xml, which accepts a negative mass."""
    robots = [*names, "robots/last.urdf"]
    for path in (folder / name for name in robots):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(BOX.format(name="box", mass=mass).replace("trunk", HOSTILE_LINK))
    accepted = {name: {"INR002": [HOSTILE_LINK]} for name in robots}
    for name, entries in {"robots.baseline.json": {}, "x.xml": accepted}.items():
        (folder / name).write_text(json.dumps({"version": 1, "robots": entries}))


def contents(folder):
    """Return the contents of all files, other than those of git and the step of the action."""
    files = (path for path in folder.rglob("*") if path.is_file() and ".git" not in path.parts)
    return {path: path.read_bytes() for path in files if not path.name.startswith("terrainkit.")}


def commands(log):
    """Return name, properties and text of the commands that GitHub's runner reads in a log.

    As in ActionCommand.cs and ActionCommandManager.cs of actions/runner, but any name is a command.
    """
    found, token = [], None
    for line in re.split(r"\r\n|\r|\n", log):
        command = re.match(r"\s*::([^\s:]*)(.*?)::(.*)", line)
        command = command or re.search(r"##\[([^\s\]]*)(.*?)\](.*)", line)
        if command is None:
            continue
        name, _, text = command.groups()
        if token is not None:
            token = None if name == token else token
        elif name == "stop-commands":
            token = text
        else:
            found.append(command.groups())
    assert token is None
    return found


# The hook of pre-commit.


def test_hook_is_a_command_of_this_package():
    (hook,) = HOOKS
    assert hook["entry"] == "terrainkit check-robot --changed"
    assert hook["args"] == ["--"]
    assert "changed" in CheckRobot.__dataclass_fields__
    names = ["a.urdf", "b/c.urdf.xacro", "scene.xml", "hull.STL", "urdf/notes.md", "a.xmlx"]
    assert [name for name in names if re.search(hook["files"], name)] == names[:4]


BASELINE = "--baseline=robots.baseline.json"


def run_hook(files, **config):
    """Run the hook: pre-commit joins `entry`, the `args` of the hook or the user, and the files."""
    hook = HOOKS[0] | config
    return main([*shlex.split(hook["entry"])[1:], *hook["args"], *files])


@pytest.mark.parametrize("config", [{}, {"args": [BASELINE, "--"]}])
@pytest.mark.parametrize(("mass", "code"), [(-1, 1), (1, 0)])
@pytest.mark.parametrize("name", HOSTILE_NAMES)
def test_hook_takes_no_name_for_an_option(tmp_path, monkeypatch, config, mass, code, name):
    folder = tmp_path / "repository"
    write_robots(folder, mass, [name])
    before = contents(tmp_path)
    monkeypatch.chdir(folder)
    assert run_hook([name, "robots/last.urdf"], **config) == code
    assert contents(tmp_path) == before


@pytest.mark.parametrize("args", [[BASELINE], ["--baseline", "robots.baseline.json", "--strict"]])
@pytest.mark.parametrize("name", HOSTILE_NAMES)
def test_hook_rejects_names_of_options_after_args_without_dashes(
    tmp_path, monkeypatch, capsys, args, name
):
    folder = tmp_path / "repository"
    write_robots(folder, -1, [name])
    before = contents(tmp_path)
    monkeypatch.chdir(folder)
    is_option = name in OPTIONS and name != "-"
    assert run_hook([name, "robots/last.urdf"], args=args) == (2 if is_option else 1)
    message = f"error: {name}: got an option that is also a file; expected -- between"
    assert (message in capsys.readouterr().err) == is_option
    assert contents(tmp_path) == before


@pytest.mark.parametrize("args", [None, [BASELINE, "--"]])
@pytest.mark.parametrize(("mass", "code"), [(-1, 1), (1, 0)])
def test_hook_checks_hostile_names_in_pre_commit(hostile, tmp_path, args, mass, code):
    folder = hostile(mass)
    # The environments of other languages need a network.
    hook = HOOKS[0] | {"language": "system"} | ({} if args is None else {"args": args})
    (tmp_path / "hooks.yaml").write_text(
        yaml.safe_dump({"repos": [{"repo": "local", "hooks": [hook]}]})
    )
    before = contents(tmp_path)
    words = "run check-robot --all-files --verbose --config ../hooks.yaml"
    command = f"{shlex.quote(sys.executable)} -m pre_commit {words}"
    done = bash(command, folder, PRE_COMMIT_HOME=str(tmp_path / ".git" / "pre-commit"))
    assert done.returncode == code, done.stdout
    assert ("- exit code: 1\n" in done.stdout) == bool(code)
    assert contents(tmp_path) == before


# The action.


@pytest.fixture
def act(repository, tmp_path):
    """Run the step `check` as a runner does; return the process and the outputs of the step."""
    (step,) = (step for step in ACTION["runs"]["steps"] if step.get("id") == "check")
    output = tmp_path / "terrainkit.output"
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


def test_action_checks_the_robots_of_a_renamed_mesh(act, repository):
    robot = BOX.format(name="mesh", mass=1)
    shape = re.search(r"<(box|sphere)[^>]*/>", robot)[0]
    (repository / "robots/mesh.urdf").write_text(robot.replace(shape, '<mesh filename="a.obj"/>'))
    (repository / "robots/a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    git(repository, "add", ".")
    git(repository, "commit", "--message", "mesh")
    git(repository, "switch", "--create", "rename")
    git(repository, "mv", "robots/a.obj", "robots/b.obj")
    git(repository, "commit", "--message", "rename")
    merge(repository, "rename")
    done, outputs = act(args="--select MSH001")
    assert done.returncode == 1, done.stdout
    assert {file for _, file in results(outputs)} == {"robots/mesh.urdf"}


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
        ({"args": "--baseline"}, "--baseline: too few values"),
        ({"baseline": "none.json"}, "there is no file none.json"),
    ],
)
def test_action_reports_invalid_inputs(act, inputs, message):
    done, outputs = act(**inputs)
    assert done.returncode > 0
    assert outputs == {}
    assert message in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("event", "upload", "mass", "code"),
    [
        ("pull_request", "true", -1, 1),
        ("pull_request", "false", -1, 1),
        ("push", "true", -1, 1),
        ("push", "false", -1, 1),
        ("pull_request", "false", 1, 0),
    ],
)
def test_action_log_has_no_commands_of_names(act, hostile, tmp_path, upload, event, mass, code):
    hostile(mass)
    before = contents(tmp_path)
    inputs = {"upload-sarif": upload, "baseline": "robots.baseline.json"}
    done, _ = act(event, args="--select INR002", **inputs)
    assert done.returncode == code, done.stdout
    assert contents(tmp_path) == before
    assert commands(done.stderr) == []
    robots = {name for name in HOSTILE_NAMES if name.endswith((".urdf", ".xml"))}
    found = commands(done.stdout)
    if upload == "true" or mass > 0:
        assert found == []
        return
    assert {name for name, _, _ in found} == {"error"}
    properties = [re.match(r" file=([^,]*),line=3,title=INR002 ", text)[1] for _, text, _ in found]
    assert {unescape(name) for name in properties} == {*robots, "robots/last.urdf"}
    assert all(unescape(text).startswith(f"mass of link {HOSTILE_LINK}") for _, _, text in found)


@pytest.mark.parametrize("upload", ["true", "false"])
def test_action_error_has_no_commands_of_names(act, hostile, upload):
    folder = hostile(1)
    (folder / "##[error]f").mkdir()
    (folder / "robots").rename(folder / "##[error]f/robots")
    (folder / "##[error]f/terrainkit.toml").write_text("[check-robot]\nselekt = 1\n")
    done, _ = act(**{"upload-sarif": upload})
    assert done.returncode == 2
    assert "##[error]f/terrainkit.toml: config has no key" in done.stdout
    assert commands(done.stdout) == commands(done.stderr) == []


def unescape(text):
    """Return a property or a text of a command, as the runner reads it."""
    for escape, character in {"%0D": "\r", "%0A": "\n", "%3A": ":", "%2C": ","}.items():
        text = text.replace(escape, character)
    return text.replace("%25", "%")


@pytest.mark.parametrize("upload", ["true", "false"])
@pytest.mark.parametrize(("victim", "code"), [("$$", 137), ("$PPID", -9)])
def test_action_that_is_ended_leaves_no_commands(act, tmp_path, upload, victim, code):
    stub = tmp_path / "terrainkit/bin/terrainkit"
    stub.parent.mkdir(parents=True)
    stub.write_text(f"#!/bin/bash\nprintf '::error::name\\n##[error]'\nkill -KILL {victim}\n")
    stub.chmod(0o755)
    done, _ = act(**{"upload-sarif": upload})
    assert done.returncode == code
    assert commands(done.stdout) == commands(done.stderr) == []


def test_action_stops_commands_with_another_token_in_each_run(act):
    logs = [act("push", paths="robots/good.urdf")[0].stdout for _ in range(2)]
    tokens = [re.search(r"^::stop-commands::([0-9a-f]{32})$", log, re.MULTILINE) for log in logs]
    assert tokens[0][1] != tokens[1][1]
    assert all(log.endswith(f"\n::{token[1]}::\n") for log, token in zip(logs, tokens, strict=True))


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


def run_job_of_gitlab(folder):
    job = yaml.safe_load(blocks("yaml")[2])["check-robot"]
    script = "\n".join(job["script"])
    return bash(script, folder, "-e", CI_MERGE_REQUEST_DIFF_BASE_SHA="HEAD^1")


def test_page_job_of_gitlab_checks_changed_robots(repository):
    (repository / "robots.baseline.json").write_text('{"version": 1, "robots": {}}')
    done = run_job_of_gitlab(repository)
    assert done.returncode == 123, done.stderr  # xargs, of the exit code 1
    assert done.stdout.startswith("robots/new.urdf\n")


@pytest.mark.parametrize(
    ("names", "mass", "code"),
    [(HOSTILE_NAMES, 1, 0), *((names, -1, 123) for names in (HOSTILE_NAMES, *zip(OPTIONS[:4])))],
)
def test_page_job_of_gitlab_takes_no_name_for_an_option(hostile, names, mass, code):
    folder = hostile(mass, names)
    before = contents(folder.parent)
    done = run_job_of_gitlab(folder)
    assert done.returncode == code, done.stderr
    assert "robots/last.urdf" in done.stdout
    assert contents(folder.parent) == before


def test_page_baseline_commands_take_no_name_for_an_option(hostile):
    folder = hostile(-1, [f"robots/{name.replace('/', '_')}.urdf" for name in HOSTILE_NAMES])
    before = contents(folder.parent)
    for command in blocks("sh")[0].splitlines()[2:]:  # the first ones write a robot
        assert command.startswith("terrainkit check-robot robots/*.urdf")
        done = bash(command, folder)
        assert done.returncode == 0, done.stderr
    after = contents(folder.parent)
    recorded = json.loads(after.pop(folder / "robots.baseline.json"))["robots"]
    assert len(recorded) == len(HOSTILE_NAMES) + 1
    assert before.pop(folder / "robots.baseline.json")
    assert after == before
