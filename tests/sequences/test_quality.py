import numpy as np
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from mhvedit.sequences.meshes import Mesh
from mhvedit.sequences.quality import FrameQuality, measure_mesh

BALL = trimesh.creation.icosphere(subdivisions=2)
V, F = np.asarray(BALL.vertices), np.asarray(BALL.faces)


def quality(vertices: object, faces: object) -> FrameQuality:
    return measure_mesh(Mesh(np.asarray(vertices, np.float64), np.asarray(faces, np.int32)), 4)


def test_a_ball_is_sound() -> None:
    q = quality(V, F)
    assert q.watertight and not q.inside_out
    assert (q.number, q.vertices, q.faces, q.pieces, q.bits) == (4, 162, 320, 1, ())
    assert (q.degenerate_faces, q.duplicate_vertices, q.loose_vertices) == (0, 0, 0)
    assert q.low == tuple(V.min(0)) and q.high == tuple(V.max(0))


def test_a_hole_has_three_open_edges() -> None:
    q = quality(V, F[1:])
    assert (q.open_edges, q.crowded_edges, q.flipped_edges) == (3, 0, 0) and not q.watertight


def test_a_flipped_face_has_three_flipped_edges() -> None:
    flipped = F.copy()
    flipped[7] = flipped[7, ::-1]
    q = quality(V, flipped)
    assert (q.open_edges, q.crowded_edges, q.flipped_edges) == (0, 0, 3) and not q.inside_out


def test_all_flipped_is_inside_out() -> None:
    q = quality(V + 5, F[:, ::-1])
    assert q.inside_out and q.watertight


def test_a_fin_makes_a_crowded_edge() -> None:
    fin = np.vstack([V, [[2, 2, 2]]])
    q = quality(fin, np.vstack([F, [[F[0, 0], F[0, 1], len(V)]]]))
    assert (q.open_edges, q.crowded_edges) == (2, 1)


def test_degenerate_faces() -> None:
    middle = (V[F[0, 0]] + V[F[0, 1]]) / 2
    q = quality(np.vstack([V, middle]), np.vstack([F, [[3, 3, 5], [F[0, 0], F[0, 1], len(V)]]]))
    assert q.degenerate_faces == 2


def test_soup_is_watertight_where_corners_meet() -> None:
    q = quality(V[F].reshape(-1, 3), np.arange(F.size).reshape(-1, 3))
    assert q.watertight and q.pieces == 1 and q.duplicate_vertices == F.size - len(V)


def test_floating_bits_and_loose_vertices() -> None:
    crumb = trimesh.creation.box((0.02, 0.05, 0.01))
    q = quality(np.vstack([V, crumb.vertices + 3, [[9, 9, 9]]]), np.vstack([F, crumb.faces + len(V)]))
    assert (q.pieces, q.bits, q.loose_vertices) == (2, ((12, 0.05),), 1)
    assert q.watertight


@given(st.integers(0, 2**32 - 1))
def test_edges_agree_with_counting_one_by_one(seed: int) -> None:
    faces = np.random.default_rng(seed).integers(0, 8, (12, 3))
    faces = faces[(faces != np.roll(faces, 1, 1)).all(1)]
    if not len(faces):
        return
    runs: dict[tuple[int, int], list[int]] = {}
    for face in faces.tolist():
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            runs.setdefault((min(a, b), max(a, b)), []).append(1 if a < b else -1)
    q = quality(np.random.default_rng(1).random((8, 3)), faces)
    assert q.open_edges == sum(len(r) == 1 for r in runs.values())
    assert q.crowded_edges == sum(len(r) > 2 for r in runs.values())
    assert q.flipped_edges == sum(len(r) == 2 and sum(r) != 0 for r in runs.values())
