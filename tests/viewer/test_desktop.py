"""The viewer's window on a virtual screen."""

from pathlib import Path

import numpy as np
from PIL import Image

from tests.viewer.needed import ran_on_screen

SCRIPT = """
import sys
from pathlib import Path
import pyvista
from PIL import Image
from mhvedit.viewer.desktop import DesktopViewer
from mhvedit.viewer.session import open_session

out, pictures = Path(sys.argv[1]), Path(sys.argv[2])
session = open_session(out, workers=1)
plotter = pyvista.Plotter(off_screen=False, window_size=(1000, 640), lighting="none")
viewer = DesktopViewer(session, plotter)
viewer.refresh()
plotter.show(interactive_update=True, auto_close=False)


def take(name):
    for _ in range(3):
        viewer.tick(0.0)
        plotter.iren.process_events()
    Image.fromarray(plotter.screenshot(return_img=True)).save(pictures / f"{name}.png")


def key(name):
    iren = plotter.iren.interactor
    iren.SetKeySym(name)
    iren.InvokeEvent("KeyPressEvent")
    iren.InvokeEvent("CharEvent")


def click(x, y):
    iren = plotter.iren.interactor
    iren.SetEventInformation(x, y)
    iren.InvokeEvent("LeftButtonPressEvent")
    iren.InvokeEvent("LeftButtonReleaseEvent")


key("End")
take("first")
panels = viewer.layout
view = session.state.view
pose = view.group.poses[40]
from mhvedit.geometry.planar import rotation
x, y = viewer.map.pixels(rotation(pose[2]) @ view.grid.root_b + pose[:2])
click(int(panels.map.left + x), int(640 - 1 - panels.map.top - y))
assert session.state.preview is not None
take("clicked")
click(panels.timeline.left + 30, 20)
assert session.state.frame == 0, session.state.frame
key("space")
viewer.tick(0.2)
assert session.state.frame > 0
key("space")
key("p")
session.finish()
assert session.state.decision.pin is not None
key("h")
take("help")
key("q")
assert not viewer.open
plotter.close()
session.close()
"""


def test_a_window_shows_the_scene_and_answers_keys_and_mouse(folder: Path, tmp_path: Path) -> None:
    script = tmp_path / "window.py"
    script.write_text(SCRIPT)
    ran = ran_on_screen(script, folder / "out", tmp_path)
    assert ran.returncode == 0, ran.stderr
    first, clicked, told = (np.asarray(Image.open(tmp_path / f"{n}.png")) for n in ("first", "clicked", "help"))
    assert first.shape == (640, 1000, 3)
    scene, map_, timeline = np.s_[:550, :650], np.s_[:550, 670:], np.s_[560:]
    for part in (scene, map_, timeline):
        assert len(np.unique(first[part].reshape(-1, 3), axis=0)) > 30
    assert (first[scene][..., 2].astype(int) - first[scene][..., 0] > 40).sum() > 2000
    assert (first[scene][..., 0].astype(int) - first[scene][..., 2] > 40).sum() > 2000
    assert (first[scene] != clicked[scene]).any(-1).mean() > 0.02
    assert (first[map_] != clicked[map_]).any(-1).sum() > 100
    assert (told[scene] != clicked[scene]).any(-1).mean() > 0.05
