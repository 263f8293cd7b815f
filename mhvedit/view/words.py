"""What the report says in words."""

from typing import Final

import numpy as np

from mhvedit.constraints.dictionary import InteractionType
from mhvedit.scene.edit import EditedScene, SegmentEdit
from mhvedit.view.content import ReportContent, SegmentStory

TYPE_WORDS: Final = {
    InteractionType.END_END: "both motions end in the contact",
    InteractionType.START_START: "both motions start from the contact",
    InteractionType.END_START: "{a}’s motion ends in the contact, {b}’s starts from it",
    InteractionType.START_END: "{a}’s motion starts from the contact, {b}’s ends in it",
    InteractionType.END_LATERAL: "{a}’s motion ends on {b}",
    InteractionType.LATERAL_END: "{b}’s motion ends on {a}",
    InteractionType.START_LATERAL: "{a}’s motion starts on {b}",
    InteractionType.LATERAL_START: "{b}’s motion starts on {a}",
    InteractionType.THROUGHOUT: "in contact in every frame",
    InteractionType.SOMETIMES: "in contact at some moment",
    InteractionType.PASSING: "one passes where the other has been, and they never touch",
    InteractionType.NONE: "no contact at all",
}
FIRST: Final = (InteractionType.START_START, InteractionType.START_LATERAL, InteractionType.LATERAL_START)
LAST: Final = (InteractionType.END_END, InteractionType.END_LATERAL, InteractionType.LATERAL_END)


def asked_in_words(story: SegmentStory) -> str:
    """What the type of a segment asks for; an unknown type stands for itself."""
    try:
        words = TYPE_WORDS[InteractionType(story.interaction)]
    except ValueError:
        return story.interaction
    return words.format(a=story.a.subject, b=story.b.subject)


def verdict_of(content: ReportContent) -> str:
    """One sentence on the whole scene."""
    placed = sum(story.chosen is not None for story in content.stories)
    sentence = f"{placed} of {len(content.stories)} segments placed"
    where = deepest(content)
    if where is None:
        return sentence + "."
    frame, depth = where
    if depth <= 0:
        return sentence + "; nobody sinks into the other in any frame."
    return f"{sentence}; deepest body contact {depth:.0f} mm {place_of(content.scene, frame)}, frame {frame}."


def is_good(content: ReportContent) -> bool:
    """Whether the verdict is shown as good news."""
    if content.passed is not None:
        return content.passed
    return all(story.chosen is not None for story in content.stories)


def deepest(content: ReportContent) -> tuple[int, float] | None:
    """Frame of the scene and depth in mm of the deepest penetration; None where it was not measured."""
    if content.check is None or not np.isfinite(content.check.penetration_mm).any():
        return None
    frame = int(np.nanargmax(content.check.penetration_mm))
    return frame, float(content.check.penetration_mm[frame])


def place_of(scene: EditedScene | None, frame: int) -> str:
    """Where in the scene a frame is, in words.

    >>> place_of(None, 3)
    'in the scene'
    """
    if scene is None or not scene.segments:
        return "in the scene"
    before = [s for s in scene.segments if s.stop <= frame]
    for segment in scene.segments:
        if segment.start <= frame < segment.stop:
            return f"in {segment.name}"
    return f"after {before[-1].name}" if before else f"before {scene.segments[0].name}"


def edit_of(content: ReportContent, story: SegmentStory) -> SegmentEdit | None:
    """The segment in the edited scene."""
    segments = content.scene.segments if content.scene else ()
    return next((segment for segment in segments if segment.name == story.name), None)


def shown_frame(content: ReportContent, story: SegmentStory) -> int:
    """Frame of the segment that is shown: where its type wants the contact, or else where it is."""
    if story.interaction in FIRST:
        return 0
    if story.interaction in LAST:
        return story.n_frames - 1
    edit = edit_of(content, story)
    if edit is not None and content.check is not None:
        touching = np.flatnonzero(content.check.contact[edit.start : edit.stop])
        if len(touching):
            return int(touching[len(touching) // 2])
    return story.n_frames // 2


def side_in_words(angle: float) -> str:
    """A signed angle from somebody's facing, in words.

    >>> side_in_words(0.35), side_in_words(-0.02), side_in_words(-1.6)
    ('20° to the left', 'straight ahead', '92° to the right')
    """
    degrees = round(float(np.degrees(angle)))
    if abs(degrees) < 3:
        return "straight ahead"
    if abs(degrees) > 177:
        return "straight behind"
    return f"{abs(degrees)}° to the {'left' if degrees > 0 else 'right'}"


def solutions_in_words(story: SegmentStory) -> str:
    """How many solutions there are, and in how many regions."""
    if story.group is None:
        return "Not searched."
    if not len(story.group):
        return "No pose fits."
    regions = int(story.group.region.max()) + 1
    noun = "region" if regions == 1 else "regions"
    text = f"{len(story.group):,} solutions in {regions} connected {noun}"
    if regions == 1:
        return f"{text}."
    largest = 100 * float(np.mean(story.group.region == 0))
    share = "over 99 %" if largest > 99 else f"{largest:.0f} %"
    return f"{text}, {share} of them in the largest."


def signed_degrees(angle: float) -> str:
    """An angle with its sign.

    >>> signed_degrees(-0.4)
    '−23°'
    """
    return f"{np.degrees(angle):+.0f}°".replace("-", "−")
