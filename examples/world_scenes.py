"""Avatar and hand in the paper's scenes: a filmstrip, a movie, and the time of every frame of each.

python examples/world_scenes.py      # writes out/world/<scene>.png, .mp4 and -times.png
"""

import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from mhvedit.export.movie import write_movie
from mhvedit.geometry.arrays import ByteArray, FloatArray
from mhvedit.view.stage import add_person
from mhvedit.view.studio import UP, Camera, empty_stage, studio, take_picture
from mhvedit.view.style import SUBJECTS, dress, figure_picture, new_figure
from mhvedit.world.avatar_scenes import AVATAR_SCENES, WorldScene, avatar_scene
from mhvedit.world.hand_scenes import HAND_SCENES, hand_scene
from mhvedit.world.meshes import body_mesh, figure_mesh
from mhvedit.world.simulate import Simulation
from mhvedit.world.world import State, start

SIZE, SHARES = (480, 360), (0.15, 0.26, 0.52, 0.88)  # pixels; of the motion, in a filmstrip
SHOWN = {"hand on table": ("table", "hand", "ball"), "hand along corner": ("corner", "hand")}
WALLS = ("wall_front", "wall_left")
EYES = {"hand on table": (-3.4, -0.6, 1.7), "hand along corner": (3.0, 3.4, 1.9)}
TARGETS = {"hand on table": (-2.1, 1.0, 0.7), "hand along corner": (2.2, 2.2, 1.2)}


def main(out: Path = Path("out/world"), n_frames: int = 600) -> None:
    """All scenes."""
    out.mkdir(parents=True, exist_ok=True)
    for name in (*AVATAR_SCENES, *HAND_SCENES):
        scene = (avatar_scene if name in AVATAR_SCENES else hand_scene)(name, n_frames=n_frames)
        states, times = stepped(scene)
        file = out / name.replace(" ", "-")
        strip = list(pictures(scene, [states[int(share * n_frames)] for share in SHARES]))
        Image.fromarray(np.concatenate(strip, axis=1)).save(file.with_suffix(".png"))
        write_movie(pictures(scene, states[::2]), file.with_suffix(".mp4"), size=SIZE, fps=scene.fps / 2)
        Image.fromarray(times_picture(name, times)).save(file.with_name(f"{file.name}-times.png"))
        print(f"{name}: median {np.median(times):.2f} ms")


def stepped(scene: WorldScene) -> tuple[list[State], FloatArray]:
    """State of every frame, and ms that it took."""
    simulation, state, states, times = Simulation(scene.world), start(scene.world, scene.poses), [], []
    for tracked in scene.tracked:
        began = time.perf_counter()
        state, _ = simulation.step(state, tracked, 1 / scene.fps)
        times.append(1000 * (time.perf_counter() - began))
        states.append(state)
    return states, np.array(times)


def pictures(scene: WorldScene, states: Sequence[State]) -> Iterator[ByteArray]:
    """(H, W, 3) of each state."""
    eye, target = EYES.get(scene.name, (-2.6, 1.9, 2.2)), TARGETS.get(scene.name, (0.1, -0.2, 1.0))
    camera = Camera(np.array(eye), np.array(target), UP, view_angle=32.0)
    with studio(*SIZE) as plotter:
        for state in states:
            empty_stage(plotter)
            for i, name in enumerate(SHOWN.get(scene.name, WALLS)):
                add_person(plotter, body_mesh(scene.world, state, name), SUBJECTS[i] if i else "#9aa3ab")
            if scene.world.figure is not None:
                add_person(plotter, figure_mesh(scene.world, state), SUBJECTS[0])
            yield take_picture(plotter, camera)


def times_picture(name: str, times: FloatArray) -> ByteArray:
    """(H, W, 3) the time of every frame, as the paper's figures 7 and 8."""
    axes = (figure := new_figure(7.0, 3.0)).add_subplot()
    axes.plot(times, color=SUBJECTS[0], linewidth=1.0)
    dress(axes, title=name, x="frame", y="ms")
    figure.tight_layout()
    return figure_picture(figure)


if __name__ == "__main__":
    main()
