"""Ctrl-C ends the command `fullam` in one line at any moment, its import included.

Half a second passes between the shell and `main`, in which Python imports what it needs. An
interrupt then would print a traceback through other people's packages, or be swallowed by a
callback of one of them. So where this process is the command, and only there, the signal is taken
by a function that ends the process; `main` puts Python's own handler back while it works, because
work has to be left in order (rows to be written, processes to be ended).

This is imported before everything else and imports next to nothing.
"""

import atexit
import contextlib
import os
import signal
import sys
import threading

EXIT_CODE = 130
"""What a shell calls "ended by Ctrl-C"."""


def is_command() -> bool:
    """Whether this process was started as `fullam ...` or `python -m fullam ...`."""
    name = os.path.basename(sys.argv[0]) if sys.argv else ""  # noqa: PTH119 - pathlib is not light
    if name in ("fullam", "fullam.exe", "fullam-script.py"):
        return True
    words = getattr(sys, "orig_argv", [])
    return "-m" in words and words[words.index("-m") + 1 :][:1] == ["fullam"]


def end_at_once(*_: object) -> None:
    """Signal handler: say it in one line and end the process."""
    os.write(2, b"fullam: interrupted\n")
    os._exit(EXIT_CODE)


def ignore() -> None:
    """From here on an interrupt changes nothing: what is left is a moment of Python's own.

    Python, tidying up behind the last of our code, would give the signal back to the system, which
    ends the process without its exit code.
    """
    if in_the_main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def leave() -> None:
    """End an interrupted command now.

    Python would wait for what threads fly or compile, many seconds; what they would give nobody
    takes any more, and what has to be left in order was left by whoever opened it, or is now. And
    it would end by the signal instead of the exit code if the interrupt fell into code that was
    executed from a string, as a dataclass is made.
    """
    if is_command() and in_the_main_thread():
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):  # the reader may have gone
                stream.flush()
        os._exit(EXIT_CODE)


def in_the_main_thread() -> bool:
    """Whether this thread may set signal handlers."""
    return threading.current_thread() is threading.main_thread()


def guard() -> None:
    """From here on an interrupt ends the process at once, if the process is the command."""
    if is_command() and in_the_main_thread():
        signal.signal(signal.SIGINT, end_at_once)


def release() -> None:
    """From here on an interrupt raises KeyboardInterrupt, as usual."""
    if in_the_main_thread() and signal.getsignal(signal.SIGINT) is end_at_once:
        signal.signal(signal.SIGINT, signal.default_int_handler)


guard()
if is_command():
    atexit.register(ignore)  # registered first, called last
