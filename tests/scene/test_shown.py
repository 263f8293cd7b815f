"""Stopped meshes as frames of captures: one door for everybody who asks what is shown."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mhvedit.errors import CaptureError
from mhvedit.files import write_arrays
from mhvedit.geometry.planar import apply_pose
from mhvedit.scene.edit import EditedScene, SubjectEdit, edit_as_dict, placed_mesh, read_edit, touched_path
from mhvedit.scene.shown import OWN, shown_capture, shown_numbers, shown_scene
from mhvedit.scene.touched import THING, Touched, open_touched
from mhvedit.sequences.frame_looks import frame_looks
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.sequences.read import open_capture

FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], np.int32)
CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
SOURCE = np.array([5, 5, 6, 7])
STOPPED = (1, 2)  # frames of the scene; frames 0 and 1 show the same captured frame
MOVE = np.array([[0.0, -1, 0, 0.5], [1, 0, 0, 0.0], [0, 0, 1, 0.2]])  # a quarter turn, and a shift


def captured(number: int) -> Mesh:
    return Mesh(CORNERS + number, FACES)


def capture(name: str = "anna") -> MeshSequence:
    return MeshSequence(name, (5, 6, 7), 25.0, captured)


def write_touched(path: Path) -> Touched:
    path.parent.mkdir(exist_ok=True)
    arrays = {
        "vertices": np.concatenate([CORNERS + SOURCE[k] + [0, 0, 0.1] for k in STOPPED]),
        "faces": np.concatenate([FACES] * 2),
        "vertex_counts": np.array([4, 4]),
        "face_counts": np.array([4, 4]),
        "frame_numbers": np.array(STOPPED),
        "fps": np.array(25.0),
        f"{THING}sword": np.array([MOVE, MOVE]),
    }
    write_arrays(path, arrays)
    return open_touched(path)


def edited(folder: Path) -> EditedScene:
    touched = write_touched(folder / touched_path("anna"))
    placements = np.array([[float(k), 0.0, 0.5 * k] for k in range(4)])
    return EditedScene("reach", 25.0, 4, {"anna": SubjectEdit(SOURCE, placements, touched)}, (), 0.0, 0.0, 0.0)


def test_stopped_frames_have_numbers_of_their_own(tmp_path: Path) -> None:
    edit = edited(tmp_path).subjects["anna"]
    assert shown_numbers(edit).tolist() == [5, OWN + 1, OWN + 2, 7]
    assert shown_numbers(replace(edit, touched=None)).tolist() == SOURCE.tolist()
    shown = shown_capture(capture(), edit)
    assert shown.numbers == (5, 6, 7, OWN + 1, OWN + 2)
    np.testing.assert_allclose(shown.mesh(OWN + 2).vertices, CORNERS + 6 + [0, 0, 0.1])
    np.testing.assert_array_equal(shown.mesh(6).vertices, CORNERS + 6)
    assert [shown.origin(n) for n in shown.numbers] == [5, 6, 7, 5, 6]
    plain = capture()
    assert shown_capture(plain, replace(edit, touched=None)) is plain


def test_what_is_held_moves_with_the_hand_and_other_things_stay(tmp_path: Path) -> None:
    edit = edited(tmp_path).subjects["anna"]
    sword, hat = (shown_capture(capture(), edit, part) for part in ("sword", "hat"))
    there = CORNERS + 5
    np.testing.assert_allclose(
        sword.mesh(OWN + 1).vertices, np.stack([0.5 - there[:, 1], there[:, 0], there[:, 2] + 0.2], 1)
    )
    np.testing.assert_array_equal(hat.mesh(OWN + 1).vertices, there)


def test_the_placed_mesh_is_the_same_through_both_doors(tmp_path: Path) -> None:
    scene = edited(tmp_path)
    shown, captures = shown_scene(scene), {"anna": shown_capture(capture(), scene.subjects["anna"])}
    for k in range(4):
        direct = placed_mesh(scene, {"anna": capture()}, "anna", k)
        np.testing.assert_array_equal(placed_mesh(shown, captures, "anna", k).vertices, direct.vertices)
        lift = 0.1 * (k in STOPPED)
        pose = scene.subjects["anna"].placements[k]
        np.testing.assert_allclose(direct.vertices, apply_pose(pose, CORNERS + SOURCE[k] + np.array([0, 0, lift])))


def test_an_edit_names_its_stopped_meshes_and_is_what_it_was_for_older_readers(tmp_path: Path) -> None:
    scene = edited(tmp_path)
    told = edit_as_dict(scene)
    assert told["subjects"]["anna"].pop("touched") == {"meshes": "touched/anna.npz", "frames": [1, 2]}
    plain = replace(scene, subjects={"anna": replace(scene.subjects["anna"], touched=None)})
    assert told == edit_as_dict(plain)
    (tmp_path / "edit.json").write_text(json.dumps(edit_as_dict(scene)))
    assert edit_as_dict(read_edit(tmp_path / "edit.json")) == edit_as_dict(scene)


@pytest.mark.parametrize("fault", ["missing", "other frames", "damaged"])
def test_an_edit_without_its_meshes_is_refused_in_a_sentence(tmp_path: Path, fault: str) -> None:
    told = edit_as_dict(edited(tmp_path))
    file = tmp_path / touched_path("anna")
    if fault == "missing":
        file.unlink()
    elif fault == "damaged":
        file.write_bytes(file.read_bytes()[:200])
    else:
        told["subjects"]["anna"]["touched"]["frames"] = [1, 3]
    (tmp_path / "edit.json").write_text(json.dumps(told))
    with pytest.raises(CaptureError, match=r"anna\.npz: expected "):
        read_edit(tmp_path / "edit.json")


def test_a_stopped_frame_looks_like_the_captured_one(tmp_path: Path) -> None:
    folder = tmp_path / "anna"
    folder.mkdir()
    for number in (5, 6, 7):
        rows = "\n".join(f"{x} {y} {z} {10 * number} 0 0" for x, y, z in CORNERS + number)
        faces = "\n".join(f"3 {a} {b} {c}" for a, b, c in FACES)
        colours = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
        (folder / f"anna_{number}.ply").write_text(
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
            f"{colours}element face 4\nproperty list uchar int vertex_indices\nend_header\n{rows}\n{faces}\n"
        )
    shown = shown_capture(open_capture(folder, name="anna"), edited(tmp_path).subjects["anna"])
    own, theirs = frame_looks(shown, OWN + 2), frame_looks(shown, 6)
    assert own is not None and theirs is not None and own.colours is not None
    np.testing.assert_array_equal(own.colours, theirs.colours)
    assert shown.files[-1].name == "anna.npz" and len(shown.files) == len(shown.numbers)
