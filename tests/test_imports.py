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
from mhvedit.geometry.runs import _counted, byte_counts
assert byte_counts(np.array([2, 0, 2], np.uint8), 3).tolist() == [1, 0, 2]
assert ("numba.typed.typeddict" in sys.modules) == ({!r} == "kernels are compiled")
assert "scipy.linalg" not in sys.modules
assert njit(lambda x: x + 1)(1) == 2
assert njit(lambda values: _counted(values, 3)[2])(np.array([2, 0, 2], np.uint8)) == 2
assert njit(lambda a: a @ a)(2 * np.eye(2))[1, 1] == 4
"""


LOADED = """
import importlib, pkgutil, sys
from mhvedit.commands.starting import start_lean
start_lean()
from numba.core.dispatcher import Dispatcher
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
import mhvedit
rtsys.initialize(cpu_target.target_context)
modules = [importlib.import_module(m.name) for m in pkgutil.walk_packages(mhvedit.__path__, "mhvedit.")
           if m.name.split(".")[1] not in ("viewer", "export", "__main__")]
kernels = {id(own): own for module in modules for own in vars(module).values() if isinstance(own, Dispatcher)}
loaded = 0
for kernel in kernels.values():
    for key in kernel._cache._cache_file._load_index():
        kernel._cache._impl.rebuild(cpu_target.target_context, kernel._cache._cache_file.load(key))
        loaded += 1
print(loaded, "numba.typed.typeddict" in sys.modules)
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


def test_every_kernel_that_is_kept_loads_so() -> None:
    """A symbol that the tables would have brought would end the process."""
    loaded, with_tables = _ran(LOADED).split()
    assert int(loaded) > 0 and with_tables == "False"


def _ran(code: str, **settings: str) -> str:
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ | settings)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout
