"""The house table: a package imports only those below it."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "mhvedit"
BASE = {"errors", "files", "geometry"}
MAY_IMPORT = {
    "errors": set(),
    "files": set(),
    "geometry": set(),
    "sequences": set(),
    "volumes": {"sequences"},
    "constraints": {"sequences", "volumes"},
    "search": {"volumes", "constraints"},
    "optimise": {"sequences", "search"},
    "scene": {"sequences", "optimise", "constraints"},
    "skeleton": {"sequences"},
    "collision": {"sequences", "skeleton"},
    "avoidance": {"sequences", "skeleton", "collision"},
    "fitting": {"sequences", "skeleton", "collision", "avoidance"},
    "world": {"sequences", "volumes", "skeleton", "collision", "avoidance"},
    "view": {"sequences", "volumes", "constraints", "search", "optimise", "scene"},
    "export": {"sequences", "scene"},
    "project": {"sequences", "volumes", "constraints", "skeleton", "fitting"},
    "pipeline": {
        "sequences",
        "volumes",
        "constraints",
        "search",
        "optimise",
        "scene",
        "view",
        "export",
        "project",
        "skeleton",
        "collision",
        "avoidance",
        "fitting",
        "world",
    },
    "viewer": {
        "sequences",
        "volumes",
        "constraints",
        "search",
        "optimise",
        "scene",
        "view",
        "project",
        "pipeline",
    },
    "batch": {"sequences", "search", "optimise", "scene", "project", "pipeline"},
}
MAY_IMPORT["commands"] = set(MAY_IMPORT)  # and nothing imports it but the command line


@pytest.mark.parametrize("package", sorted(MAY_IMPORT))
def test_a_package_imports_only_what_the_table_allows(package: str) -> None:
    allowed = MAY_IMPORT[package] | BASE | {package}
    for path in _modules(package):
        for imported in _imports(path):
            assert imported in allowed, f"{path.relative_to(PACKAGE)} imports {imported}"


def test_every_package_is_in_the_table() -> None:
    found = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").exists()}
    assert found <= set(MAY_IMPORT), found - set(MAY_IMPORT)


def _modules(package: str) -> list[Path]:
    single = PACKAGE / f"{package}.py"
    return [single] if single.exists() else sorted((PACKAGE / package).glob("*.py"))


def _imports(path: Path) -> set[str]:
    names = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            names.append(node.module)
        elif isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
    return {name.split(".")[1] for name in names if name.startswith("mhvedit.")}


def test_no_compiled_function_calls_itself() -> None:
    """Compiled recursion crashes the process once it comes from numba's cache."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef) and any("njit" in ast.unparse(d) for d in node.decorator_list):
                called = {
                    call.func.id
                    for call in ast.walk(node)
                    if isinstance(call, ast.Call) and isinstance(call.func, ast.Name)
                }
                assert node.name not in called, f"{path.relative_to(PACKAGE)}: {node.name}"
