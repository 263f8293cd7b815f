"""Exports every frame of every shared scene in every format, reads it back with other libraries, and prints a table.

The placements are made up (everybody walks a curve), so nothing has to be solved; the movie is left out.
"""

import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from pxr import Usd

from mhvedit.export.content import Exported, ExportScene
from mhvedit.export.folder import MeshFormat, write_folder
from mhvedit.export.gltf import write_glb
from mhvedit.export.usd_edit import write_usd_edit
from mhvedit.export.usd_flat import write_flat_usd
from tests.export.checks import check_folder, check_glb, check_usd
from tests.export.readers import gltf_errors, node_validator, usd_errors
from tests.export.scenes import SHARED_SCENES, shared_scene

Write = Callable[[ExportScene, Path], Exported]
Check = Callable[[ExportScene, Path], None]


def tell(stage: str, share: float) -> None:
    """Nobody watches."""


def edit_layer(scene: ExportScene, path: Path) -> Exported:
    """The edit layer with copies of the captures."""
    return write_usd_edit(scene, path, assets=path.parent / "assets", up="z", tell=tell)


WAYS: dict[str, tuple[str, Write, Check]] = {
    "USD edit, copies made": ("edit.usdc", edit_layer, check_usd),
    "USD edit, copies kept": ("again.usda", edit_layer, check_usd),
    "USD flattened": ("flat.usdc", lambda s, p: write_flat_usd(s, p, up="z", tell=tell), check_usd),
    "GLB": ("scene.glb", lambda s, p: write_glb(s, p, draco=False, tell=tell), check_glb),
    "OBJ": ("obj", lambda s, p: write_folder(s, p, files=MeshFormat.OBJ, up="z", tell=tell), check_folder),
    "PLY": ("ply", lambda s, p: write_folder(s, p, files=MeshFormat.PLY, up="z", tell=tell), check_folder),
}


def main() -> None:
    """Print what was written, how fast, and that it reads back equal."""
    print("| scene | frames | format | s | MB | reads back | validator |")
    print("|---|---|---|---|---|---|---|")
    for name in SHARED_SCENES:
        scene = shared_scene(name, most=None)
        with tempfile.TemporaryDirectory() as folder:
            for kind, (file, write, check) in WAYS.items():
                path = Path(folder) / file
                started = time.perf_counter()
                write(scene, path)
                spent = time.perf_counter() - started
                check(scene, path)
                facts = f"{spent:.1f} | {size(path):.3f} | equal | {said(path)}"
                print(f"| {name} | {scene.edit.n_frames} | {kind} | {facts} |", flush=True)
    print(f"\n{Usd.GetVersion()=}, largest memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000:.0f} MB")


def said(path: Path) -> str:
    """What the validator of a format finds."""
    if path.is_dir():
        return "-"
    if path.suffix == ".glb":
        return str(len(gltf_errors(path))) if node_validator() else "not installed"
    return str(len(usd_errors(path)))


def size(path: Path) -> float:
    """Of a file, or of all in a folder, MB."""
    files = [path] if path.is_file() else [p for p in path.rglob("*") if p.is_file()]
    return sum(p.stat().st_size for p in files) / 1e6


if __name__ == "__main__":
    main()
