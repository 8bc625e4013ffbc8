"""The scripts that `fullam completion` prints complete verbs, options and names."""

import subprocess
import sys

import pytest

from fullam.cli import main
from fullam.cli.completing import SHELLS, script
from fullam.cli.listing import registered

pytest.importorskip("shtab", reason="the extra 'completion' is not installed")


@pytest.fixture(scope="module")
def bash(tmp_path_factory):
    """Completes the last of some words, as bash does after a tab."""
    folder = tmp_path_factory.mktemp("completion")
    (folder / "fullam.bash").write_text(script("bash"), encoding="utf-8")
    (folder / "task-mine.toml").touch()
    (folder / "task-mine.txt").touch()

    def complete(*words):
        code = (
            'source ./fullam.bash; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _shtab_fullam; '
            'printf "%s\\n" "${COMPREPLY[@]}"'
        )
        command = ["bash", "--norc", "-c", code, "bash", "fullam", *words]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
        return [line.strip() for line in done.stdout.splitlines() if line.strip()]

    return complete


def test_verbs_and_options(bash):
    assert bash("ex") == ["export"]
    assert bash("run", "task-1", "--contr") == ["--controller", "--control-rate"]
    assert sorted(bash("export", "a.npz", "--to", "")) == ["csv", "mcap", "parquet"]


def test_names_of_every_kind_and_files_beside_them(bash):
    found = registered()
    assert bash("run", "task-") == ["task-1", "task-2", "task-mine.toml"]
    assert set(found["controllers"]) <= set(bash("run", "task-1", "--controller", ""))
    assert set(found["vehicles"]) <= set(bash("check", ""))
    assert set(found["weathers"]) <= set(bash("run", "task-1", "--weather", ""))
    assert set(found["estimators"]) <= set(bash("run", "task-1", "--estimator", ""))
    assert bash("run", "task-1", "--driver", "f") == ["fused"]


def test_after_a_comma_the_next_name(bash):
    assert bash("compare", "task-1", "--controllers", "pid,back") == ["pid,backstepping"]
    assert bash("sweep", "task-1,task-") == ["task-1,task-1", "task-1,task-2"]


@pytest.mark.parametrize("shell", SHELLS)
def test_the_command_prints_the_script_alone(shell, capsys):
    assert main(["completion", shell]) == 0
    out = capsys.readouterr()
    assert out.out == script(shell)
    assert "hextilt-step" in out.out and out.err == ""


def test_without_shtab_the_message_names_the_extra(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "shtab", None)
    assert main(["completion", "zsh"]) == 2
    assert "fullam[completion]" in capsys.readouterr().err
