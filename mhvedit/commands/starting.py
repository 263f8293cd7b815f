"""What a command does without, so as to answer sooner."""

import os


def start_lean() -> None:
    """Spare this process what its work has no need of; to be called before anything large is imported.

    SciPy's BLAS: numba imports `scipy.linalg` when it loads a first kernel, only to know whether `np.correlate` may use
    it there. Kernels that multiply matrices ask for BLAS themselves. Threads of NumPy's BLAS: for small matrices they
    would only spin beside the search.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from numba.np import linalg

    asked = getattr(linalg, "ensure_blas", None)
    if asked is None:  # another numba, which asks in another way
        return
    linalg.ensure_blas = _no_blas
    try:
        import numba.np.arraymath  # noqa: F401  # asks when it is imported
    finally:
        linalg.ensure_blas = asked


def _no_blas() -> None:
    raise ImportError("not asked for")
