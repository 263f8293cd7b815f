"""A scene file that gives a capture equipment: one repaired capture for everything that reads it."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from mhvedit.errors import MhveditError, SceneError
from mhvedit.fitting.quality import FitRefused
from mhvedit.pipeline.export import _pieces
from mhvedit.pipeline.job import Job, load
from mhvedit.pipeline.repair import repaired_in_words, repaired_story
from mhvedit.sequences.read import open_capture
from mhvedit.sequences.tracks import read_tracks
from mhvedit.view.skeletons import fitted_strip
from mhvedit.view.style import figure_picture

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "scenes" / "greeting"
FIRST, LAST = 0, 15
SCENE = """\
version = 1
name = "bag"

[subjects.a]
path = "{shared}/a"
frames = [{first}, {last}]
fps = 25
[subjects.a.self_collision]
{table}

[subjects.b]
path = "{shared}/b"
frames = [{first}, {last}]
fps = 25

[[segments]]
name = "meet"
between = ["a", "b"]
frames = {{a = [{first}, {last}], b = [{first}, {last}]}}
interaction = "none"
"""


def scene_file(folder: Path, table: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(SCENE.format(shared=SHARED, first=FIRST, last=LAST, table=table))
    return path


def bag_on_the_thigh(folder: Path) -> None:
    """A box beside the right thigh, where the right hand swings."""
    tracks = read_tracks(SHARED / "a.csv")
    hip, knee, hand = (tracks.positions[0, tracks.joints.index(n)] for n in ("RightUpLeg", "RightLeg", "RightHand"))
    middle = 0.6 * hip + 0.4 * knee
    box = trimesh.creation.box(extents=(0.16, 0.16, 0.3))
    box.apply_translation(middle + 0.11 * (hand - middle) / np.linalg.norm(hand - middle))
    box.subdivide_to_size(0.04).export(folder / "bag.obj")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("repair")
    bag_on_the_thigh(made)
    return made


@pytest.fixture(scope="module")
def job(folder: Path) -> Job:
    path = scene_file(folder, 'equipment = [{path = "bag.obj", limb = "right_thigh", frame = 0}]')
    return load(path, cache=folder / "cache")


def test_frames_that_are_free_keep_every_bit_and_others_are_edited(job: Job) -> None:
    captured, repaired = open_capture(SHARED / "a", name="a", fps=25), job.subjects["a"].sequence
    with np.load(repaired.files[0]) as kept:
        touched, collided = kept["touched"], kept["collided"]
    assert collided.any()
    assert (touched | ~collided).all()
    for number, changed in zip(repaired.numbers, touched, strict=True):
        before, after = captured.mesh(number), repaired.mesh(number)
        own = after.vertices[: len(before.vertices)]
        assert len(after.vertices) > len(before.vertices)  # the bag
        assert (after.faces[: len(before.faces)] == before.faces).all()
        assert (own == before.vertices).all() != changed
        assert np.abs(own - before.vertices).max() < 0.2


def test_the_report_has_a_picture_and_a_sentence(job: Job) -> None:
    sequence = job.subjects["a"].sequence
    story = repaired_story(sequence)
    assert figure_picture(fitted_strip(story)).std() > 1.0
    assert len(story.numbers) == len(story.points) == len(story.joints)
    assert "limbs met in" in repaired_in_words(sequence)


def test_a_second_load_takes_the_kept_capture(job: Job, folder: Path) -> None:
    file = job.subjects["a"].sequence.files[0]
    written = file.stat().st_mtime_ns, file.read_bytes()
    again = load(folder / "scene.toml", cache=folder / "cache").subjects["a"].sequence
    assert again.files == (file,)
    assert again.files[0].read_bytes() == written[1]


def test_exports_read_the_repaired_capture(job: Job) -> None:
    body = _pieces(job.subjects["a"], job.scene.subjects["a"], {"a", "b"})[0]
    assert (body.path, body.units, body.up) == (job.subjects["a"].sequence.files[0], "m", "z")
    other = _pieces(job.subjects["b"], job.scene.subjects["b"], {"a", "b"})[0]
    assert other.path == (SHARED / "b").resolve()


def test_a_table_without_keys_changes_nothing_where_nothing_meets(tmp_path: Path) -> None:
    sequence = load(scene_file(tmp_path, "")).subjects["a"].sequence
    captured = open_capture(SHARED / "a", name="a", fps=25)
    for number in sequence.numbers:
        assert (sequence.mesh(number).vertices == captured.mesh(number).vertices).all()


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ('equipment = [{path = "bag.obj", limb = "tail", frame = 0}]', "one of pelvis, spine"),
        ('equipment = [{path = "bag.obj", limb = "chest", frame = 99}]', "a frame of the capture, from 0 to 15"),
        ('equipment = [{path = "none.obj", limb = "chest", frame = 0}]', "a mesh file"),
        ("girth = 9", "9"),
        ("girth = {tail = 1.1}", "one of"),
        ('method = "magic"', "one of bisection, filter"),
        ("size = 2", "an unknown key"),
    ],
)
def test_bad_tables_are_one_sentence(folder: Path, tmp_path: Path, table: str, said: str) -> None:
    (tmp_path / "bag.obj").write_bytes((folder / "bag.obj").read_bytes())
    with pytest.raises(SceneError, match=said) as fault:
        load(scene_file(tmp_path, table))
    assert "self_collision" in str(fault.value)


def test_a_capture_that_no_skeleton_fits_is_refused(tmp_path: Path) -> None:
    trimesh.creation.box(extents=(0.4, 0.4, 1.7)).subdivide_to_size(0.05).export(tmp_path / "box_0.obj")
    path = scene_file(tmp_path, "")
    text = (
        path.read_text()
        .replace(f'"{SHARED}/a"\nframes = [0, 15]', f'"{tmp_path}"')
        .replace("a = [0, 15]", "a = [0, 0]")
    )
    path.write_text(text)
    with pytest.raises(FitRefused, match="does not look like one person") as fault:
        load(path, cache=tmp_path / "cache")
    assert isinstance(fault.value, MhveditError)
    assert fault.value.picture is not None
    assert fault.value.picture.stat().st_size > 1000
    assert not list(fault.value.picture.parent.glob("*.npz"))
