"""A subject's solids and parts, from meshes and as sets."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from mhvedit.constraints.fidelity import Depth
from mhvedit.geometry.planar import apply_pose, compose
from mhvedit.sequences.canonical import capture_from_canonical
from mhvedit.sequences.meshes import BODY, JointTracks, Mesh, MeshSequence
from mhvedit.volumes.history import MotionHistoryVolume, Volume
from mhvedit.volumes.parts import InBox, NearTrack, OwnMesh, Part, WholeBody
from mhvedit.volumes.subject import (
    SubjectVolumes,
    all_of,
    deep_all_of,
    deep_part_of,
    deep_rest_of,
    part_of,
    rest_of,
    subject_volumes,
)
from tests.oracles import Depths
from tests.search.shapes import HAND, PARTS, SWORD, random_subject

PITCH = 0.05
NUMBERS = (10, 11, 13)
SEEDS = st.integers(0, 2**32 - 1)


def mesh_at(number: int) -> Mesh:
    """A lopsided block that walks along x."""
    blocks = [trimesh.creation.box((0.3, 0.5, 1)), trimesh.creation.box((0.2, 0.1, 0.2))]
    blocks[1].apply_translation([0.3, 0.4, 0.3])
    both = trimesh.util.concatenate(blocks).apply_translation([0.063 * number, 0.017, 0.511])
    return Mesh(np.asarray(both.vertices), np.asarray(both.faces, np.int32))


def sword_at(number: int) -> Mesh:
    blade = trimesh.creation.box((0.9, 0.06, 0.06)).apply_translation([0.063 * number + 0.6, 0.013, 0.912])
    return Mesh(np.asarray(blade.vertices), np.asarray(blade.faces, np.int32))


def someone(
    motion: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> tuple[MeshSequence, dict[str, Part]]:
    placed = np.array(motion)

    def sequence(name: str, at: object) -> MeshSequence:
        def load(number: int) -> Mesh:
            mesh = at(number)  # type: ignore[operator]
            return Mesh(apply_pose(placed, mesh.vertices), mesh.faces)

        return MeshSequence(name, NUMBERS, 30.0, load)

    hands = np.array([[[0.063 * n + 0.311, 0.417, 0.811]] for n in NUMBERS])
    tracks = JointTracks(np.array(NUMBERS), ("hand",), apply_pose(placed, hands))
    parts: dict[str, Part] = {HAND: NearTrack(tracks, ("hand",), 0.2), SWORD: OwnMesh(sequence("sword", sword_at))}
    return sequence("someone", mesh_at), parts


def volumes_of(
    motion: tuple[float, float, float] = (0.0, 0.0, 0.0), *, wanted: frozenset[str] = frozenset({HAND, SWORD})
) -> SubjectVolumes:
    sequence, parts = someone(motion)
    pose = capture_from_canonical(sequence)
    return subject_volumes(sequence, parts, numbers=(10, 13, 13), pose=pose, pitch=PITCH, wanted=wanted)


def same(a: MotionHistoryVolume, b: MotionHistoryVolume) -> bool:
    return a.grid == b.grid and bool((a.frames == b.frames).all()) and a.n_frames == b.n_frames


def test_volumes_do_not_depend_on_where_the_capture_stands_and_faces() -> None:
    here, there = volumes_of(), volumes_of((3.7, -2.2, 0.83))
    for name in (BODY, HAND, SWORD):
        assert same(here.parts[name].volume, there.parts[name].volume) and here.parts[name].volume.filled.any()


def test_a_sword_is_solid_even_if_no_segment_names_it_and_a_hand_only_if_one_does() -> None:
    plain = volumes_of(wanted=frozenset())
    assert set(plain.solids) == {BODY, SWORD} and set(plain.parts) == {BODY, SWORD}
    full = volumes_of()
    assert (
        set(full.parts) == {BODY, SWORD, HAND} and full.parts[HAND].solid == BODY and full.parts[SWORD].solid == SWORD
    )
    assert full.body is full.solids[BODY]


def test_the_number_of_threads_does_not_matter() -> None:
    sequence, parts = someone()
    pose, wanted = capture_from_canonical(sequence), frozenset({HAND, SWORD})
    one, three = (
        subject_volumes(sequence, parts, numbers=(10, 13, 13), pose=pose, pitch=PITCH, wanted=wanted, workers=workers)
        for workers in (1, 3)
    )
    assert set(one.parts) == set(three.parts)
    assert all(same(one.parts[name].volume, three.parts[name].volume) for name in one.parts)


def test_frames_are_the_retimed_ones() -> None:
    volumes = volumes_of()
    assert volumes.body.n_frames == 3
    np.testing.assert_array_equal(volumes.body.at(1), volumes.body.at(2))
    assert (volumes.body.at(0) != volumes.body.at(1)).any()


def test_a_part_may_be_named_body_or_select_everything() -> None:
    sequence, _ = someone()
    pose = capture_from_canonical(sequence)
    parts: dict[str, Part] = {"all": WholeBody(), "none": InBox(np.full(3, 99.0), np.ones(3))}
    volumes = subject_volumes(
        sequence, parts, numbers=(10, 11), pose=pose, pitch=PITCH, wanted=frozenset({BODY, "all", "none"})
    )
    assert same(part_of(volumes, "all"), volumes.body) and same(part_of(volumes, BODY), volumes.body)
    assert not part_of(volumes, "none").filled.any()


def test_composing_the_pose_and_the_motion_is_the_same_frame() -> None:
    sequence, parts = someone((1.0, 2.0, 0.5))
    still = capture_from_canonical(someone()[0])
    pose = compose(np.array([1.0, 2.0, 0.5]), still)
    volumes = subject_volumes(sequence, parts, numbers=(10, 13, 13), pose=pose, pitch=PITCH, wanted=frozenset({HAND}))
    assert same(volumes.parts[HAND].volume, volumes_of().parts[HAND].volume)


# As sets, against the oracle


@given(seed=SEEDS, name=st.sampled_from(PARTS), radius=st.sampled_from([0.0, 1.0, 1.5, 2.0]))
@settings(max_examples=30, derandomize=True)
def test_parts_rests_and_what_lies_deep_in_them_agree_with_brute_force(seed: int, name: str, radius: float) -> None:
    made = random_subject(np.random.default_rng(seed), 3)
    person, volumes = made.person, made.volumes
    for found, expected in (
        (part_of(volumes, name), person.part(name)),
        (rest_of(volumes, name), person.rest(name)),
        (all_of(volumes), person.everything()),
    ):
        assert filled_in(found) == deeper_than(expected, 0)
    for found, expected in (
        (deep_part_of(volumes, name, Depth(radius)), person.part(name)),
        (deep_rest_of(volumes, name, Depth(radius)), person.rest(name)),
        (deep_all_of(volumes, Depth(radius)), person.everything()),
    ):
        assert filled_in(found) == deeper_than(expected, radius)


def filled_in(volume: Volume) -> set[tuple[int, ...]]:
    return {
        (i, *(int(v) for v in cell))
        for i in range(volume.n_frames)
        for cell in np.argwhere(volume.whole.at(i)) + volume.grid.start
    }


def deeper_than(volume: Depths, radius: float) -> set[tuple[int, ...]]:
    """(frame, voxel) whose nearest empty voxel is farther than a radius."""
    return {(i, *p) for p, by_frame in volume.items() for i, depth in by_frame.items() if depth + 0.5 > radius + 1e-9}


def test_the_rest_of_someone_whose_part_is_the_body_is_what_they_hold() -> None:
    made = random_subject(np.random.default_rng(3), 2)
    assert filled_in(rest_of(made.volumes, BODY)) == filled_in(part_of(made.volumes, SWORD))


@pytest.mark.parametrize("name", [HAND, SWORD])
def test_part_and_rest_together_are_everything(name: str) -> None:
    made = random_subject(np.random.default_rng(4), 3)
    both = filled_in(part_of(made.volumes, name)) | filled_in(rest_of(made.volumes, name))
    assert both == filled_in(all_of(made.volumes))
