from collections.abc import Callable
from pathlib import Path

import pytest

from mhvedit.errors import SceneError
from mhvedit.project.scene_file import load_scene

SceneWith = Callable[..., Path]

FILE_ERRORS: dict[str, tuple[tuple[str, str], str]] = {
    "syntax": (
        ('name = "handshake"', "name == 1"),
        "line 2, column 7: expected valid TOML, found a mistake: Invalid value",
    ),
    "unclosed": (
        ('"0&0a"', "[1, 2"),
        "end of document: expected valid TOML, found a mistake: Unclosed array",
    ),
    "key twice": (
        ("version = 1", "version = 1\nversion = 1"),
        "line 2, column 12: expected valid TOML, found a mistake: Cannot overwrite a value",
    ),
    "newer": (("version = 1", "version = 2\nnews = 1"), "version: expected 1, found 2"),
    "no version": (("version = 1", ""), "version: expected 1, found nothing"),
    "true version": (("version = 1", "version = true"), "version: expected 1, found true"),
    "no name": (('name = "handshake"', ""), "name: expected a text, found nothing"),
    "no fps": (("version = 1", "version = 1\nfps = 0"), "fps: expected a number above 0, found 0"),
    "unknown": (
        ("version = 1", "version = 1\noptimize = {}"),
        "optimize: expected one of version, name, fps, subjects, segments, search, optimise, stage, props, "
        'found an unknown key (did you mean "optimise"?)',
    ),
    "no segments": (
        ("[[segments]]", "[[subjects.ben.x]]"),
        "subjects.ben.x: expected one of path, frames, fps, units, up, facing, gaze, skeleton, parts, self_collision, "
        "found an unknown key",
    ),
}
SUBJECT_ERRORS: dict[str, tuple[tuple[str, str], str]] = {
    "bad name": (
        ("[subjects.ben]", '[subjects."b n"]'),
        'subjects."b n": expected a name of letters, digits, . _ -, found "b n"',
    ),
    "no table": (
        ('[subjects.ben]\npath = "ben"', '[subjects]\nben = "ben"'),
        'subjects.ben: expected a table, found "ben"',
    ),
    "unknown key": (
        ('path = "ben"', 'path = "ben"\nskelton = "a.bvh"'),
        "subjects.ben.skelton: expected one of path, frames, fps, units, up, facing, gaze, skeleton, parts, "
        "self_collision, "
        'found an unknown key (did you mean "skeleton"?)',
    ),
    "no path": (
        ('path = "ben"', ""),
        "subjects.ben.path: expected a folder of numbered meshes, a .npz or a USD file, found nothing",
    ),
    "no capture": (
        ('path = "ben"', 'path = "bne"'),
        "subjects.ben.path: expected a folder of numbered meshes, a .npz or a USD file, found nothing at {folder}/bne",
    ),
    "path in two lines": (
        ('path = "ben"', 'path = "b\\nn"'),
        "subjects.ben.path: expected a folder of numbered meshes, a .npz or a USD file, found nothing at ",
    ),
    "still": (('path = "ben"', 'path = "ben"\nfps = -1'), "subjects.ben.fps: expected a number above 0, found -1"),
    "endless": (('path = "ben"', 'path = "ben"\nfps = inf'), "subjects.ben.fps: expected a number above 0, found inf"),
    "yes": (('path = "ben"', 'path = "ben"\nfps = true'), "subjects.ben.fps: expected a number above 0, found true"),
    "units": (
        ('path = "ben"', 'path = "ben"\nunits = "km"'),
        'subjects.ben.units: expected one of m, cm, mm, found "km" (did you mean "m"?)',
    ),
    "up": (('path = "ben"', 'path = "ben"\nup = 2'), "subjects.ben.up: expected one of x, y, z, found 2"),
    "cut": (
        ('path = "ben"', 'path = "ben"\nframes = [5, 1]'),
        "subjects.ben.frames: expected [first, last], whole numbers, first <= last, found [5, 1]",
    ),
    "facing file": (
        ('path = "ben"', 'path = "ben"\nfacing = "auot"'),
        'subjects.ben.facing: expected "auto", degrees, or a track file, found nothing at {folder}/auot',
    ),
    "facing folder": (
        ('path = "ben"', 'path = "ben"\nfacing = "anna"'),
        'subjects.ben.facing: expected "auto", degrees, or a track file, found a folder at {folder}/anna',
    ),
    "facing type": (
        ('path = "ben"', 'path = "ben"\nfacing = [1, 0]'),
        'subjects.ben.facing: expected "auto", degrees, or a track file, found [1, 0]',
    ),
    "facing nan": (('path = "ben"', 'path = "ben"\nfacing = nan'), "subjects.ben.facing: expected a number, found nan"),
    "gaze type": (
        ('path = "ben"', 'path = "ben"\ngaze = "anna.csv"'),
        'subjects.ben.gaze: expected "auto" or {{eye = a track file, target = a track file}}, found "anna.csv"',
    ),
    "half a gaze": (
        ('path = "ben"', 'path = "ben"\ngaze = {eye = "anna.csv"}'),
        "subjects.ben.gaze.target: expected a track file, found nothing",
    ),
    "no skeleton": (
        ('path = "ben"', 'path = "ben"\nskeleton = "b.bvh"'),
        "subjects.ben.skeleton: expected a BVH file, found nothing at {folder}/b.bvh",
    ),
}
KINDS = "the keys of one kind of part: track, joint, radius; path; center, size; label; bones"
PART_ERRORS: dict[str, tuple[str, str]] = {
    "called body": (
        "body = {label = 1}",
        ".body: expected another name, found body, which is always the whole capture",
    ),
    "bad name": ('"a b" = {label = 1}', '."a b": expected a name of letters, digits, . _ -, found "a b"'),
    "no table": ("sword = 'ben'", '.sword: expected a table, found "ben"'),
    "nothing": ("sword = {}", f".sword: expected {KINDS}, found {{{{}}}}"),
    "two kinds": ("sword = {path = 'ben', label = 3}", f".sword: expected {KINDS}, found path, label"),
    "unknown key": (
        "zone = {centre = [0, 0, 0], size = [1, 1, 1]}",
        ".zone.centre: expected one of track, joint, radius, path, center, size, label, bones, "
        'found an unknown key (did you mean "center"?)',
    ),
    "no radius": ("a = {track = 'anna.csv', joint = 'hand'}", ".a.radius: expected a number above 0, found nothing"),
    "thin": ("a = {track = 'anna.csv', joint = 'hand', radius = 0}", ".a.radius: expected a number above 0, found 0"),
    "no track": ("a = {joint = 'hand', radius = 1}", ".a.track: expected a track file, found nothing"),
    "lost track": (
        "a = {track = 'b.csv', joint = 'hand', radius = 1}",
        ".a.track: expected a track file, found nothing at {folder}/b.csv",
    ),
    "no joint": (
        "a = {track = 'anna.csv', radius = 1}",
        ".a.joint: expected the name of a joint, or a list of joints, found nothing",
    ),
    "no joints": (
        "a = {track = 'anna.csv', joint = [], radius = 1}",
        ".a.joint: expected a list of joints, found []",
    ),
    "joint of numbers": (
        "a = {track = 'anna.csv', joint = ['hand', 1], radius = 1}",
        ".a.joint[1]: expected one of the joints, found 1",
    ),
    "lost sword": (
        "sword = {path = 'sword'}",
        ".sword.path: expected a folder of numbered meshes, a .npz or a USD file, found nothing at {folder}/sword",
    ),
    "flat": ("zone = {center = [0, 0, 0], size = [1, 1, 0]}", ".zone.size[2]: expected a number above 0, found 0"),
    "two numbers": ("zone = {center = [0, 0], size = [1, 1, 1]}", ".zone.center: expected three numbers, found [0, 0]"),
    "label": ("glove = {label = 1.5}", ".glove.label: expected a whole number, found 1.5"),
    "huge label": (
        "glove = {label = 0x1ffffffffffffffffff}",
        ".glove.label: expected a whole number, found a number beyond 64 bits",
    ),
    "bones": ("hand2 = {bones = 'hand'}", '.hand2.bones: expected a list of bones, found "hand"'),
}
TYPES = "+&+, -&-, +&-, -&+, +&0, 0&+, -&0, 0&-, 0&0a, 0&0b, 0&0c, none"
SEGMENT_ERRORS: dict[str, tuple[tuple[str, str], str]] = {
    "misnamed": (
        ('name = "hold"', 'nam = "hold"'),
        "[1].nam: expected one of name, between, frames, interaction, parts, apart, visibility, retime, tolerance, "
        'pin, exclude, window, found an unknown key (did you mean "name"?)',
    ),
    "no name": (('name = "hold"', ""), "[1].name: expected a name of letters, digits, . _ -, found nothing"),
    "bad name": (('"hold"', '"a/b"'), '[1].name: expected a name of letters, digits, . _ -, found "a/b"'),
    "name twice": (
        ('"hold"', '"raise"'),
        '[1].name: expected a name that no other segment has, found "raise", as in segments[0]',
    ),
    "unknown key": (
        ('"0&0a"', '"0&0a"\ntolerence = {}'),
        '[1] "hold".tolerence: expected one of name, between, frames, interaction, parts, apart, visibility, retime, '
        'tolerance, pin, exclude, window, found an unknown key (did you mean "tolerance"?)',
    ),
    "pinned": (
        ('"0&0a"', '"0&0a"\npinned = 3'),
        '[1] "hold".pinned: expected one of name, between, frames, interaction, parts, apart, visibility, retime, '
        'tolerance, pin, exclude, window, found an unknown key (did you mean "pin"?)',
    ),
    "pin": (('"0&0a"', '"0&0a"\npin = 3'), '[1] "hold".pin: expected a table, found 3'),
    "pin without yaw": (
        ('"0&0a"', '"0&0a"\npin = {x = 1, y = 2}'),
        '[1] "hold".pin.yaw: expected a number, found nothing',
    ),
    "one exclusion": (
        ('"0&0a"', '"0&0a"\nexclude = 3'),
        '[1] "hold".exclude: expected a list of tables such as x = 1.0, y = 0.0, yaw = 90, found 3',
    ),
    "turn alone": (
        ('"0&0a"', '"0&0a"\nexclude = [{x = 1, y = 2, yaw = 3, turn = 9}]'),
        '[1] "hold".exclude[0].turn: expected nothing where there is no radius, found 9',
    ),
    "no radius": (
        ('"0&0a"', '"0&0a"\nexclude = [{x = 1, y = 2, yaw = 3, radius = 0}]'),
        '[1] "hold".exclude[0].radius: expected a number above 0, found 0',
    ),
    "three": (
        ('["ben", "anna"]', '["ben", "anna", "ben"]'),
        '[1] "hold".between: expected two subjects, [A, B], found ["ben", "anna", "ben"]',
    ),
    "oneself": (
        ('["ben", "anna"]', '["ben", "ben"]'),
        '[1] "hold".between: expected two different subjects, [A, B], found ["ben", "ben"]',
    ),
    "stranger": (
        ('["ben", "anna"]', '["ben", "ana"]'),
        '[1] "hold".between[1]: expected one of anna, ben, found "ana" (did you mean "anna"?)',
    ),
    "frames of one": (
        ("{anna = [5, 7], ben = [7, 9]}", "{anna = [5, 7]}"),
        '[1] "hold".frames.ben: expected [first, last], whole numbers, first <= last, found nothing',
    ),
    "frames of a stranger": (
        ("ben = [7, 9]", "bne = [7, 9]"),
        '[1] "hold".frames.bne: expected one of ben, anna, found an unknown key (did you mean "ben"?)',
    ),
    "half frames": (
        ("ben = [7, 9]", "ben = [7, 9.0]"),
        '[1] "hold".frames.ben: expected [first, last], whole numbers, first <= last, found [7, 9.0]',
    ),
    "backwards": (
        ("ben = [7, 9]", "ben = [9, 7]"),
        '[1] "hold".frames.ben: expected [first, last], whole numbers, first <= last, found [9, 7]',
    ),
    "overlap": (
        ("ben = [7, 9]", "ben = [5, 9]"),
        '[1] "hold".frames.ben: expected frames after those of segments[0] "raise", which end at 5, '
        "found [5, 9], which overlaps [2, 5]",
    ),
    "order": (
        ("ben = [7, 9]", "ben = [0, 1]"),
        '[1] "hold".frames.ben: expected frames after those of segments[0] "raise", which end at 5, '
        "found [0, 1], which comes before [2, 5]",
    ),
    "no interaction": (
        ('"0&0a"', "1"),
        f'[1] "hold".interaction: expected one of {TYPES}, found 1',
    ),
    "unknown interaction": (
        ('"0&0a"', '"0 & 0A "'),
        f'[1] "hold".interaction: expected one of {TYPES}, found "0 & 0A " (did you mean "0&0a"?)',
    ),
    "unknown part": (
        ('"0&0a"', '"0&0a"\nparts = {anna = "hnd"}'),
        '[1] "hold".parts.anna: expected one of body, hand, found "hnd" (did you mean "hand"?)',
    ),
    "part of the other": (
        ('"0&0a"', '"0&0a"\nparts = {ben = "hand"}'),
        '[1] "hold".parts.ben: expected body, found "hand"',
    ),
    "part of a stranger": (
        ('"0&0a"', '"0&0a"\nparts = {carl = "hand"}'),
        '[1] "hold".parts.carl: expected one of ben, anna, found an unknown key',
    ),
    "apart": (
        ('"0&0a"', '"0&0a"\napart = "atuo"'),
        '[1] "hold".apart: expected one of auto, none, found "atuo" (did you mean "auto"?)',
    ),
    "apart type": (
        ('"0&0a"', '"0&0a"\napart = true'),
        '[1] "hold".apart: expected "auto", "none", or pairs like ["body", "body"], found true',
    ),
    "apart flat": (
        ('"0&0a"', '"0&0a"\napart = ["body", "body"]'),
        '[1] "hold".apart[0]: expected [a part of ben, a part of anna], found "body"',
    ),
    "apart order": (
        ('"0&0a"', '"0&0a"\napart = [["body", "hand"], ["hand", "body"]]'),
        '[1] "hold".apart[1][0]: expected body, found "hand"',
    ),
    "visibility": (
        ('"0&0a"', '"0&0a"\nvisibility = 40'),
        '[1] "hold".visibility: expected false or {{half_angle = degrees}}, found 40',
    ),
    "half angle": (
        ('"0&0a"', '"0&0a"\nvisibility = {half_angle = 181}'),
        '[1] "hold".visibility.half_angle: expected a number above 0 and at most 180, found 181',
    ),
    "no half angle": (
        ('"0&0a"', '"0&0a"\nvisibility = {}'),
        '[1] "hold".visibility.half_angle: expected a number above 0 and at most 180, found nothing',
    ),
    "retime": (
        ('"0&0a"', '"0&0a"\nretime = "flor"'),
        '[1] "hold".retime: expected one of endpoints, floor, found "flor" (did you mean "floor"?)',
    ),
    "window of a segment": (
        ('"0&0a"', '"0&0a"\nwindow = 0'),
        '[1] "hold".window: expected a number above 0, found 0',
    ),
    "tolerance type": (('"0&0a"', '"0&0a"\ntolerance = 2'), '[1] "hold".tolerance: expected a table, found 2'),
    "tolerance key": (
        ('"0&0a"', '"0&0a"\ntolerance = {frame = 2}'),
        '[1] "hold".tolerance.frame: expected one of frames, voxels, depth, apart, '
        'found an unknown key (did you mean "frames"?)',
    ),
    "tolerance": (
        ('"0&0a"', '"0&0a"\ntolerance = {frames = 0.5}'),
        '[1] "hold".tolerance.frames: expected a whole number of at least 0, found 0.5',
    ),
    "depth": (
        ('"0&0a"', '"0&0a"\ntolerance = {depth = -0.1}'),
        '[1] "hold".tolerance.depth: expected a number of at least 0, found -0.1',
    ),
}
SETTING_ERRORS: dict[str, tuple[str, str]] = {
    "voxel": ("[search]\nvoxel = 0", "search.voxel: expected a number above 0, found 0"),
    "step": ("[search]\nstep = 0.015", "search.step: expected a whole multiple of search.voxel, 0.01, found 0.015"),
    "small step": (
        "[search]\nvoxel = 0.02",
        "search.step: expected a whole multiple of search.voxel, 0.02, found 0.01",
    ),
    "yaw": ("[search]\nyaw_step = 7", "search.yaw_step: expected degrees that divide 360, found 7"),
    "large yaw": ("[search]\nyaw_step = 400", "search.yaw_step: expected a number above 0 and at most 360, found 400"),
    "window": ("[search]\nwindow = -4", "search.window: expected a number above 0, found -4"),
    "search key": (
        "[search]\nvoxels = 1",
        'search.voxels: expected one of voxel, step, yaw_step, window, found an unknown key (did you mean "voxel"?)',
    ),
    "search text": ('[search]\nvoxel = "1 cm"', 'search.voxel: expected a number above 0, found "1 cm"'),
    "search": ("[[search]]", "search: expected a table, found [{{}}]"),
    "weight": ("[optimise]\nfacing_weight = -1", "optimise.facing_weight: expected a number of at least 0, found -1"),
    "delta": (
        "[optimise]\nacceleration = 1.5",
        "optimise.acceleration: expected a number of at least 0 and at most 1, found 1.5",
    ),
}


