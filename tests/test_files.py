"""Files are whole, on the disk, and written by one process at a time."""

import os
import subprocess
import sys
import threading

import pytest

from fullam import files
from fullam.exceptions import CampaignError
from fullam.files import atomic_path, locked


def test_a_file_is_on_the_disk_before_it_has_its_name_and_its_name_after(tmp_path, monkeypatch):
    done, target = [], tmp_path / "folder" / "file.txt"
    sync = files.sync
    monkeypatch.setattr(
        files, "sync", lambda path: (done.append((path, target.exists())), sync(path))
    )
    with atomic_path(target) as temporary:
        temporary.write_text("whole", encoding="utf-8")
    assert done == [(temporary, False), (target.parent, True)]
    assert target.read_text(encoding="utf-8") == "whole"


def test_a_lock_is_held_by_one_and_leaves_nothing(tmp_path):
    path = tmp_path / "result.parquet"
    refused = []

    def second():
        try:
            with locked(path):
                refused.append(False)
        except CampaignError as error:
            refused.append(str(os.getpid()) in str(error))

    with locked(path):
        thread = threading.Thread(target=second)
        thread.start()
        thread.join()
        code = f"from fullam.files import locked\nwith locked({str(path)!r}): pass"
        other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert "is being written by another process" in other.stderr
    assert refused == [True]
    assert list(tmp_path.iterdir()) == []
    with locked(path):
        pass


def test_the_lock_of_a_process_that_was_killed_is_free(tmp_path):
    path = tmp_path / "result.parquet"
    code = (
        f"import os, signal\nfrom fullam.files import locked\nwith locked({str(path)!r}):\n"
        "    os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", code])
    assert (tmp_path / "result.parquet.lock").exists()
    with locked(path):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_lock_ends_with_an_error_too(tmp_path):
    with pytest.raises(KeyError), locked(tmp_path / "a"):
        raise KeyError
    with locked(tmp_path / "a"):
        pass
