"""What commands do not pay for."""

import subprocess
import sys

import pytest

SLOW = {"matplotlib", "pyvista", "vtkmodules", "open3d", "skimage", "trimesh", "pxr", "tomlkit", "scipy.signal"}


@pytest.mark.parametrize(
    ("imported", "left_out"),
    [
        ("mhvedit.cli", SLOW | {"numpy", "numba", "scipy", "rich", "pydantic"}),
        ("mhvedit.pipeline.run", SLOW | {"rich"}),
        ("mhvedit.api", SLOW | {"rich"}),
    ],
)
def test_what_an_import_leaves_out(imported: str, left_out: set[str]) -> None:
    said = "import sys; print(*sys.modules)"
    ran = subprocess.run([sys.executable, "-c", f"import {imported}; {said}"], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert not left_out & set(ran.stdout.split())