def refused(path: Path, folder: Path, expected: str) -> None:
    with pytest.raises(SceneError) as error:
        load_scene(path)
    wanted = f"{path}: {expected.format(folder=folder)}"
    assert str(error.value).startswith(wanted) if expected.endswith(" at ") else str(error.value) == wanted
    assert "\n" not in str(error.value)
    assert error.value.path == path


@pytest.mark.parametrize("case", FILE_ERRORS | SUBJECT_ERRORS)
def test_bad_file_or_subject(case: str, scene_with: SceneWith, folder: Path) -> None:
    replacement, expected = (FILE_ERRORS | SUBJECT_ERRORS)[case]
    refused(scene_with(replacement), folder, expected)


@pytest.mark.parametrize("case", PART_ERRORS)
def test_bad_part(case: str, scene_with: SceneWith, folder: Path) -> None:
    line, expected = PART_ERRORS[case]
    refused(
        scene_with(("[subjects.anna.parts]", f"[subjects.anna.parts]\n{line}")),
        folder,
        f"subjects.anna.parts{expected}",
    )


@pytest.mark.parametrize("case", SEGMENT_ERRORS)
def test_bad_segment(case: str, scene_with: SceneWith, folder: Path) -> None:
    replacement, expected = SEGMENT_ERRORS[case]
    refused(scene_with(replacement), folder, f"segments{expected}")


