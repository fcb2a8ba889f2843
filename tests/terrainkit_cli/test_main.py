import importlib.metadata
import signal
import subprocess
import sys

import pytest

from terrainkit_cli import training_extra
from terrainkit_cli.main import COMMAND_GROUPS, COMMANDS, command
from tests.tables import read_table


def test_no_command_lists_all_commands(terrainkit_process):
    run = terrainkit_process()
    assert run.returncode == 0
    for summaries in COMMAND_GROUPS.values():
        for name, summary in summaries.items():
            assert f"  {name.ljust(12)}  {summary}\n" in run.stdout
            assert summary == command(name).__doc__.partition("\n")[0]
    lines = run.stdout.splitlines()
    assert len(lines) <= 24  # a terminal
    assert max(map(len, lines)) <= 80


def test_version_is_that_of_the_package(terrainkit_process):
    assert (
        terrainkit_process("--version").stdout
        == f"terrainkit {importlib.metadata.version('terrainkit')}\n"
    )


@pytest.mark.parametrize("name", COMMANDS)
def test_help_describes_command_in_80_columns(terrainkit, name):
    run = terrainkit(name, "--help")
    assert run.returncode == 0
    assert command(name).__doc__.partition("\n")[0] in run.stdout
    assert max(map(len, run.stdout.splitlines())) <= 80


@pytest.mark.parametrize(("words", "message"), read_table(__file__, "invalid_input_is_one_line"))
def test_invalid_input_is_one_line_on_stderr(rejected, tmp_path, words, message):
    assert message in rejected(words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("word", ["--help", "-o", "--output=a.npz", "--output_=b", "--none"])
def test_name_of_a_file_is_no_option(terrainkit, rejected, tmp_path, word):
    (tmp_path / word).symlink_to("nowhere")  # a link without target is a name, too
    message = f"{word}: got an option that is also a file; expected -- between options and files"
    for name in ("rule", "check-robot", "generate"):
        assert rejected(name, word).startswith(message)
    assert list(tmp_path.iterdir()) == [tmp_path / word]
    # After `--`, the word is a file; before it, an option.
    assert f"no rule '{word}'" in rejected("rule", "--", word)
    if word == "--help":
        assert terrainkit("rule", word, "--").stdout.startswith("usage: terrainkit rule")


def test_jobs_that_do_not_fit_in_memory_are_rejected(rejected, monkeypatch):
    monkeypatch.setattr("terrainkit.files.memory.free_memory", lambda: 4 * 10**8)
    message = "--jobs 9 needs 1.21 GB of memory; 0.40 GB free; --jobs 2 would fit"  # 9 * 2^27 bytes
    assert message in rejected("generate -o a.npz --jobs 9")


@pytest.mark.parametrize("command", ["train", "evaluate", "export", "play", "check-task"])
def test_training_commands_name_the_missing_extra(rejected, monkeypatch, command):
    monkeypatch.setattr(training_extra, "PACKAGES", ("torch", "no_such_package"))
    told = "missing packages: no_such_package; run: pip install '.[train]' (in a clone of terra"
    assert rejected(f"{command} quadruped").startswith(told)


def test_training_commands_name_a_pinned_package(rejected, monkeypatch):
    version = importlib.metadata.version
    older = {"rsl-rl-lib": "5.4.2"}
    monkeypatch.setattr(
        importlib.metadata, "version", lambda name: older.get(name) or version(name)
    )
    told = "rsl-rl-lib: got version 5.4.2; expected 5.5 or newer; where a framework pins an older"
    assert rejected("evaluate quadruped").startswith(told)


@pytest.mark.parametrize(
    "words", [("generat",), ("generate", "-o", "a.npz", "--rows", 0), ("train", "quadrupd")]
)
def test_invalid_input_ends_process_with_2(terrainkit_process, terrainkit, words):
    run, expected = terrainkit_process(*words), terrainkit(*words)
    assert (run.returncode, run.stdout, run.stderr) == (2, "", expected.stderr)


def bash(command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [
            "bash",
            "-c",
            f'terrainkit() {{ {sys.executable} -m terrainkit_cli.main "$@"; }}; {command}',
        ],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )


@pytest.mark.parametrize("command", ["list", "check-robot --help"])
def test_pipe_without_reader_is_not_an_error(command):
    run = bash(f"terrainkit {command} | true; exit ${{PIPESTATUS[0]}}")
    assert (run.returncode, run.stderr) == (0, "")


@pytest.mark.parametrize(
    ("command", "files"),
    [
        ("feasibility small.npz --robot quadruped -o report", ["report.json", "report.png"]),
        ("evaluate quadruped --seconds 0.04 --num-envs 2 -o result.json", ["result.json"]),
    ],
)
def test_files_are_written_without_a_reader_of_stdout(small_map, command, files, tmp_path):
    assert small_map == "small.npz"
    run = bash(f"cd {tmp_path}; export PYTHONUNBUFFERED=1; terrainkit {command} | true")
    assert run.stderr == ""
    assert [name for name in files if not (tmp_path / name).is_file()] == []


@pytest.mark.parametrize("command", ["list", "check-robot quadruped"])
def test_closed_stdout_is_not_an_error(command):
    run = bash(f"terrainkit {command} >&-")
    assert (run.returncode, run.stderr) == (0, "")


@pytest.mark.parametrize("redirection", ["2>&-", "2>/dev/full", ">&- 2>&-"])
def test_error_without_stderr_exits_2(redirection):
    run = bash(f"terrainkit lst {redirection}")
    assert (run.returncode, run.stdout, run.stderr) == (2, "", "")


def test_full_stdout_is_one_line():
    run = bash("terrainkit list > /dev/full")
    assert run.returncode == 2
    assert run.stderr == "terrainkit: error: No space left on device\n"


@pytest.mark.usefixtures("small_map")
@pytest.mark.parametrize(("words", "heavy"), read_table(__file__, "commands_avoid_slow_imports"))
def test_commands_avoid_slow_imports(tmp_path, words, heavy):
    code = "import sys; from terrainkit_cli.main import main; main(sys.argv[1:]);"
    code += f"print(*({{*{heavy.split()}}} & {{*sys.modules}}), file=sys.stderr)"
    command = [sys.executable, "-c", code, *words.split()]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert run.stderr == "\n"


@pytest.mark.usefixtures("small_map")
@pytest.mark.parametrize(
    ("words", "name"),
    read_table(__file__, "signal_removes_temporary_files"),
    ids=lambda value: value if isinstance(value, str) else value[0],
)
def test_signal_removes_temporary_files(tmp_path, words, name):
    (tmp_path / "unnamed.urdf").write_text("<robot><link name='base'/></robot>")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    script = (
        "import os, pathlib, signal, sys; from terrainkit_cli.main import main;"
        f"pathlib.Path.replace = lambda *_: os.kill(os.getpid(), signal.{name});"
        "sys.exit(main(sys.argv[1:]))"
    )
    run = subprocess.run(
        [sys.executable, "-c", script, *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 128 + signal.Signals[name]
    assert run.stderr.splitlines()[-1] == f"terrainkit: error: ended by {name}"
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
