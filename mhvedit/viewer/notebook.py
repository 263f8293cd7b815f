"""The viewer inside a notebook: the browser's page in a frame of a cell."""

from pathlib import Path
from typing import Any

from mhvedit.errors import MissingLibrary
from mhvedit.view.studio import studio
from mhvedit.viewer.session import open_session
from mhvedit.viewer.web import LOOPBACK, VIEW_SIZE, WebViewer, free_port

PORT = 8090


def inline(path: Path | str, *, height: int = 760, port: int = PORT) -> Any:  # noqa: ANN401 - of IPython
    """Show a scene in the notebook's cell; it is served on this machine alone, as long as the notebook runs.

    Args:
        path: scene file, or output folder of `mhvedit solve`.
        height: of the frame, pixels.
        port: to begin with; the next free one is taken.

    Returns:
        What the notebook displays.

    Raises:
        MissingLibrary: this is no notebook.
        MhveditError: there is nothing to show.
    """
    try:
        from IPython.display import IFrame
    except ImportError as fault:
        raise MissingLibrary("the viewer in a notebook", "`pip install notebook`") from fault
    free = free_port(LOOPBACK[0], port)
    stage = studio(*VIEW_SIZE)
    viewer = WebViewer(open_session(Path(path)), stage.__enter__(), name=f"mhvedit {free}")
    viewer.server.controller.on_server_exited.add(lambda **_: stage.__exit__(None, None, None))
    viewer.server.start(
        port=free, host=LOOPBACK[0], exec_mode="task", open_browser=False, show_connection_info=False,
        disable_logging=True, timeout=0,
    )  # fmt: skip
    return IFrame(f"http://localhost:{free}/", width="100%", height=height)