@pytest.mark.parametrize("case", SETTING_ERRORS)
def test_bad_setting(case: str, scene_with: SceneWith, folder: Path) -> None:
    more, expected = SETTING_ERRORS[case]
    refused(scene_with(more=more), folder, expected)


def test_visible_frames_are_those_of_the_scene(scene_with: SceneWith, folder: Path) -> None:
    for fps, count in ((25, 3), (50, 6)):
        path = scene_with(
            ("version = 1", f"version = 1\nfps = {fps}"),
            ('path = "anna"', 'path = "anna"\nfps = 25'),
            ('path = "ben"', 'path = "ben"\nfps = 25'),
            ('"0&0a"', f'"0&0a"\nvisibility = {{half_angle = 40, frames = [0, {count}]}}'),
        )
        refused(
            path,
            folder,
            'segments[1] "hold".visibility.frames: expected frames of the segment, '
            f"counted from 0 to {count - 1}, found [0, {count}]",
        )


def test_bones_need_a_skeleton(scene_with: SceneWith, folder: Path) -> None:
    path = scene_with(("[subjects.anna.parts]", '[subjects.anna.parts]\nfist = {bones = ["hand"]}'))
    refused(path, folder, 'subjects.anna.skeleton: expected a BVH file, as the part "fist" names bones, found nothing')


