"""Writing files so that a reader never meets half of one, and two writers never meet."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fullam.exceptions import CampaignError

try:
    import fcntl
except ImportError:  # pragma: no cover - Windows has no flock
    fcntl = None  # type: ignore[assignment]


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; move it there when the block ends well.

    The suffix is kept, because some writers choose their format by it. If the block raises,
    the temporary is removed and whatever stood at `path` stays as it was. When the block has
    ended, file and name are on the disk: neither a kill nor a power cut takes them back.

    Args:
        path: Where the finished file belongs. Missing folders are made.

    Yields:
        The path to write to.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(
        dir=target.parent, prefix=f".{target.stem}-", suffix=target.suffix
    )
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes private files; give the result the permissions of an ordinary one.
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        sync(temporary)
        temporary.replace(target)
        if os.name == "posix":  # elsewhere a folder cannot be opened
            sync(target.parent)
    finally:
        temporary.unlink(missing_ok=True)


def sync(path: Path) -> None:
    """Have the system write a file's content, or a folder's list of names, to the disk."""
    # Windows syncs only what is open for writing; a folder opens for reading only.
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def locked(path: str | Path) -> Iterator[None]:
    """Hold `path` for this process alone while the block runs.

    The lock is the system's, on a file `NAME.lock` beside it: it ends with the process, however
    that ends. Where the system has no such locks nothing is held.

    Args:
        path: What is written under the lock; it need not exist. Missing folders are made.

    Raises:
        CampaignError: Another process holds it, or another thread of this one.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    lock = target.with_name(target.name + ".lock")
    handle = _acquire(lock, target)
    try:
        yield
    finally:
        # Unlinked while it is held: whoever opened it meanwhile sees that the name is gone.
        lock.unlink(missing_ok=True)
        os.close(handle)


def _acquire(lock: Path, target: Path) -> int:
    """Open and lock the file; its descriptor."""
    while True:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            if fcntl is not None:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            holder = os.read(handle, 32).decode(errors="replace").strip() or "unknown"
            os.close(handle)
            raise CampaignError(
                str(target),
                "file",
                f"is being written by another process ({holder})",
                "wait until that has ended, or name another file",
            ) from error
        except BaseException:
            os.close(handle)
            raise
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), lock.stat()):
                os.truncate(handle, 0)
                os.write(handle, str(os.getpid()).encode())
                return handle
        os.close(handle)  # its last holder has just removed the name
