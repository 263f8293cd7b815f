"""The examples run; all are short and take no arguments."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
LONGEST = 80  # lines
LONGER = {"blender_import": 100}  # runs inside Blender, where it has only itself


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_examples_are_short_and_can_be_loaded(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= LONGER.get(path.stem, LONGEST)
    assert "argparse" not in text and "sys.argv" not in text
    assert callable(example(path.stem).main)


def test_another_solution_is_picked_and_looked_at(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example("pick_another").main(tmp_path)
    example("look_at_solutions").main(tmp_path / "picked")
    said = capsys.readouterr().out
    assert "picked: " in said and "region 0" in said
    assert (tmp_path / "chosen" / "edit.json").read_text() != (tmp_path / "picked" / "edit.json").read_text()


def test_obj_folders_for_the_tutorial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = example("duel_as_obj")
    monkeypatch.setattr(module, "FRAMES", range(72, 74))
    module.main(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["anna", "anna_sword", "ben", "ben_sword"]
    assert (tmp_path / "ben" / "ben_0073.obj").exists()
    assert "2 frames" in capsys.readouterr().out


def test_a_ball_is_swept_off_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example("world_props").main(tmp_path, n_frames=20)
    assert (tmp_path / "sweep.glb").exists()
    assert '"ball"' in (tmp_path / "edited" / "edit.json").read_text()
    assert "at the end" in capsys.readouterr().out


def test_a_hand_stops_at_a_wall(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = example("world_touch")
    monkeypatch.setattr(module, "SHOWN", (7,))
    module.main(tmp_path, last=44)
    assert "anna: left arm stopped at wall in frames 5 to 8, " in capsys.readouterr().out
    assert (tmp_path / "touch.webp").exists() and (tmp_path / "edited" / "touched" / "anna.npz").exists()
