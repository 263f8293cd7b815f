from collections.abc import Callable
from math import pi
from pathlib import Path

import numpy as np
import pytest

from mhvedit.errors import CaptureError, SceneError
from mhvedit.project.scene_file import load_scene
from mhvedit.project.subjects import Subject, open_subject, some
from mhvedit.sequences.meshes import JointTracks
from mhvedit.volumes.parts import InBox, NearBones, NearTrack, OwnMesh, WholeBody, WithLabel

SceneWith = Callable[..., Path]
ANNA = 'path = "anna"'
PARTS = "[subjects.anna.parts]"
BVH = (
    """\
HIERARCHY
ROOT Hips
{
OFFSET 0 0 0
CHANNELS 3 Xposition Yposition Zposition
JOINT Hand
{
OFFSET 1 2 3
CHANNELS 0
End Site
{
OFFSET 0 0 1
}
}
}
MOTION
Frames: 8
Frame Time: 0.04
"""
    + "0 0 0\n" * 8
)


def opened(path: Path, name: str = "anna") -> Subject:
    return open_subject(load_scene(path).subjects[name], cache=None)


def refused(path: Path, expected: str, name: str = "anna") -> None:
    with pytest.raises(SceneError) as error:
        opened(path, name)
    assert str(error.value) == f"{path}: {expected}"


def test_plain(scene_with: SceneWith) -> None:
    anna = opened(scene_with())
    assert (anna.name, anna.sequence.name, anna.sequence.numbers) == ("anna", "anna", tuple(range(10)))
    assert (anna.sequence.fps, anna.facing, anna.gaze, anna.skeleton) == (30.0, None, None, None)
    assert list(anna.parts) == ["body", "hand"]
    hand = anna.parts["hand"]
    assert isinstance(anna.parts["body"], WholeBody) and isinstance(hand, NearTrack)
    assert (hand.joints, hand.radius, hand.tracks.joints) == (("hand",), 0.11, ("hand", "elbow"))


def test_units_and_up_axis_hold_for_files_and_metres_for_the_scene_file(scene_with: SceneWith, folder: Path) -> None:
    (folder / "anna.bvh").write_text(BVH)
    (folder / "anna.csv").write_text("frame,joint,x,y,z\n0,hand,1,2,3\n")
    anna = opened(
        scene_with(
            (ANNA, f'{ANNA}\nunits = "cm"\nup = "y"\nfps = 24\nskeleton = "anna.bvh"'),
            (
                PARTS,
                f"{PARTS}\nzone = {{center = [1, 2, 3], size = [0.1, 0.2, 0.3]}}\nglove = {{label = 3}}\n"
                'sword = {path = "ben"}\narm = {bones = ["Hips"]}',
            ),
        )
    )
    assert list(anna.parts) == ["body", "zone", "glove", "sword", "arm", "hand"]
    hand, zone, sword, arm = (anna.parts[name] for name in ("hand", "zone", "sword", "arm"))
    assert isinstance(hand, NearTrack) and isinstance(zone, InBox)
    assert isinstance(sword, OwnMesh) and isinstance(arm, NearBones)
    np.testing.assert_allclose(anna.sequence.mesh(0).vertices[1:], [[0.01, 0, 0], [0, 0, 0.01], [0, -0.01, 0]])
    np.testing.assert_allclose(sword.sequence.mesh(9).vertices, anna.sequence.mesh(0).vertices)
    np.testing.assert_allclose(hand.tracks.positions[0, 0], [0.01, -0.03, 0.02])
    assert hand.radius == 0.11
    np.testing.assert_allclose(zone.centre, [1, -3, 2])
    np.testing.assert_allclose(zone.size, [0.1, 0.3, 0.2])
    np.testing.assert_allclose(arm.tracks.positions[0, 1], [0.01, -0.03, 0.02])
    assert anna.skeleton is not None and arm.tracks is anna.skeleton.tracks
    assert (sword.sequence.name, sword.sequence.fps) == ("anna.sword", 24.0)
    glove = anna.parts["glove"]
    assert isinstance(glove, WithLabel) and glove.label == 3


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_facing_in_degrees_turns_about_up(scene_with: SceneWith, up: str) -> None:
    assert opened(scene_with((ANNA, f'{ANNA}\nup = "{up}"\nfacing = -90'))).facing == pytest.approx(-pi / 2)


