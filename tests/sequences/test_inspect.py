import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from mhvedit.sequences.inspect import as_dict, as_text, capture_warnings, inspect_capture
from tests.sequences.test_looks import picture_bytes, textured_glb

PERSON = trimesh.creation.capsule(height=1.3, radius=0.2, count=(12, 8)).apply_translation((0.4, 0.3, 0.85))


def folder(tmp_path: Path, mesh: trimesh.Trimesh = PERSON, numbers: tuple[int, ...] = (0, 1, 2)) -> Path:
    for number in numbers:
        mesh.export(tmp_path / f"anna_{number:03}.obj")
    return tmp_path


def warnings(path: Path, **options: str | float) -> list[str]:
    """Warnings of an inspection with everything given, without the name."""
    given = {"fps": 30.0, "units": "m", "up": "z"} | options
    found = capture_warnings(inspect_capture(path, name="anna", **given))  # type: ignore[arg-type]
    assert all(sentence.startswith("anna: ") for sentence in found)
    return [sentence.removeprefix("anna: ") for sentence in found]


def test_a_sound_capture(tmp_path: Path) -> None:
    s = inspect_capture(folder(tmp_path), fps=25)
    assert (s.name, s.kind) == (tmp_path.name, "folder of .obj files")
    assert (s.units, s.units_from, s.up, s.up_from, s.fps, s.fps_from) == ("m", "guessed", "z", "guessed", 25, "given")
    assert s.height == pytest.approx(1.7, abs=1e-6) and s.watertight == 3 and not s.connectivity_changes
    assert s.bounds[0] == pytest.approx(PERSON.bounds[0], abs=1e-6)
    assert capture_warnings(s) == ()


def test_gaps_and_assumed_rate(tmp_path: Path) -> None:
    s = inspect_capture(folder(tmp_path, numbers=(0, 1, 5, 7)), name="anna")
    assert s.gaps == ((2, 4), (6, 6)) and s.fps_from == "assumed"
    assert capture_warnings(s) == ("anna: frames missing 2-4, 6", "anna: 30 fps is assumed: give fps")


@pytest.mark.parametrize(("scale", "units"), [(100, "cm"), (1000, "mm")])
def test_a_subject_too_large(tmp_path: Path, scale: float, units: str) -> None:
    path = folder(tmp_path, PERSON.copy().apply_scale(scale))
    assert warnings(path) == [f'{1.7 * scale:.3g} m tall: are its units {units}? (units = "{units}")']
    assert warnings(path, units=units) == []
    assert inspect_capture(path).units == units


def test_a_subject_too_small(tmp_path: Path) -> None:
    assert warnings(folder(tmp_path), units="cm") == ['0.017 m tall: are its units m? (units = "m")']


def test_a_capture_far_from_the_origin(tmp_path: Path) -> None:
    path = folder(tmp_path, PERSON.copy().apply_translation((500000, -300000, 0)))
    assert warnings(path) == [
        "lies 583 km from the origin, where most programs are coarse: take (500000, -300000) m off its x and y (z up)"
    ]
    assert "\n  ! anna: lies 583 km from the origin" in as_text(inspect_capture(path, name="anna"))


def test_a_capture_some_way_from_the_origin(tmp_path: Path) -> None:
    assert warnings(folder(tmp_path, PERSON.copy().apply_translation((0, 900, 0)))) == []


def test_a_subject_on_its_side(tmp_path: Path) -> None:
    turned = trimesh.Trimesh(PERSON.vertices[:, [0, 2, 1]] * [1, 1, -1], PERSON.faces, process=False)
    path = folder(tmp_path, turned)
    assert warnings(path) == ['lies on its side, 0.40 m high: is its up axis y? (up = "y")']
    assert warnings(path, up="y") == []
    assert inspect_capture(path).up == "y"


@pytest.mark.parametrize(
    ("rise", "said"), [(0.8, "stands 0.8 m above the floor"), (-0.5, "reaches 0.5 m below the floor")]
)
def test_a_subject_off_the_floor(tmp_path: Path, rise: float, said: str) -> None:
    path = folder(tmp_path, PERSON.copy().apply_translation((0, 0, rise)))
    assert warnings(path) == [f"{said} (z = 0) in every frame"]


