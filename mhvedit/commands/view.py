"""`mhvedit view`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mhvedit.commands.shared import Workers, progress_bar, say

if TYPE_CHECKING:
    from mhvedit.viewer.session import Session

EXTRA = "the viewer in a browser"
INSTALL_WEB = "`pip install 'mhvedit[web]'`"


def view(
    path: Annotated[
        Path, typer.Argument(help="Scene file (.toml), or output folder of `mhvedit solve` or `mhvedit avoid`.")
    ],
    web: Annotated[bool, typer.Option("--web", help="Serve a scene to a browser instead of opening a window.")] = False,
    shot: Annotated[Path | None, typer.Option(help="Draw one picture (.png, .webp, .jpg) without a screen.")] = None,
    segment: Annotated[str | None, typer.Option(help="Key segment to begin with.")] = None,
    frame: Annotated[int | None, typer.Option(help="Frame to begin with.")] = None,
    port: Annotated[int, typer.Option(min=1, max=65535, help="Of `--web`; the next free one is taken.")] = 8080,
    host: Annotated[str, typer.Option(help="Address that `--web` listens on.")] = "127.0.0.1",
    workers: Workers = 2,
) -> None:
    """Look at a scene, choose other solutions, and save the choice; or look at a motion before and after `avoid`."""
    from mhvedit.pipeline.folders import is_motion_folder
    from mhvedit.view.studio import check_can_draw
    from mhvedit.viewer.session import open_session

    check_can_draw()
    if shot is not None:
        from mhvedit.viewer.shot import check_shot

        check_shot(shot)
    if is_motion_folder(path):
        _view_motion(path, web=web, shot=shot, segment=segment, frame=frame)
        return
    session = open_session(path, workers=workers, tell=say)
    try:
        if segment is not None:
            session.go_to_segment(segment)
        if shot is not None:
            _draw(session, shot, frame)
        elif web:
            _begin_at(session, frame)
            _serve(session, host, port)
        else:
            from mhvedit.viewer.desktop import open_window

            _begin_at(session, frame)
            open_window(session)
    finally:
        session.close()


def _view_motion(path: Path, *, web: bool, shot: Path | None, segment: str | None, frame: int | None) -> None:
    """A motion before and after: in a window, or one picture of it."""
    from mhvedit.errors import CaptureError
    from mhvedit.viewer.motion import open_motion_folder, started
    from mhvedit.viewer.state import at_known_frame

    if segment is not None:
        raise CaptureError("--segment", "a scene, which has segments", f"the motion {path}")
    if web and shot is None:
        raise CaptureError(
            "--web", "a scene; a motion is shown in a window or by --shot FILE.png", f"the motion {path}"
        )
    state = started(open_motion_folder(path))
    if frame is not None:
        state = at_known_frame(state, frame)
    if shot is None:
        from mhvedit.viewer.motion_desktop import open_motion_window

        open_motion_window(state)
    else:
        from mhvedit.viewer.motion_shot import motion_shot
        from mhvedit.viewer.shot import save_shot

        save_shot(motion_shot(state), shot)
        print(f"drawn {shot}")


def _begin_at(session: "Session", frame: int | None) -> None:
    """Go to a frame, if one was asked for."""
    from mhvedit.viewer.state import at_known_frame

    if frame is not None:
        session.do(lambda now: at_known_frame(now, frame))


def _draw(session: "Session", file: Path, frame: int | None) -> None:
    """One picture, of the answer: what is not solved yet is solved first."""
    from mhvedit.viewer.shot import save_shot, shot

    with progress_bar(quiet=False) as tell:
        session.finish(tell)
    if session.message and session.message != "solved":
        say(session.message)
    session.go_to_moment()
    _begin_at(session, frame)
    save_shot(shot(session.state, volumes=session.volumes()), file)
    print(f"drawn {file}")


def _serve(session: "Session", host: str, port: int) -> None:
    from mhvedit.errors import MissingLibrary
    from mhvedit.view.studio import studio

    try:
        from mhvedit.viewer.web import VIEW_SIZE, serve
    except ImportError as fault:
        raise MissingLibrary(EXTRA, INSTALL_WEB) from fault
    with studio(*VIEW_SIZE) as plotter:
        serve(session, plotter, host=host, port=port, tell=lambda words: print(words, flush=True))