def test_facing_and_gaze_from_tracks(scene_with: SceneWith, folder: Path) -> None:
    rows = [f"{number},{joint},0,1,{number}" for number in range(10) for joint in ("facing", "eye", "target")]
    (folder / "look.csv").write_text("\n".join(["frame,joint,x,y,z", *rows]))
    anna = opened(scene_with((ANNA, f'{ANNA}\nfacing = "look.csv"\ngaze = {{eye = "look.csv", target = "look.csv"}}')))
    assert isinstance(anna.facing, JointTracks) and anna.gaze is not None
    assert anna.facing.joints == ("facing", "eye", "target")
    assert anna.gaze.eye is anna.gaze.target is anna.facing


def test_a_single_joint_may_have_any_name(scene_with: SceneWith, folder: Path) -> None:
    (folder / "nose.csv").write_text("frame,joint,x,y,z\n" + "".join(f"{i},nose,1,0,0\n" for i in range(10)))
    assert isinstance(opened(scene_with((ANNA, f'{ANNA}\nfacing = "nose.csv"'))).facing, JointTracks)


def test_a_cut_of_the_capture(scene_with: SceneWith) -> None:
    path = scene_with((ANNA, f"{ANNA}\nframes = [2, 8]"))
    sequence = opened(path).sequence
    assert sequence.numbers == tuple(range(2, 9))
    assert [file.name for file in sequence.files] == [f"body_{i:03}.obj" for i in range(2, 9)]
    too_long = scene_with((ANNA, f"{ANNA}\nframes = [2, 10]"))
    refused(too_long, "subjects.anna.frames: expected frames of the capture, which has 0 to 9, found [2, 10]")


def test_unknown_joints_and_bones(scene_with: SceneWith, folder: Path) -> None:
    path = scene_with(('joint = "hand"', 'joint = ["hand", "ellbow"]'))
    known = 'expected one of hand, elbow, found "ellbow" (did you mean "elbow"?)'
    refused(path, f"subjects.anna.parts.hand.joint: {known}")
    (folder / "anna.bvh").write_text(BVH)
    for bone, hint in (("hips", ' (did you mean "Hips"?)'), ("Hand_end", ' (did you mean "Hand"?)'), ("Tail", "")):
        path = scene_with(
            (ANNA, f'{ANNA}\nskeleton = "anna.bvh"'), (PARTS, f'{PARTS}\narm = {{bones = ["Hips", "{bone}"]}}')
        )
        refused(path, f'subjects.anna.parts.arm.bones: expected one of Hips, Hand, found "{bone}"{hint}')


def test_facing_and_gaze_that_lack_something(scene_with: SceneWith, folder: Path) -> None:
    (folder / "look.csv").write_text("frame,joint,x,y,z\n0,eye,1,0,0\n3,eye,1,0,0\n3,target,1,0,0\n")
    joint = 'found "eye, target"'
    refused(
        scene_with((ANNA, f'{ANNA}\nfacing = "look.csv"')),
        f'subjects.anna.facing: expected a track file with a joint "facing", or with a single joint, {joint}',
    )
    refused(
        scene_with((ANNA, f'{ANNA}\ngaze = {{eye = "look.csv", target = "anna.csv"}}')),
        'subjects.anna.gaze.target: expected a track file with a joint "target", or with a single joint, '
        'found "hand, elbow"',
    )
    (folder / "look.csv").write_text("frame,joint,x,y,z\n0,facing,1,0,0\n3,facing,1,0,0\n")
    refused(
        scene_with((ANNA, f'{ANNA}\nfacing = "look.csv"')),
        "subjects.anna.facing: expected a direction in every frame of the capture, "
        "found none in frames 1, 2, 4 and 5 more",
    )


def test_files_that_cannot_be_used_say_so_themselves(scene_with: SceneWith, folder: Path) -> None:
    (folder / "anna.csv").write_text("frame;joint\n")
    with pytest.raises(CaptureError, match=r"anna.csv: line 1: expected the header frame,joint,x,y,z"):
        opened(scene_with())
    (folder / "empty").mkdir()
    with pytest.raises(CaptureError, match="empty: expected numbered files"):
        opened(scene_with((ANNA, 'path = "empty"')))


@pytest.mark.parametrize(
    ("numbers", "said"),
    [([3], "frame 3"), ([3, 4, 5], "frames 3, 4, 5"), (range(3, 9), "frames 3, 4, 5 and 3 more")],
)
def test_some(numbers: list[int], said: str) -> None:
    assert some(numbers) == said
