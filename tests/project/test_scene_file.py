import math
from collections.abc import Callable
from pathlib import Path

import pytest

from mhvedit.constraints.dictionary import InteractionType
from mhvedit.project.scene_file import load_scene
from mhvedit.project.schema import (
    FilePath,
    GazeSpec,
    InBoxSpec,
    NearBonesSpec,
    NearTrackSpec,
    OptimiseSettings,
    OwnMeshSpec,
    SearchSettings,
    SegmentSpec,
    Tolerance,
    Visibility,
    WithLabelSpec,
)
from mhvedit.sequences.segments import Retiming

SHARED = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "scenes"
SceneWith = Callable[..., Path]


def test_everything_has_its_default(scene_with: SceneWith, folder: Path) -> None:
    scene = load_scene(scene_with())
    anna, ben = scene.subjects.values()
    assert (scene.name, scene.fps, list(scene.subjects)) == ("handshake", None, ["anna", "ben"])
    assert (anna.fps, anna.units, anna.up, anna.frames) == (None, "m", "z", None)
    assert (anna.facing, anna.gaze, anna.skeleton, ben.parts) == (None, None, None, {})
    assert anna.path == FilePath("anna", (folder / "anna").resolve())
    assert scene.segments[0] == SegmentSpec(
        index=0,
        name="raise",
        between=("anna", "ben"),
        frames={"anna": range(0, 5), "ben": range(2, 6)},
        interaction=InteractionType.END_END,
        parts={"anna": "body", "ben": "body"},
        apart=None,
        visibility=None,
        retime=Retiming.ENDPOINTS,
        tolerance=Tolerance(frames=0, voxels=0.0, depth=0.03, apart=0.0),
    )
    assert scene.segments[1].between == ("ben", "anna")
    assert scene.search == SearchSettings(voxel=0.01, step=0.01, yaw_step=math.radians(2), window=4.0)
    assert (scene.search.stride, scene.search.n_yaw) == (1, 180)
    assert scene.optimise == OptimiseSettings(
        facing_weight=1.0, acceleration=0.5, alpha=10.0, slow_speed=0.01, slow_turn=0.01
    )


def test_everything_that_can_be_said(scene_with: SceneWith, folder: Path) -> None:
    (folder / "anna.bvh").touch()
    path = scene_with(
        ('name = "handshake"', 'name = "handshake"\nfps = 25'),
        ('path = "anna"', 'path = "anna"\nfps = 24.5\nunits = "cm"\nup = "y"\nfacing = 90\nskeleton = "anna.bvh"'),
        ('path = "ben"', 'path = "ben"\nframes = [1, 9]\nfacing = "anna.csv"'),
        ('path = "ben"', 'path = "ben"\ngaze = {eye = "anna.csv", target = "anna.csv"}'),
        (
            "[subjects.anna.parts]",
            '[subjects.anna.parts]\nfore-arm = {track = "anna.csv", joint = ["elbow", "hand"], radius = 1}\n'
            'sword = {path = "ben"}\nzone = {center = [0, -1, 1.5], size = [0.1, 0.2, 0.3]}\n'
            'glove = {label = 3}\n"fist.1" = {bones = ["hand", "finger"]}',
        ),
        ("ben = [2, 5]}", "ben = [2, 5]}\nparts = {anna = 'sword'}\napart = [['hand', 'body'], ['fist.1', 'body']]"),
        ('"+&+"', '"+&0"\nvisibility = {half_angle = 45, frames = [0, 3]}\nretime = "floor"\nwindow = 2'),
        ('"0&0a"', '"none"\napart = "none"\nvisibility = {half_angle = 180}\ntolerance = {frames = 2, voxels = 1.5}'),
        more="[search]\nvoxel = 0.02\nstep = 0.06\nyaw_step = 2.5\nwindow = 3\n[optimise]\nacceleration = 1\n",
    )
    scene = load_scene(str(path))
    anna, ben = scene.subjects.values()
    track = FilePath("anna.csv", (folder / "anna.csv").resolve())
    assert (scene.fps, anna.fps, anna.units, anna.up, anna.facing) == (25, 24.5, "cm", "y", math.pi / 2)
    assert anna.skeleton == FilePath("anna.bvh", (folder / "anna.bvh").resolve())
    assert (ben.frames, ben.facing, ben.gaze) == (range(1, 10), track, GazeSpec(track, track))
    assert anna.parts == {
        "fore-arm": NearTrackSpec(track, ("elbow", "hand"), 1.0),
        "sword": OwnMeshSpec(FilePath("ben", (folder / "ben").resolve())),
        "zone": InBoxSpec((0.0, -1.0, 1.5), (0.1, 0.2, 0.3)),
        "glove": WithLabelSpec(3),
        "fist.1": NearBonesSpec(("hand", "finger")),
        "hand": NearTrackSpec(track, ("hand",), 0.11),
    }
    first, second = scene.segments
    assert first.parts == {"anna": "sword", "ben": "body"}
    assert first.apart == (("hand", "body"), ("fist.1", "body"))
    assert (first.visibility, first.retime) == (Visibility(math.pi / 4, range(0, 4)), Retiming.FLOOR)
    assert (second.apart, second.visibility) == ((), Visibility(math.pi, None))
    assert second.tolerance == Tolerance(2, 1.5, 0.03, 0.0)
    assert (second.index, second.key) == (1, 'segments[1] "hold"')
    assert (scene.search.stride, scene.search.n_yaw, scene.search.window) == (3, 144, 3.0)
    assert (scene.window_of(first), scene.window_of(second)) == (2.0, 3.0)
    assert scene.optimise.acceleration == 1.0


def test_fps_is_the_first_subjects(scene_with: SceneWith) -> None:
    assert load_scene(scene_with(('path = "anna"', 'path = "anna"\nfps = 24'))).fps == 24.0
    assert load_scene(scene_with(('path = "ben"', 'path = "ben"\nfps = 24'))).fps is None


def test_three_subjects_in_any_pairs(scene_with: SceneWith, folder: Path) -> None:
    more = (
        '[subjects.carl]\npath = "ben"\n[[segments]]\nname = "3"\nbetween = ["anna", "carl"]\ninteraction = "none"\n'
        "frames = {anna = [9, 9], carl = [0, 9]}\n"
    )
    scene = load_scene(scene_with(more=more))
    assert [segment.between for segment in scene.segments] == [("anna", "ben"), ("ben", "anna"), ("anna", "carl")]


def test_a_byte_order_mark_and_windows_line_ends(scene_with: SceneWith) -> None:
    path = scene_with()
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert load_scene(path).name == "handshake"


@pytest.mark.skipif(not SHARED.exists(), reason="no shared data")
@pytest.mark.parametrize("name", ["box_follow", "crawl_out", "greeting", "pushup_grab", "salsa_open"])
def test_shared_scenes_load(name: str) -> None:
    scene = load_scene(SHARED / name / "scene.toml")
    assert (scene.name, scene.fps, list(scene.subjects)) == (name, 25.0, ["a", "b"])
    assert all(segment.tolerance.frames == 2 for segment in scene.segments)
