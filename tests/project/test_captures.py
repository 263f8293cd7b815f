from collections.abc import Callable
from pathlib import Path

import pytest

from mhvedit.errors import SceneError
from mhvedit.project.captures import open_subjects, scene_fps
from mhvedit.project.scene_file import load_scene
from mhvedit.project.subjects import Subject

SHARED = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "scenes"
SceneWith = Callable[..., Path]
PARTS = "[subjects.anna.parts]"
HAND = ('"0&0a"', '"0&0a"\nparts = {anna = "hand"}')
SPAN = 'frames 5 to 7, those of segments[1] "hold"'


def opened(path: Path) -> dict[str, Subject]:
    return open_subjects(load_scene(path), cache=None)


def refused(path: Path, expected: str) -> None:
    with pytest.raises(SceneError) as error:
        opened(path)
    assert str(error.value) == f"{path}: {expected}"


def track(file: Path, joints: tuple[str, ...], numbers: list[int]) -> None:
    rows = [f"{number},{joint},0,0,{number}" for number in numbers for joint in joints]
    file.write_text("\n".join(["frame,joint,x,y,z", *rows]))


def test_all_subjects_in_order(scene_with: SceneWith) -> None:
    assert list(opened(scene_with(HAND))) == ["anna", "ben"]


def test_the_scenes_fps(scene_with: SceneWith) -> None:
    for more, fps in (("", 30.0), ("fps = 24\n", 24.0)):
        path = scene_with(('path = "anna"', f'path = "anna"\n{more}'))
        assert scene_fps(load_scene(path), opened(path)) == fps
    path = scene_with(("version = 1", "version = 1\nfps = 50"))
    assert scene_fps(load_scene(path), opened(path)) == 50.0


def test_frames_outside_the_capture(scene_with: SceneWith) -> None:
    key = 'segments[1] "hold".frames.ben: expected frames'
    refused(scene_with(("ben = [7, 9]", "ben = [7, 12]")), f"{key} from 0 to 9, those of the capture, found [7, 12]")
    cut = scene_with(('path = "ben"', 'path = "ben"\nframes = [1, 8]'))
    refused(cut, f"{key} from 1 to 8, those of subjects.ben.frames, found [7, 9]")


def test_frames_missing_in_the_capture(scene_with: SceneWith, folder: Path) -> None:
    for number in (1, 2, 3):
        (folder / "anna" / f"body_{number:03}.obj").unlink()
    refused(
        scene_with(),
        'segments[0] "raise".frames.anna: expected frames that the capture has, found [0, 4] without frames 1, 2, 3',
    )


def test_frames_missing_in_an_own_mesh(scene_with: SceneWith, folder: Path) -> None:
    (folder / "ben" / "body_006.obj").unlink()
    path = scene_with((PARTS, f'{PARTS}\nsword = {{path = "ben"}}'), ("ben = [7, 9]", "ben = [9, 9]"))
    refused(path, f"subjects.anna.parts.sword.path: expected {SPAN}, found no frame 6")


def test_frames_missing_in_a_track(scene_with: SceneWith, folder: Path) -> None:
    track(folder / "anna.csv", ("hand",), [0, 1, 2, 5, 7])
    refused(scene_with(HAND), f'subjects.anna.parts.hand.track: expected joint "hand" in {SPAN}, found none in frame 6')
    apart = scene_with(('"0&0a"', '"0&0a"\napart = [["body", "hand"]]'))
    refused(apart, f'subjects.anna.parts.hand.track: expected joint "hand" in {SPAN}, found none in frame 6')
    opened(scene_with())


def test_frames_missing_of_one_joint(scene_with: SceneWith, folder: Path) -> None:
    track(folder / "anna.csv", ("hand", "elbow"), [5, 6])
    with (folder / "anna.csv").open("a") as file:
        file.write("\n7,hand,0,0,0\n")
    path = scene_with(HAND, ('joint = "hand"', 'joint = ["hand", "elbow"]'))
    refused(path, f'subjects.anna.parts.hand.track: expected joint "elbow" in {SPAN}, found none in frame 7')


def test_frames_missing_in_a_skeleton(scene_with: SceneWith, folder: Path) -> None:
    (folder / "anna.bvh").write_text(
        "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 1 Xposition\nEnd Site\n{\nOFFSET 0 0 1\n}\n}\n"
        "MOTION\nFrames: 6\nFrame Time: 0.04\n" + "0\n" * 6
    )
    path = scene_with(
        ('path = "anna"', 'path = "anna"\nskeleton = "anna.bvh"'),
        (PARTS, f'{PARTS}\n"spine.1" = {{bones = ["Hips"]}}'),
        ('"0&0a"', '"0&0a"\nparts = {anna = "spine.1"}'),
    )
    refused(path, f"subjects.anna.skeleton: expected {SPAN}, found no frames 6, 7")


def test_frames_missing_in_a_gaze(scene_with: SceneWith, folder: Path) -> None:
    track(folder / "eye.csv", ("eye",), list(range(10)))
    track(folder / "target.csv", ("target", "eye"), [0, 1, 5])
    gaze = ('path = "anna"', 'path = "anna"\ngaze = {eye = "eye.csv", target = "target.csv"}')
    opened(scene_with(gaze))
    path = scene_with(gaze, ('"0&0a"', '"0&0a"\nvisibility = {half_angle = 40}'))
    refused(path, f"subjects.anna.gaze.target: expected a position in {SPAN}, found none in frames 6, 7")


def test_visible_frames_outside_the_segment(scene_with: SceneWith) -> None:
    path = scene_with(('"0&0a"', '"0&0a"\nvisibility = {half_angle = 40, frames = [2, 3]}'))
    expected = "expected frames of the segment, counted from 0 to 2, found [2, 3]"
    refused(path, f'segments[1] "hold".visibility.frames: {expected}')
    opened(scene_with(('"0&0a"', '"0&0a"\nvisibility = {half_angle = 40, frames = [2, 2]}')))


@pytest.mark.skipif(not SHARED.exists(), reason="no shared data")
@pytest.mark.parametrize("name", ["box_follow", "crawl_out", "greeting", "pushup_grab", "salsa_open"])
def test_shared_scenes_open(name: str) -> None:
    subjects = opened(SHARED / name / "scene.toml")
    assert list(subjects) == ["a", "b"]
    assert all(subject.sequence.fps == 25 for subject in subjects.values())