def test_inside_out_and_wide_open(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "open").mkdir()
    inside = trimesh.Trimesh(PERSON.vertices, PERSON.faces[:, ::-1], process=False)
    assert warnings(folder(tmp_path / "in", inside)) == ["inside out in 3 of 3 frames, first 0"]
    gaping = trimesh.Trimesh(PERSON.vertices, PERSON.faces[::2], process=False)
    assert warnings(folder(tmp_path / "open", gaping))[-1].startswith("far from closed: ")


def test_textures(tmp_path: Path) -> None:
    path = folder(tmp_path)
    for file in sorted(path.glob("*.obj")):
        file.write_text("mtllib anna.mtl\n" + file.read_text())
    (path / "anna.mtl").write_text("newmtl a\nmap_Kd skin.png\nmap_Bump gone.png\n")
    (path / "skin.png").write_bytes(b"x")
    s = inspect_capture(path, fps=30)
    assert [f.name for f in s.textures] == ["anna.mtl", "skin.png"]
    assert capture_warnings(s)[0].endswith(f"1 texture files are missing, first {path / 'gone.png'}")


def test_long_captures_are_sampled_with_both_ends(tmp_path: Path) -> None:
    s = inspect_capture(folder(tmp_path, numbers=tuple(range(3, 40))), most=5)
    assert [f.number for f in s.frames] == [3, 12, 21, 30, 39] and len(s.numbers) == 37


def test_labels_and_changing_connectivity(tmp_path: Path) -> None:
    v, f = PERSON.vertices, PERSON.faces
    labels, counts = np.arange(2 * len(v)) % 3, {"vertex_counts": [len(v)] * 2, "face_counts": [len(f)] * 2}
    held = {"vertices": [*v, *v], "faces": [*f, *f[::-1]], "labels": labels, "fps": 30} | counts
    np.savez(tmp_path / "a.npz", **{name: np.asarray(value) for name, value in held.items()})  # type: ignore[arg-type]
    s = inspect_capture(tmp_path / "a.npz")
    assert s.connectivity_changes and s.labels == (0, 1, 2) and s.fps_from == "capture"
    assert s.kind == "one .npz file"


def test_text_and_json(tmp_path: Path) -> None:
    s = inspect_capture(folder(tmp_path, numbers=(1, 3)), name="anna")
    text = as_text(s)
    for part in (
        "anna: folder of .obj files",
        "2, numbers 1 to 3, missing 2",
        "m (guessed), z up (guessed)",
        "2 of 2",
        "! anna: ",
    ):
        assert part in text
    held = json.loads(json.dumps(as_dict(s)))
    assert (
        held["numbers"] == [1, 3] and held["frames"][0]["watertight"] and held["height"] == pytest.approx(1.7, abs=1e-6)
    )
    assert held["warnings"] == list(capture_warnings(s))


def test_textures_of_glb(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "skin.png").write_bytes(picture_bytes())
    (tmp_path / "a" / "m_1.glb").write_bytes(textured_glb({"bufferView": 3, "mimeType": "image/png", "name": "held"}))
    (tmp_path / "a" / "m_2.glb").write_bytes(textured_glb({"uri": "skin.png"}))
    (tmp_path / "a" / "m_3.glb").write_bytes(textured_glb({"uri": "gone.png"}))
    s = inspect_capture(tmp_path / "a", fps=30)
    assert [f.name for f in s.textures] == ["held.png", "skin.png"] and s.textures_seen
    assert s.missing_textures == (tmp_path / "a" / "gone.png",)
    assert "textures      held.png, skin.png" in as_text(s)
    (tmp_path / "a" / "m_1.glb").write_bytes(textured_glb({"bufferView": 30}))
    assert capture_warnings(inspect_capture(tmp_path / "a", fps=30))[-1].endswith("m_1.glb: image 0")


@pytest.mark.parametrize(("suffix", "said"), [("ply", "not looked at"), ("stl", "none")])
def test_textures_of_other_formats(tmp_path: Path, suffix: str, said: str) -> None:
    PERSON.export(tmp_path / f"anna_1.{suffix}")
    s = inspect_capture(tmp_path)
    assert s.textures == () and f"textures      {said}" in as_text(s)
