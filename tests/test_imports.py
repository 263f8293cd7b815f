"""What commands do not pay for."""

import subprocess
import sys

import pytest

SLOW = {"matplotlib", "pyvista", "vtkmodules", "open3d", "skimage", "trimesh", "pxr", "tomlkit", "scipy.signal"}
SCIPY = {f"scipy.{name}" for name in ("linalg", "ndimage", "sparse", "spatial", "special", "interpolate", "stats")}
STARTED = """
import sys
from mhvedit.commands.starting import start_lean
start_lean()
import numpy as np
from numba import njit
assert njit(lambda x: x + 1)(1) == 2
assert "scipy.linalg" not in sys.modules
assert njit(lambda a: a @ a)(2 * np.eye(2))[1, 1] == 4
"""


@pytest.mark.parametrize(
    ("imported", "left_out"),
    [
        ("mhvedit.cli", SLOW | {"numpy", "numba", "scipy", "rich", "pydantic"}),
        ("mhvedit.pipeline.run", SLOW | SCIPY | {"rich"}),
        ("mhvedit.api", SLOW | SCIPY | {"rich"}),
    ],
)
def test_what_an_import_leaves_out(imported: str, left_out: set[str]) -> None:
    assert not left_out & set(_ran(f"import {imported}; import sys; print(*sys.modules)").split())


def test_a_first_kernel_does_not_import_blas_but_kernels_may_have_it() -> None:
    _ran(STARTED)


def _ran(code: str) -> str:
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout
