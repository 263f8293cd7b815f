"""How well skeletons are fitted to captures, against joint tracks; writes docs/fitting_results.md.

    python -m benchmarks.fitting [--centres]

The error is the mean distance over 14 joints (pelvis, neck, shoulders, elbows, wrists, hips, knees, ankles) and all
frames. `--centres` prints instead where the joints of the skinned motions lie against the plain adult: the table of
`mhvedit/fitting/joints.py` is made of these medians.
"""

import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.facing import read_motion
from mhvedit.fitting.capture import CaptureFit, fit_capture
from mhvedit.fitting.joints import NAMES, PARENTS, TURNS, joint, places_in
from mhvedit.fitting.quality import jumps, refusals
from mhvedit.geometry.arrays import FloatArray
from mhvedit.geometry.planar import apply_pose
from mhvedit.sequences.bodies import track_body
from mhvedit.sequences.meshes import Mesh, MeshSequence
from mhvedit.sequences.read import open_capture
from mhvedit.sequences.tracks import read_tracks
from tests.shapes import boxes

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared" / "data"
TRACKED = {"pelvis": "Hips", "neck": "Neck"} | {
    f"{side}_{limb}": f"{side.title()}{name}"
    for side in ("left", "right")
    for limb, name in (
        ("upper_arm", "Arm"),
        ("forearm", "ForeArm"),
        ("hand", "Hand"),
        ("thigh", "UpLeg"),
        ("shin", "Leg"),
        ("foot", "Foot"),
    )
}
HEADER = (
    "| capture | frames | mean mm | worst mm | gap mm | met % | explained % | misfit mm² | ms a frame (processor) | |"
)


@dataclass(frozen=True, slots=True)
class Case:
    """A capture, and its joints if they are known."""

    name: str
    sequence: MeshSequence
    truth: FloatArray | None  # (T, 14, 3) m


def known_cases() -> list[Case]:
    """The captures of the shared scenes."""
    cases = []
    for folder in sorted((SHARED / "scenes").iterdir()):
        for who in "ab":
            tracks = read_tracks(folder / f"{who}.csv")
            columns = [tracks.joints.index(name) for name in TRACKED.values()]
            sequence = open_capture(folder / who, name=f"{folder.name} {who}", fps=25)
            rows = np.searchsorted(tracks.numbers, sequence.numbers)
            cases.append(Case(sequence.name, sequence, tracks.positions[rows][:, columns]))
    return cases


def motion_cases() -> list[Case]:
    """The skinned motions, posed without noise; the joints' centres were learnt from them."""
    cases = []
    for path in sorted((SHARED / "motions").glob("*.npz")):
        sequence, joints, _ = read_motion(path, stride=2)
        cases.append(Case(path.stem, sequence, np.stack([joints[name] for name in TRACKED.values()], 1)))
    return cases


def real_cases() -> list[Case]:
    """Real captures, without truth."""
    folders = sorted((SHARED / "captures").iterdir())
    return [Case(folder.name, open_capture(folder, name=folder.name, fps=30), None) for folder in folders]


def wrong_cases() -> list[Case]:
    """Things that are no person, more than one, or half of one."""
    legs = [((x, y, 0.35), (0.06, 0.06, 0.7)) for x in (-0.62, 0.62) for y in (-0.32, 0.32)]
    table = boxes(((0.0, 0.0, 0.72), (1.4, 0.8, 0.05)), *legs)
    chair = boxes(((0.0, 0.0, 0.45), (0.45, 0.45, 0.05)), ((-0.2, 0.0, 0.7), (0.05, 0.45, 0.5)))
    column = boxes(((0.0, 0.0, 0.85), (0.4, 0.4, 1.7)))
    cases = [_case(name, (mesh, mesh)) for name, mesh in (("table", table), ("chair", chair), ("column", column))]
    for scene in ("greeting", "salsa_open", "pushup_grab"):
        a, b = (open_capture(SHARED / "scenes" / scene / who, name=who, fps=25) for who in "ab")
        true = json.loads((SHARED / "scenes" / scene / "truth.json").read_text())["relative"]
        pose = np.array([true["x"], true["y"], true["yaw"]])
        pairs = [(a.mesh(a.numbers[i]), b.mesh(b.numbers[i])) for i in range(0, 24, 3)]
        cases.append(_case(f"two people of {scene}", tuple(_joined(one, other, pose) for one, other in pairs)))
        if scene != "pushup_grab":  # where nobody is that high
            cases.append(_case(f"upper half of {scene} a", tuple(_above(one, 0.75) for one, _ in pairs)))
    return cases


