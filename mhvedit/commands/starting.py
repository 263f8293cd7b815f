"""What a command does without, so as to answer sooner."""

import gc
import os
import struct
from collections.abc import Iterator
from typing import Any, Final
from weakref import WeakKeyDictionary

TRIED: Final = "0.68."  # versions of numba of which kept kernels are known to load in this way
COLLECT_AT: Final = 100_000, 50, 50  # objects more than there were, and how many of such searches before a larger one
ELF: Final = b"\x7fELF\x02\x01"  # how object code of 64 bits, low byte first, begins
SECTION: Final = struct.Struct("<II4QII2Q")  # name, type, flags, address, offset, size, link, info, two more
SYMBOL: Final = struct.Struct("<IBBHQQ")  # name, binding and type, visibility, section, value, size
SYMBOLS: Final = 2  # type of a section


def start_lean() -> None:
    """Spare this process what its work has no need of; to be called before anything large is imported.

    SciPy's BLAS: numba imports `scipy.linalg` when it loads a first kernel, only to know whether `np.correlate` may use
    it there. Kernels that multiply matrices ask for BLAS themselves. The compiler's tables: numba fills them before it
    loads a first kernel that is kept, which needs no more than its way to allocate memory; where one has to be
    compiled after all, the compiler fills them itself. The compiler's own form of a kept kernel: it is read only when
    another one that calls it is compiled. Notes of each call to the compiler's library, which nobody reads. Threads of
    NumPy's BLAS: for small matrices they would only spin beside the search. Most searches for garbage: what is imported
    stays.
    """
    gc.set_threshold(*COLLECT_AT)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    import numba
    from numba.np import linalg

    if numba.__version__.startswith(TRIED):
        _load_lean()
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


def _load_lean() -> None:
    """Put what is needed to run kept kernels in place of what is needed to compile as well."""
    from llvmlite import binding
    from numba.core import caching, codegen

    library = codegen.JITCodeLibrary
    whole, linked = library._unserialize, library._get_module_for_linking
    bitcode: WeakKeyDictionary[object, bytes] = WeakKeyDictionary()

    def unserialized(of: Any, kept: Any) -> object:  # noqa: ANN401  # numba has no types, here and below
        name, kind, content = kept
        if kind != "object" or not content[0].startswith(ELF):
            return whole(of, kept)
        made = of.create_library(name)
        made.enable_object_caching()
        made._set_compiled_object(content[0])
        made._finalize_final_module()
        of._engine._defined_symbols.update(_defined(content[0]))
        bitcode[made] = content[1]
        return made

    def for_linking(made: Any) -> object:  # noqa: ANN401
        if made in bitcode:
            made._shared_module = binding.parse_bitcode(bitcode.pop(made))
        return linked(made)

    caching.Cache.load_overload = _load_overload
    library._unserialize = staticmethod(unserialized)
    library._get_module_for_linking = for_linking
    binding.ffi.lib._lock._cblist.clear()


def _load_overload(kept: Any, signature: object, target: object) -> object:  # noqa: ANN401  # numba has no types
    """In place of the method of numba's cache that fills the tables first."""
    from numba.core.runtime import rtsys

    rtsys.initialize(target)
    with kept._guard_against_spurious_io_errors():
        return kept._load_overload(signature, target)


def _defined(code: bytes) -> Iterator[str]:
    """Names of what object code defines for others."""
    (first,), (size, count) = struct.unpack_from("<Q", code, 0x28), struct.unpack_from("<HH", code, 0x3A)
    sections = [SECTION.unpack_from(code, first + n * size) for n in range(count)]
    for _, kind, _, _, offset, length, link, local, _, _ in sections:
        if kind != SYMBOLS:
            continue
        names = sections[link][4]
        for at in range(offset + local * SYMBOL.size, offset + length, SYMBOL.size):
            name, _, _, section, _, _ = SYMBOL.unpack_from(code, at)
            if section != 0:
                yield code[names + name : code.index(0, names + name)].decode()
