"""Where the bundled sword fight is, and its scene file with one thing changed."""

from pathlib import Path

BUNDLED = Path(__file__).resolve().parents[1] / "data" / "duel"
FINE = {"voxel": 0.005, "step": 0.005, "yaw_step": 1}


def with_search(text: str, **settings: float) -> str:
    """A scene file's text with a table of search settings."""
    return "\n".join([text.rstrip(), "", "[search]", *(f"{name} = {value:g}" for name, value in settings.items()), ""])


def with_change(text: str, segment: str, old: str, new: str) -> str:
    """A scene file's text with one thing changed in one segment."""
    before, name, after = text.partition(f'name = "{segment}"')
    own, mark, others = after.partition("[[segments]]")
    if old not in own:
        raise ValueError(f"{segment} has no {old!r}")
    return before + name + own.replace(old, new) + mark + others


def edits() -> dict[str, str]:
    """Scene files after a change of one segment each, by what was changed."""
    text = (BUNDLED / "scene.toml").read_text()
    kind = 'interaction = "-&-"'
    changes = {
        "half angle of 01-salute, 40° to 38°": ("01-salute", "half_angle = 40", "half_angle = 38"),
        "half angle of 02-cut-parried, 40° to 35°": ("02-cut-parried", "half_angle = 40", "half_angle = 35"),
        "`tolerance.frames` of 02-cut-parried, 2 to 1": ("02-cut-parried", "frames = 2", "frames = 1"),
        "`tolerance.voxels` of 09-thrust-withdrawn, 2 to 1": ("09-thrust-withdrawn", "voxels = 2", "voxels = 1"),
        "`tolerance.apart` of 05-cut-ducked, 20 to 10 mm": ("05-cut-ducked", "apart = 0.02", "apart = 0.01"),
        "window of 03-blades-part, 4 to 3.8 m": ("03-blades-part", kind, f"{kind}\nwindow = 3.8"),
        "window of 03-blades-part, 4 to 4.2 m": ("03-blades-part", kind, f"{kind}\nwindow = 4.2"),
    }
    return {what: with_change(text, *change) for what, change in changes.items()}


def edits_of_all() -> dict[str, str]:
    """Scene files after a change that concerns all segments, by what was changed."""
    text = (BUNDLED / "scene.toml").read_text()
    return {f"window of all segments, 4 to {size:g} m": with_search(text, window=size) for size in (3.8, 4.2)}