def _case(name: str, meshes: tuple[Mesh, ...]) -> Case:
    return Case(name, MeshSequence(name, tuple(range(len(meshes))), 25.0, meshes.__getitem__), None)


def _joined(a: Mesh, b: Mesh, pose: FloatArray) -> Mesh:
    """Two meshes as one."""
    faces = np.concatenate([a.faces, b.faces + len(a.vertices)])
    return Mesh(np.concatenate([a.vertices, apply_pose(pose, b.vertices)]), faces.astype(np.int32))


def _above(mesh: Mesh, height: float) -> Mesh:
    """What lies above a height."""
    kept = mesh.faces[(mesh.vertices[mesh.faces, 2] > height).all(1)]
    used, index = np.unique(kept, return_inverse=True)
    return Mesh(mesh.vertices[used], index.reshape(-1, 3).astype(np.int32))


def row(case: Case) -> str:
    """A line of the table."""
    started = time.process_time()
    fit = fit_capture(case.sequence, workers=2)
    spent = 1000 * (time.process_time() - started) / len(fit.numbers)
    why = refusals(fit.likeness, fit.numbers.tolist(), fit.frames)
    why += jumps(fit.numbers.tolist(), fit.places, fps=case.sequence.fps)
    gap, met = 1000 * max(frame.gap for frame in fit.frames), 100 * min(frame.met for frame in fit.frames)
    explained, misfit = 100 * min(frame.explained for frame in fit.frames), 1e6 * fit.likeness.misfit
    error = ("", "") if case.truth is None else _errors(fit, case.truth)
    verdict = f"refused: {why[0]}" + (f" (and {len(why) - 1} more)" if len(why) > 1 else "") if why else "accepted"
    line = (case.name, len(fit.numbers), *error, f"{gap:.1f}", f"{met:.0f}", f"{explained:.0f}", f"{misfit:.0f}")
    return "| " + " | ".join(map(str, (*line, f"{spent:.0f}", verdict))) + " |"


def _errors(fit: CaptureFit, truth: FloatArray) -> tuple[str, str]:
    """Mean, and mean of the worst frame, mm."""
    places = fit.places[:, [joint(name) for name in TRACKED]]
    error = 1000 * np.linalg.norm(places - truth, axis=-1)
    return f"{error.mean():.1f}", f"{error.mean(1).max():.1f}"


def print_centres() -> None:
    """Medians of where joints of the skinned motions lie against the table, mm in the axes of the joints above."""
    for case in motion_cases():
        track = track_body(case.sequence, workers=2)
        assert case.truth is not None
        off = case.truth - places_in(track)[:, [NAMES.index(name) for name in TRACKED]]
        above = TURNS[np.maximum(PARENTS[[joint(name) for name in TRACKED]], 0)]
        own = 1000 * np.einsum("tjab,tja->tjb", track.rotations[:, above], off) / track.size[:, None, None]
        print(case.name, dict(zip(TRACKED, np.median(own, 0).round().tolist(), strict=True)))


def main() -> None:
    """Measure all and write the page."""
    sections = {
        "Captures with joint tracks": known_cases(),
        "Skinned motions": motion_cases(),
        "Real captures": real_cases(),
        "What must be refused": wrong_cases(),
    }
    text = [Path(__file__).with_name("fitting_page.md").read_text(encoding="utf-8").rstrip()]
    for title, cases in sections.items():
        rows = []
        for case in cases:
            rows.append(row(case))
            print(rows[-1], flush=True)
        text += ["", f"## {title}", HEADER, "|" + "---|" * 10, *rows]
    (ROOT / "docs" / "fitting_results.md").write_text("\n".join(text) + "\n", encoding="utf-8")


if __name__ == "__main__":
    print_centres() if "--centres" in sys.argv else main()
