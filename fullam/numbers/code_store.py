"""Machine code on disk, one file a function, under the key of all that went into it.

Whoever can write these files decides what runs here, so their folder is the user's alone. Where
nothing can be written there is no store, and code is compiled in every process.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import tempfile
from functools import cache
from pathlib import Path

from platformdirs import user_cache_path

logger = logging.getLogger(__name__)

VARIABLE = "FULLAM_CODE_CACHE"
"""Environment variable that names another folder; empty for none."""

SUFFIX = ".code"


@cache
def folder() -> Path | None:
    """The user's own folder for machine code; None where it cannot be had."""
    asked = os.environ.get(VARIABLE)
    if asked == "":
        return None
    try:
        path = Path(asked) if asked else user_cache_path("fullam") / "code"
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
        if hasattr(os, "getuid") and path.stat().st_uid != os.getuid():
            raise PermissionError(f"'{path}' belongs to somebody else")
    except (OSError, RuntimeError) as error:
        logger.info("machine code is not kept: %s", error)
        return None
    return path


def load(key: str) -> tuple[str, bytes] | None:
    """Name and object code of a function that was stored whole; None if there is none."""
    place = folder()
    if place is None:
        return None
    try:
        head, code = (place / f"{key}{SUFFIX}").read_bytes().split(b"\n", 1)
        said = json.loads(head)
        name, checksum = str(said["name"]), str(said["sha256"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return (name, code) if hashlib.sha256(code).hexdigest() == checksum else None


def store(key: str, name: str, code: bytes) -> None:
    """Keep a function, all of it or nothing; silently not, where nothing can be written."""
    place = folder()
    if place is None:
        return
    head = json.dumps({"name": name, "sha256": hashlib.sha256(code).hexdigest()})
    with contextlib.suppress(OSError):
        handle, temporary = tempfile.mkstemp(dir=place)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(head.encode() + b"\n" + code)
            Path(temporary).replace(place / f"{key}{SUFFIX}")
        except OSError:
            Path(temporary).unlink(missing_ok=True)
            raise
