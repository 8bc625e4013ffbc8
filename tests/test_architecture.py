"""The rooms import one way, and the two formulations of the dynamics do not know each other."""

import ast
from pathlib import Path

import pytest

import fullam

PACKAGE = Path(fullam.__file__).parent

ROOMS = [
    "exceptions",
    "checks",
    "files",
    "registry",
    "model",
    "dynamics",
    "control",
    "simulation",
    "analysis",
    "viz",
]
"""From the ground up: a room imports itself and what stands before it."""

TOP = {"__init__", "__main__", "cli", "interrupt", "paper", "paper_equations", "version"}
"""Files above the rooms: the public names, the command line, the paper as data, the version."""

WITNESSES = {"newton_euler", "kinematics", "matrix_system", "paper_model"}
"""The paper's formulation; `multibody` is the other one."""


def imported_modules(path: Path) -> set[str]:
    """Modules that a file names in its import statements, those inside functions included."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def room_of(module: str) -> str:
    """Second part of a dotted name: fullam.ROOM...."""
    return module.split(".")[1] if "." in module else ""


MODULES = sorted(p for p in PACKAGE.rglob("*.py") if p.relative_to(PACKAGE).parts[0] != "urdf")


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_rooms_import_downwards_only(path):
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    if parts[0] in TOP:
        return
    allowed = [*ROOMS[: ROOMS.index(parts[0]) + 1], "version"]
    for module in imported_modules(path):
        if module.startswith("fullam."):
            assert room_of(module) in allowed, f"{path.name} imports {module}"


def test_the_two_formulations_share_nothing():
    dynamics = PACKAGE / "dynamics"
    for name in WITNESSES:
        used = imported_modules(dynamics / f"{name}.py")
        assert not any("multibody" in module for module in used)
        if name != "paper_model":
            assert not any(module.split(".")[0] == "pinocchio" for module in used)
    used = imported_modules(dynamics / "multibody.py")
    assert not any(module.rsplit(".", 1)[-1] in WITNESSES for module in used)


@pytest.mark.parametrize("package", ["matplotlib", "meshcat"])
def test_drawing_packages_stay_in_viz(package):
    for path in MODULES:
        if path.relative_to(PACKAGE).parts[0] != "viz":
            names = {module.split(".")[0] for module in imported_modules(path)}
            assert package not in names, path


def test_importing_the_package_draws_and_fetches_nothing():
    import subprocess
    import sys

    heavy = ["matplotlib", "meshcat", "yourdfpy", "numba", "distributed", "mujoco"]
    code = f"import fullam, sys; print([m for m in {heavy!r} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_no_file_is_long():
    too_long = {p.name: n for p in MODULES if (n := len(p.read_text().splitlines())) > 400}
    assert too_long == {}
