"""Show that each TorchScript escape has its effect when torch loads and calls it without a sandbox.

python benchmarks/verify_escapes.py [NAME ...]
"""

import io
import os
import resource
import signal
import sys
import tempfile
import time
from pathlib import Path

import torch
from fuzzing.escapes.torchscript import ESCAPES, MARK, Escape
from fuzzing.processes import kill, wait

_HANG, _SECONDS, _THREAD = 3.0, 30.0, 3.0
"""Times after which a call hangs, if that is its effect or not, and for threads of a call [s]."""

_MEMORY = 1 << 30
"""Memory that counts as an effect [bytes]."""

_NO_MEMORY = ("memory", "bad_alloc")


def effects_of(escape: Escape, folder: Path) -> set[str]:
    """Return what an escape does in a throwaway process, which loads it and calls it some times."""
    target, printed = folder / "written", folder / "printed"
    data = escape.archive(target)
    if not (child := os.fork()):
        _load_and_call(data, printed, target, escape.effect)
    if not (ended := wait(child, _HANG if escape.effect == "hangs" else _SECONDS)):
        os.kill(child, signal.SIGINT)
        ended = wait(child, 1.0)
    is_alive = not ended
    status, usage = ended or kill(child)
    text = printed.read_text(errors="replace")
    code = os.waitstatus_to_exitcode(status)
    found = {
        "writes": target.exists(),
        "hangs": is_alive,
        "prints": MARK in text,
        "memory": usage.ru_maxrss << 10 > _MEMORY or any(word in text for word in _NO_MEMORY),
        "crashes": not is_alive and code in (-signal.SIGSEGV, -signal.SIGABRT),
        "at load": target.exists() and "loaded" not in text,
    }
    return {effect for effect, is_found in found.items() if is_found}


def _load_and_call(data: bytes, printed: Path, target: Path, effect: str) -> None:
    try:
        for number in (1, 2):
            os.dup2(os.open(printed, os.O_WRONLY | os.O_CREAT | os.O_APPEND), number)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))
        policy = torch.jit.load(io.BytesIO(data))
        if not target.exists():
            print("loaded", flush=True)
        with torch.no_grad():
            for k in range(60):
                policy(torch.zeros((1, 2, 5)[k % 3], 8))
        end = time.monotonic() + _THREAD
        while effect == "writes" and not target.exists() and time.monotonic() < end:
            time.sleep(0.01)
    except BaseException as error:
        print(error, flush=True)
    finally:
        os._exit(0)


def main() -> int:
    """Print the effects of each escape; return 1 if one lacks the effect that it declares."""
    names = sys.argv[1:] or list(ESCAPES)
    missing = []
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            found = effects_of(ESCAPES[name], Path(folder))
        print(f"{name:36}{ESCAPES[name].effect:9}{', '.join(sorted(found))}", flush=True)
        if ESCAPES[name].effect not in found:
            missing.append(name)
    print(f"{len(names)} escapes; without their effect: {', '.join(missing) or 'none'}")
    return int(bool(missing))


if __name__ == "__main__":
    sys.exit(main())