def test_too_few_of_everything(folder: Path) -> None:
    path = folder / "scene.toml"
    path.write_text('version = 1\nname = "x"\n')
    refused(path, folder, "subjects: expected at least two [subjects.<name>], found none")
    path.write_text('version = 1\nname = "x"\nsubjects = 3\n')
    refused(path, folder, "subjects: expected a table, found 3")
    path.write_text('version = 1\nname = "x"\n[subjects.anna]\npath = "anna"\n')
    refused(path, folder, "subjects: expected at least two [subjects.<name>], found anna")
    both = 'version = 1\nname = "x"\n[subjects.anna]\npath = "anna"\n[subjects.ben]\npath = "ben"\n'
    path.write_text(both)
    refused(path, folder, "segments: expected at least one [[segments]], found nothing")
    path.write_text(both + "[segments]\nname = 'x'\n")
    refused(path, folder, 'segments: expected at least one [[segments]], found {{name = "x"}}')
    path.write_text(both.replace("name", "segments = [3]\nname"))
    refused(path, folder, "segments[0]: expected a table, found 3")


def test_no_text_at_all(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    refused(path, tmp_path, "scene file: expected a TOML file, found nothing")
    path.mkdir()
    refused(path, tmp_path, "scene file: expected a TOML file, found Is a directory")
    path.rmdir()
    path.write_bytes(b"name = '\xff'")
    refused(path, tmp_path, "scene file: expected text in UTF-8, found another byte at place 8")
    path.write_text("x = " + "[" * 5000)
    with pytest.raises(SceneError, match="expected valid TOML, found a mistake: "):
        load_scene(path)


def test_a_third_subject_in_the_wrong_order(scene_with: SceneWith, folder: Path) -> None:
    more = (
        '[subjects.carl]\npath = "ben"\n[[segments]]\nname = "3"\nbetween = ["anna", "carl"]\ninteraction = "none"\n'
        "frames = {anna = [7, 9], carl = [0, 9]}\n"
    )
    late = scene_with(more=more)
    refused(
        late,
        folder,
        'segments[2] "3".frames.anna: expected frames after those of segments[1] "hold", which end at 7, '
        "found [7, 9], which overlaps [5, 7]",
    )
