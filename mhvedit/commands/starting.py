"""What a command does without, so as to answer sooner."""

import os
from typing import Any

TRIED = "0.68."  # versions of numba of which kept kernels are known to load without the compiler's tables


def start_lean() -> None:
    """Spare this process what its work has no need of; to be called before anything large is imported.

    SciPy's BLAS: numba imports `scipy.linalg` when it loads a first kernel, only to know whether `np.correlate` may use
    it there. Kernels that multiply matrices ask for BLAS themselves. The compiler's tables: numba fills them before it
    loads a first kernel that is kept, which needs no more than its way to allocate memory; where one has to be
    compiled after all, the compiler fills them itself. Threads of NumPy's BLAS: for small matrices they would only spin
    beside the search.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    import numba
    from numba.np import linalg

    if numba.__version__.startswith(TRIED):
        from numba.core import caching

        caching.Cache.load_overload = _load_overload
    asked = getattr(linalg, "ensure_blas", None)
    if asked is None:  # another numba, which asks in another way
        return
    linalg.ensure_blas = _no_blas
    try:
        import numba.np.arraymath  # asks when it is imported
    finally:
        linalg.ensure_blas = asked


def _no_blas() -> None:
    raise ImportError("not asked for")


def _load_overload(kept: Any, signature: object, target: object) -> object:  # noqa: ANN401  # numba has no types
    """In place of the method of numba's cache that fills the tables first."""
    from numba.core.runtime import rtsys

    rtsys.initialize(target)
    with kept._guard_against_spurious_io_errors():
        return kept._load_overload(signature, target)
