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
    "plain_values",
    "ownership",
    "plugins",
    "registry",
    "numbers",
    "model",
    "dynamics",
    "control",
    "simulation",
    "analysis",
    "viz",
]
"""From the ground up: a room imports itself and what stands before it."""

TOP = {
    "__init__",
    "__main__",
    "cli",
    "interrupt",
    "paper",
    "paper_equations",
    "paper_latex",
    "version",
}
"""Files above the rooms: the public names, the command line, the paper as data, the version."""

WITNESSES = {"newton_euler", "kinematics", "matrix_system", "paper_model"}
"""The paper's formulation; `multibody` is the other one."""


OPTIONAL = {
    *("cma", "cloudpickle", "distributed", "mujoco", "pyarrow", "ipywidgets", "IPython"),
    *("casadi", "xacro", "xacrodoc", "pandas", "xarray", "mcap"),
    "shtab",
}
"""Packages of an extra, or that another package brings if it is there."""

HEAVY = {
    *("numba", "llvmlite", "yourdfpy", "proxsuite", "scipy", "matplotlib", "mpl_toolkits"),
    *("PIL", "tornado", "meshcat", "importlib.metadata"),
}
"""Packages that take long to import, and that a help text or a first flight does without."""


def _type_checking(tree: ast.AST) -> set[int]:
    """Nodes that are there for type checkers alone."""
    blocks = [
        n for n in ast.walk(tree) if isinstance(n, ast.If) and "TYPE_CHECK" in ast.dump(n.test)
    ]
    return {id(inner) for block in blocks for inner in ast.walk(block)}


def _inside_functions(tree: ast.AST) -> set[int]:
    functions = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]
    return {id(inner) for function in functions for inner in ast.walk(function)}


def module_name(path: Path) -> str:
    """Dotted name of a file of the package."""
    parts = ("fullam", *path.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(path: Path, where: str = "anywhere") -> set[str]:
    """Modules that a file imports, but for types: "anywhere", at its "top", or in "functions"."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    left_out, functions = _type_checking(tree), _inside_functions(tree)
    found: set[str] = set()
    for node in ast.walk(tree):
        inside = id(node) in functions
        if (
            id(node) in left_out
            or (where == "top" and inside)
            or (where == "functions" and not inside)
        ):
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            full = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in NAMES else node.module for name in full}
    return found


MODULES = sorted(p for p in PACKAGE.rglob("*.py") if p.relative_to(PACKAGE).parts[0] != "urdf")
NAMES = {module_name(path) for path in MODULES}
ABOVE_ROOMS = [p for p in MODULES if p.relative_to(PACKAGE).with_suffix("").parts[0] in TOP]


def room_of(module: str) -> str:
    """Second part of a dotted name: fullam.ROOM...."""
    return module.split(".")[1] if "." in module else ""


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_rooms_import_downwards_only(path):
    if path in ABOVE_ROOMS:
        return
    allowed = [*ROOMS[: ROOMS.index(room_of(module_name(path))) + 1], "version"]
    for module in imports(path):
        if module.startswith("fullam."):
            assert room_of(module) in allowed, f"{path.name} imports {module}"


def test_no_circle_of_files():
    """Not even through imports inside functions."""
    graph = {module_name(path): imports(path) & NAMES for path in MODULES}
    while leaves := {name for name, used in graph.items() if not used & graph.keys() - {name}}:
        graph = {name: used for name, used in graph.items() if name not in leaves}
    assert graph == {}


def _package(module: str) -> str:
    return module if module in HEAVY else module.split(".")[0]


def test_imports_inside_functions_are_of_heavy_or_optional_packages():
    """Or of a file of ours that needs such a package as soon as it is imported."""
    heavy: set[str] = set()
    grown = True
    tops = {module_name(path): imports(path, "top") for path in MODULES}
    while grown:
        before = len(heavy)
        heavy |= {
            name
            for name, used in tops.items()
            if used & heavy or {_package(module) for module in used} & (HEAVY | OPTIONAL)
        }
        grown = len(heavy) > before
    for path in MODULES:
        if path in ABOVE_ROOMS:
            continue
        for module in imports(path, "functions"):
            needed = _package(module) in HEAVY | OPTIONAL or module in heavy
            assert needed, f"{path.name} imports {module} inside a function"


def test_optional_packages_are_imported_where_they_are_used():
    for path in MODULES:
        packages = {_package(module) for module in imports(path, "top")}
        optional = packages & OPTIONAL - {"pyarrow"}
        assert not optional, f"{path.name} imports {optional} as soon as it is imported"


def test_the_two_formulations_share_nothing():
    dynamics = PACKAGE / "dynamics"
    for name in WITNESSES:
        used = imports(dynamics / f"{name}.py")
        assert not any("multibody" in module for module in used)
        if name != "paper_model":
            assert not any(module.split(".")[0] == "pinocchio" for module in used)
    used = imports(dynamics / "multibody.py")
    assert not any(module.rsplit(".", 1)[-1] in WITNESSES for module in used)


@pytest.mark.parametrize("package", ["matplotlib", "meshcat"])
def test_drawing_packages_stay_in_viz(package):
    for path in MODULES:
        if path.relative_to(PACKAGE).parts[0] != "viz":
            names = {module.split(".")[0] for module in imports(path)}
            assert package not in names, path


@pytest.mark.parametrize(
    "code",
    [
        "import fullam",
        "from fullam.cli import build_parser; build_parser().format_help()",
        "import fullam; fullam.load_scenario('task-1')",
    ],
    ids=["import", "help", "scenario"],
)
def test_what_starts_draws_and_fetches_nothing_and_waits_for_no_slow_package(code):
    import subprocess
    import sys

    heavy = ["matplotlib", "meshcat", "yourdfpy", "numba", "distributed", "mujoco"]
    heavy += ["scipy", "proxsuite", "pandas", "pyarrow", "casadi", "importlib.metadata", "asyncio"]
    if "load" not in code:  # nothing is computed yet
        heavy += ["pinocchio", "coal", "threadpoolctl"]
    code = f"{code}; import sys; print([m for m in {heavy!r} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_type_checkers_are_told_of_the_annotations():
    """PEP 561; the wheel holds all of the package's folder."""
    assert (PACKAGE / "py.typed").is_file()


def test_every_public_name_is_there_and_completed():
    assert set(fullam.__all__) <= set(dir(fullam))
    assert all(getattr(fullam, name) is not None for name in fullam.__all__)
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        _ = fullam.simulat


def test_no_file_is_long():
    too_long = {p.name: n for p in MODULES if (n := len(p.read_text().splitlines())) > 400}
    assert too_long == {}
