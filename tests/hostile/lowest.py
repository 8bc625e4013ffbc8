"""The lowest declared version of every dependency: install them, and fly, tune and sweep with them.

    python tests/hostile/lowest.py [--keep FOLDER]

A bound that was never tried is a guess. Exit code 1 if pip finds no such versions, or the tests of
what stands at the edge to other packages fail with them.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NO_PART = ("bench",)
"""Extras of other simulators, which ours is timed beside and which want versions of their own."""

TESTS = (
    *("tests/test_bad_files.py", "tests/test_files.py", "tests/hostile/test_fuzz.py"),
    *("tests/analysis/test_campaign.py", "tests/analysis/test_campaign_store.py", "tests/model"),
    *("tests/analysis/test_cluster.py", "tests/numbers", "tests/control/test_law_contract.py"),
    *("tests/analysis/test_tuning.py", "tests/simulation/test_run.py", "tests/dynamics"),
    *("tests/simulation/test_run_export.py", "tests/simulation/test_mujoco_plant.py"),
    *("tests/simulation/test_world_file.py", "tests/simulation/test_scene_joints.py"),
    *("tests/simulation/test_motion_csv.py", "tests/test_plugins.py", "tests/test_cli_settings.py"),
    *("tests/analysis/test_calibration.py", "tests/test_cli_completion.py"),
    *("tests/viz/test_figures.py", "tests/control/test_allocation.py"),
)
LENIENT = (
    *("-W", "ignore::DeprecationWarning", "-W", "ignore::PendingDeprecationWarning"),
    *("--ignore", "tests/model/test_any_urdf.py"),
    *("--deselect", "tests/test_plugins.py::test_what_new_writes_passes_the_linter"),
)
"""Old versions of one package deprecate, and are deprecated by, new ones of another; and the robots
that others describe are mended from version to version of their package. Linters are not here."""

NOT_INSTALLED = ("ruff", "mypy")
"""They check, and bring nothing that runs."""


def lowest() -> list[str]:
    """Each bound of pyproject.toml as "name==version"."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = list(project["dependencies"])
    for extra, entries in project["optional-dependencies"].items():
        wanted += [] if extra in NO_PART else entries
    found = [re.match(r"([\w.-]+)(?:\[[\w,-]*\])?>=([\d.]+)", entry) for entry in wanted]
    pairs = {(m[1], m[2]) for m in found if m and m[1] not in NOT_INSTALLED}
    return [f"{name}=={version}" for name, version in sorted(pairs)]


def main() -> int:
    """Install and test."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--keep", type=Path, help="make the environment there and leave it")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        if not (folder / "bin" / "python").exists():
            venv.create(folder, with_pip=True)
        python = str(folder / "bin" / "python")
        install = [python, "-m", "pip", "install", "--quiet", *lowest()]
        if code := subprocess.run(install).returncode:
            return code
        own = [python, "-m", "pip", "install", "--quiet", "--no-deps", "--editable", str(ROOT)]
        if code := subprocess.run(own).returncode:
            return code
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        tests = [python, "-m", "pytest", "-q", *LENIENT, *TESTS]
        return subprocess.run(tests, cwd=ROOT, env=environment).returncode


if __name__ == "__main__":
    sys.exit(main())
