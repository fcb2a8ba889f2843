"""Take from a process the right to change anything: a filter of system calls on Linux.

Files of strangers may reach code that writes files, such as operators of TorchScript. The list has
what computing, reading files and answering need. All other calls, such as those that remove or
rename files, start processes or connect, fail with EPERM.
"""

import ctypes
import errno
import os
import platform
import struct
import sys

_X86_64 = """
read=0 close=3 stat=4 fstat=5 lstat=6 poll=7 lseek=8 mmap=9 mprotect=10 munmap=11 brk=12
rt_sigaction=13 rt_sigprocmask=14 rt_sigreturn=15 pread64=17 readv=19 access=21 sched_yield=24
mremap=25 madvise=28 nanosleep=35 getpid=39 exit=60 uname=63 getcwd=79 chdir=80 readlink=89
gettimeofday=96 getrlimit=97 getrusage=98 sysinfo=99 getuid=102 getgid=104 geteuid=107 getegid=108
getppid=110 sigaltstack=131 gettid=186 futex=202 sched_getaffinity=204 getdents64=217
clock_gettime=228 clock_getres=229 clock_nanosleep=230 exit_group=231 newfstatat=262 readlinkat=267
faccessat=269 set_robust_list=273 getcpu=309 getrandom=318 membarrier=324 statx=332 rseq=334
faccessat2=439 write=1 writev=20
"""
_AARCH64 = """
getcwd=17 faccessat=48 chdir=49 close=57 getdents64=61 lseek=62 read=63 write=64 readv=65 writev=66
pread64=67 ppoll=73 readlinkat=78 newfstatat=79 fstat=80 exit=93 exit_group=94 futex=98
set_robust_list=99 nanosleep=101 clock_gettime=113 clock_getres=114 clock_nanosleep=115
sched_getaffinity=123 sched_yield=124 sigaltstack=132 rt_sigaction=134 rt_sigprocmask=135
rt_sigreturn=139 uname=160 getrlimit=163 getrusage=165 getcpu=168 gettimeofday=169 getpid=172
getppid=173 getuid=174 geteuid=175 getgid=176 getegid=177 gettid=178 sysinfo=179 brk=214 munmap=215
mremap=216 mmap=222 mprotect=226 madvise=233 getrandom=278 membarrier=283 statx=291 rseq=293
faccessat2=439
"""
"""Names and numbers of the allowed calls, from the kernel's tables of system calls. `write` only
reaches files that are open already: the answer to the parent, and the null device."""

_SYSTEMS = {
    "x86_64": (0xC000003E, 257, 317, _X86_64),
    "aarch64": (0xC00000B7, 56, 277, _AARCH64),
}
"""Code of the architecture (linux/audit.h), numbers of `openat` and `seccomp`, allowed calls."""

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
"""Flags of `openat` that are not allowed."""

_ALLOW, _FAIL, _MISSING = 0x7FFF0000, 0x00050000 | errno.EPERM, 0x00050000 | errno.ENOSYS
"""Results of the filter (linux/seccomp.h)."""

_OPENAT2 = 437
"""Its flags are behind a pointer, which a filter cannot read; callers then use `openat`."""


def forbid_changes() -> bool:
    """Let all threads of this process only compute, read files, and write to files that are open.

    Returns:
        Whether the system supports it: Linux on x86-64 or ARM. The right does not come back.
    """
    system = _SYSTEMS.get(platform.machine()) if sys.platform == "linux" else None
    if system is None or sys.maxsize < 2**32:
        return False
    architecture, openat, seccomp, calls = system
    program = _filter(architecture, openat, [int(call.split("=")[1]) for call in calls.split()])
    buffer = ctypes.create_string_buffer(program)
    header = struct.pack("HxxxxxxP", len(program) // 8, ctypes.addressof(buffer))
    libc = ctypes.CDLL(None, use_errno=True)
    pr_set_no_new_privs, set_mode_filter, all_threads = 38, 1, 1
    if libc.prctl(pr_set_no_new_privs, 1, 0, 0, 0):
        return False
    return bool(libc.syscall(seccomp, set_mode_filter, all_threads, header) == 0)


def _filter(architecture: int, openat: int, calls: list[int]) -> bytes:
    """Return a program of the Berkeley Packet Filter that allows some system calls.

    Each instruction has an operation, the jumps if a comparison holds and if not, and a value.
    """
    load, equal, any_bit, result = 0x20, 0x15, 0x45, 0x06
    number, kind, flags = 0, 4, 32  # offsets in the data of a call; `flags` is its third argument
    program = [(load, 0, 0, kind), (equal, 1, 0, architecture), (result, 0, 0, _FAIL)]
    program.append((load, 0, 0, number))
    for call in calls:
        program += [(equal, 0, 1, call), (result, 0, 0, _ALLOW)]
    program += [(equal, 0, 1, _OPENAT2), (result, 0, 0, _MISSING)]
    program += [(equal, 1, 0, openat), (result, 0, 0, _FAIL), (load, 0, 0, flags)]
    program += [(any_bit, 0, 1, _WRITING), (result, 0, 0, _FAIL), (result, 0, 0, _ALLOW)]
    return b"".join(struct.pack("HBBI", *instruction) for instruction in program)
