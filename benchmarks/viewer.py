"""How fast the viewer answers: a click on the map, playback, and memory over a long clip.

Everything is drawn offscreen; where "drawn by" says llvmpipe there is no graphics card, and the processor draws.
"""

import resource
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyvista

from mhvedit import api
from mhvedit.pipeline.bundled import bundled_scene
from mhvedit.sequences.meshes import Mesh
from mhvedit.view.studio import studio
from mhvedit.viewer.decisions import decisions_of
from mhvedit.viewer.map2d import draw_map, marked
from mhvedit.viewer.material import Actor, Material, material_of
from mhvedit.viewer.scene3d import Scene3D, prepare, scene_picture
from mhvedit.viewer.state import ViewerState, at_frame, in_segment, looked_at_row, started

SIZE = (1280, 720)
LONG = 1000  # frames
CLICKS = 12


def main() -> None:
    """Measure on the bundled duel, and on two bodies of 20,000 faces."""
    with TemporaryDirectory() as folder, studio(*SIZE) as plotter:
        result = api.solve(api.load(bundled_scene("demo"), cache=Path(folder)))
        prepare(plotter)
        scene = Scene3D(plotter)
        state = in_segment(started(material_of(result), decisions_of(result.job.scene)).now, "02-cut-parried")
        scene_picture(scene, state)
        lines = plotter.render_window.ReportCapabilities().splitlines()
        print("drawn by:", next(line.split(":")[1].strip() for line in lines if "renderer" in line))
        print(f"click on the map to both pictures: {1000 * clicks(scene, state):.0f} ms (slowest of {CLICKS})")
        long = replace(state, material=long_clip(state.material), playing=True)
        plotter.render_window.SetMultiSamples(0)
        before = peak()
        first, again = play(scene, long, LONG), play(scene, long, 100)
        shown = f"two bodies of {faces(long)} faces at {SIZE[0]}x{SIZE[1]}"
        print(f"{shown}: {1 / first:.0f} frames a second over {LONG} frames, none of which was kept")
        print(f"the last 100 of these again, from the cache: {1 / again:.0f} frames a second")
        print(f"frames kept: {scene.frames.n_bytes >> 20} MB; peak memory grew by {peak() - before} MB")


def clicks(scene: Scene3D, state: ViewerState) -> float:
    """Seconds from a click until map and scene are drawn; the slowest."""
    view = state.view
    assert view is not None
    map_ = draw_map(state, width=460, height=640)
    assert map_ is not None
    spent = []
    for row in np.linspace(0, view.n_solutions - 1, CLICKS).astype(int):
        begun = time.perf_counter()
        now = looked_at_row(state, int(row))
        marked(map_, now)
        scene.draw(now)
        scene.plotter.render()
        scene.plotter.screenshot(return_img=True)
        spent.append(time.perf_counter() - begun)
    return max(spent)


def play(scene: Scene3D, state: ViewerState, count: int) -> float:
    """Seconds a frame."""
    begun = time.perf_counter()
    for frame in range(LONG - count, LONG):
        scene.draw(at_frame(state, frame))
        scene.plotter.render_window.Render()
    return (time.perf_counter() - begun) / count


def long_clip(material: Material) -> Material:
    """The same people as blobs of 20,000 faces with other vertices in every frame."""
    ball = pyvista.Sphere(radius=0.4, center=(0, 0, 1), theta_resolution=101, phi_resolution=101)
    points, triangles = np.asarray(ball.points, np.float64), ball.regular_faces.astype(np.int32)
    numbers = np.arange(LONG)

    def blob(number: int) -> Mesh:
        return Mesh(points * (1 + 0.05 * np.sin(number / 9)), triangles)

    def long(actor: Actor) -> Actor:
        sequence = replace(actor.sequence, numbers=tuple(range(LONG)), load=blob)
        return replace(actor, sequence=sequence, things=(), numbers=numbers, centres=np.zeros((LONG, 2)))

    tracks = {
        name: replace(track, source=numbers, placements=np.resize(track.placements, (LONG, 3)))
        for name, track in material.tracks.items()
    }
    cast = {name: long(actor) for name, actor in material.cast.items()}
    return replace(material, n_frames=LONG, tracks=tracks, cast=cast, segments=(), spans=())


def faces(state: ViewerState) -> int:
    """Of one body."""
    return len(next(iter(state.material.cast.values())).sequence.mesh(0).faces)


def peak() -> int:
    """MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10


if __name__ == "__main__":
    main()
