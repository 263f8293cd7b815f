"""What commands do not pay for."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SLOW = {"matplotlib", "pyvista", "vtkmodules", "open3d", "skimage", "trimesh", "pxr", "tomlkit", "scipy.signal"}
SCIPY = {f"scipy.{name}" for name in ("linalg", "ndimage", "sparse", "spatial", "special", "interpolate", "stats")}
STARTED = """
import sys
from mhvedit.commands.starting import start_lean
start_lean()
import numpy as np
from numba import njit
from mhvedit.optimise.steps import cheapest_step, exactly
points = exactly(np.arange(3) + 0j)
assert cheapest_step(np.zeros(3), points, points, np.full(3, np.inf))[1].tolist() == [0, 1, 2]
assert ("numba.typed.typeddict" in sys.modules) == ({!r} == "kernels are compiled")
assert "scipy.linalg" not in sys.modules
assert njit(lambda x: x + 1)(1) == 2
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


def test_a_kept_kernel_is_loaded_without_what_it_was_compiled_by_and_others_are_compiled(tmp_path: Path) -> None:
    for state in ("kernels are compiled", "kernels are kept"):
        _ran(STARTED.format(state), NUMBA_CACHE_DIR=str(tmp_path))


def _ran(code: str, **settings: str) -> str:
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ | settings)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout
