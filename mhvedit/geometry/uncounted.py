"""Arrays that compiled code does not count references to."""

from collections.abc import Callable

from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def uncounted(_: object, array: Callable[..., object]) -> tuple[object, Callable[..., object]]:
    """The same array as a view that owns nothing, for use inside a kernel whose caller keeps the array.

    Compiled functions count references to each array that they are given, atomically, on entry and on return, which
    takes longer than a small function's work.
    """
    return array(array), _without_owner


def _without_owner(context, builder, signature, arguments):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    view = cgutils.create_struct_proxy(signature.return_type)(context, builder, value=arguments[0])
    view.meminfo = cgutils.get_null_value(view.meminfo.type)
    view.parent = cgutils.get_null_value(view.parent.type)
    return view._getvalue()
