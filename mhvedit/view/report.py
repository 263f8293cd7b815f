"""One self-contained page on an edited scene, that a person should enjoy reading."""

from html import escape
from importlib.resources import files
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from mhvedit.errors import MissingLibrary, counted
from mhvedit.files import replacing
from mhvedit.search.solve import ReasonMap
from mhvedit.view import markup
from mhvedit.view.charts import over_time, trajectories
from mhvedit.view.content import CaptureStory, ReportContent, SegmentStory
from mhvedit.view.placement import MapSummary, ShownBodies, placement_map, summarise
from mhvedit.view.skeletons import fitted_strip
from mhvedit.view.story_pictures import ReportPictures, StoryPictures, as_picture, draw_pictures
from mhvedit.view.style import figure_picture
from mhvedit.view.words import (
    asked_in_words,
    deepest,
    edit_of,
    is_good,
    place_of,
    shown_frame,
    side_in_words,
    signed_degrees,
    solutions_in_words,
    verdict_of,
)

MAP_WORDS = (
    "Seen from above, {a} facing up. Dark: {b} can stand there, the darker the more ways to face. "
    "Light: nobody can; the colour is the last constraint that stood in the way of the best facing. "
    "The dial counts all facings that fit; the arrow is the chosen one."
)
FITTED_WORDS = "The fitted skeleton over the repaired capture; titles of edited frames are orange."


def write_report(path: Path, content: ReportContent) -> None:
    """Write the report; nothing half-written is ever left at its place.

    Where this machine cannot draw in 3D, a sentence that says what to install stands in for those pictures.

    Args:
        path: of the HTML file.
        content: all that it shows.
    """
    page = report_page(content)
    with replacing(path) as beside:
        beside.write_text(page, encoding="utf-8")


def report_page(content: ReportContent) -> str:
    """The report as HTML."""
    try:
        pictures, missing = draw_pictures(content), ""
    except MissingLibrary as fault:
        pictures, missing = ReportPictures(None, tuple(StoryPictures() for _ in content.stories)), str(fault)
    parts = zip(content.stories, pictures.stories, strict=True)
    sections = "".join(_segment(content, n, story, drawn, missing) for n, (story, drawn) in enumerate(parts, 1))
    body = _header(content, pictures, missing) + _navigation(content)
    body += markup.element("main", sections + _whole_scene(content) + _about(content) + _footer())
    folder = files("mhvedit.view")
    style, script = folder.joinpath("page.css").read_text("utf-8"), folder.joinpath("page.js").read_text("utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en-GB"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(content.name)} · mhvedit</title><style>{style}</style></head>\n<body>{body}"
        f'<dialog><img src="data:," alt=""></dialog><script>{script}</script></body></html>\n'
    )


def chart(drawn: Figure, alt: str, caption: str) -> str:
    """A chart as a figure of the page."""
    return markup.figure(as_picture(figure_picture(drawn), alt, caption, quality=None))


def _header(content: ReportContent, pictures: ReportPictures, missing: str) -> str:
    names = list(content.scene.subjects) if content.scene else sorted({n for s in content.stories for n in _pair(s)})
    inner = markup.paragraph("Edited scene", "eyebrow") + markup.element("h1", escape(content.name))
    inner += markup.people(names)
    inner += markup.paragraph(verdict_of(content), f"verdict {'good' if is_good(content) else 'bad'}")
    if pictures.scene is not None:
        inner += markup.figure(pictures.scene, caption="The whole scene, all pictures at one scale.")
    inner += markup.paragraph(missing, "nopicture")
    inner += markup.tiles(_key_numbers(content)) + markup.bullets(content.warnings, "warnings")
    return markup.element("header", markup.element("div", inner))


def _pair(story: SegmentStory) -> tuple[str, str]:
    return story.a.subject, story.b.subject


def _failed(content: ReportContent) -> frozenset[str]:
    return frozenset(story.name for story in content.stories if story.chosen is None)


def _key_numbers(content: ReportContent) -> dict[str, tuple[str, str]]:
    placed = sum(story.chosen is not None for story in content.stories)
    numbers = {"Key segments placed": (f"{placed} of {len(content.stories)}", "")}
    scene, check = content.scene, content.check
    if scene is not None:
        numbers["Length"] = (
            f"{scene.n_frames / scene.fps:.1f} s",
            f"{counted(scene.n_frames, 'frame')} at {scene.fps:g} fps",
        )
        numbers["Cost"] = (f"{scene.cost:.4g} m²", f"at least {scene.lower_bound:.4g} m², gap {scene.gap:.1f} %")
    where = deepest(content)
    if where is not None:
        numbers["Deepest penetration"] = (f"{where[1]:.0f} mm", f"frame {where[0]}, {place_of(scene, where[0])}")
    if check is not None:
        numbers["In contact"] = (counted(int(check.contact.sum()), "frame"), f"of {len(check.contact)}")
        if check.added_skate:
            worst = max(float(np.nanmax(values, initial=0.0)) for values in check.added_skate.values())
            numbers["Added foot skate"] = (f"{worst:.2f} m/s", "at most")
    if content.stage_seconds:
        numbers["Computed in"] = (f"{sum(content.stage_seconds.values()):.0f} s", "")
    return numbers


def _navigation(content: ReportContent) -> str:
    failed = _failed(content)
    names = [story.name for story in content.stories]
    bar = ""
    if content.scene is not None and [s.name for s in content.scene.segments] == names:
        bar = markup.element("nav", markup.element("div", markup.timeline(content.scene, failed)), title="Timeline")
    links = markup.segment_links(names, failed)
    return bar + markup.element("main", links)


def _segment(content: ReportContent, number: int, story: SegmentStory, drawn: StoryPictures, missing: str) -> str:
    inner = markup.paragraph(f"Key segment {number} of {len(content.stories)}", "eyebrow")
    inner += markup.element("h2", escape(story.name)) + _asked(story)
    inner += markup.paragraph(solutions_in_words(story), "found") if story.group is None or len(story.group) else ""
    inner += _why_empty(story)
    inner += markup.figures(drawn.strip, "")
    seen = summarise(story.found) if isinstance(story.found, ReasonMap) else story.found
    inner += _map(content, story, seen)
    inner += _numbers(content, story, seen)
    inner += markup.figures(drawn.frame + drawn.eyes, "four" if len(drawn.eyes) == 2 else "two")
    if drawn.volumes:
        inner += markup.figures(drawn.volumes, "two") + markup.volume_legend(story.n_frames)
    inner += markup.paragraph(f"No pictures in 3D: {missing}" if missing else "", "nopicture")
    inner += markup.bullets(story.notes)
    return markup.element("section", inner, id=f"segment-{number}")


def _asked(story: SegmentStory) -> str:
    a, b = story.a, story.b
    words = (
        f"{escape(a.subject)}’s <b>{escape(a.part)}</b> and {escape(b.subject)}’s <b>{escape(b.part)}</b>: "
        f"<code>{escape(story.interaction)}</code> {escape(asked_in_words(story))}."
    )
    frames = (
        f"{a.subject} frames {a.frames[0]} to {a.frames[1]}, {b.subject} frames {b.frames[0]} to {b.frames[1]}: "
        f"{counted(story.n_frames, 'frame')} in the scene"
    )
    return markup.element("p", words, class_="asked") + markup.paragraph(
        "; ".join([frames, *story.asked]) + ".", "muted"
    )


def _why_empty(story: SegmentStory) -> str:
    if story.group is None or len(story.group):
        return ""
    inner = (
        markup.element("p", "<b>No pose fits.</b>")
        + markup.paragraph(story.killed_by)
        + markup.paragraph(story.nearest)
    )
    return markup.element("div", inner, class_="empty")


def _map(content: ReportContent, story: SegmentStory, seen: MapSummary | None) -> str:
    if seen is None or story.group is None:
        return ""
    bodies = None
    if story.a.body_volume is not None and story.b.body_volume is not None:
        bodies = ShownBodies(story.a.body_volume, story.b.body_volume, shown_frame(content, story))
    names = _pair(story)
    drawn = placement_map(
        seen, story.group, story.chosen, facing_a=story.a.facing, facing_b=story.b.facing, names=names, bodies=bodies
    )
    alt = f"{story.name}: placement map of {names[1]} beside {names[0]}. {solutions_in_words(story)}"
    return markup.element("div", chart(drawn, alt, MAP_WORDS.format(a=names[0], b=names[1])), class_="row")


def _numbers(content: ReportContent, story: SegmentStory, seen: MapSummary | None) -> str:
    """What became of the poses, and the numbers of the chosen one."""
    left = ""
    if seen is not None:
        note = "Each pose is counted under the first constraint that it fails. Bars are logarithmic."
        left = markup.panel(
            markup.reason_bars(seen.counts) + markup.paragraph(note, "muted"), "What became of the poses"
        )
    edit = edit_of(content, story)
    if edit is not None and content.check is not None:
        strip = markup.contact_strip(content.check.contact[edit.start : edit.stop], edit.start)
        left += markup.panel(strip, "Frames in contact, on the meshes")
    title = "The chosen solution" if story.chosen is not None else "Numbers"
    right = markup.table(_chosen_numbers(content, story), title)
    if not left or not right:
        return left + right
    return markup.element("div", markup.element("div", left, class_="row stack") + right, class_="row half")


def _chosen_numbers(content: ReportContent, story: SegmentStory) -> dict[str, str]:
    rows: dict[str, str] = {}
    a, b = _pair(story)
    if story.group is not None and story.chosen is not None:
        group, row = story.group, story.chosen
        rows["Distance L"] = f"{group.distance[row]:.2f} m"
        rows[f"θ of {a}"] = f"{signed_degrees(group.theta_a[row])}: {b} is {side_in_words(group.theta_a[row])}"
        rows[f"θ of {b}"] = f"{signed_degrees(group.theta_b[row])}: {a} is {side_in_words(group.theta_b[row])}"
        rows["Region"] = f"{group.region[row] + 1} of {int(group.region.max()) + 1}, the largest is 1"
        rows["Clearance"] = f"{1000 * group.clearance[row]:.0f} mm to the nearest pose that does not fit"
    edit = edit_of(content, story)
    if edit is not None and content.check is not None:
        depth = content.check.penetration_mm[edit.start : edit.stop]
        if np.isfinite(depth).any():
            rows["Deepest penetration"] = f"{np.nanmax(depth):.0f} mm in frame {edit.start + int(np.nanargmax(depth))}"
    return rows | dict(story.figures)


def _whole_scene(content: ReportContent) -> str:
    inner = ""
    scene = content.scene
    if scene is not None and set(content.centres) >= set(scene.subjects):
        alt = "Top view of the paths of " + " and ".join(scene.subjects) + ", as captured and in the edited scene"
        words = "Thick lines and numbers are key segments; rings are where people start."
        inner += markup.element("div", chart(trajectories(scene, content.centres), alt, words), class_="row")
    if scene is not None and content.check is not None:
        alt = f"Penetration, gap, contact and skate in each of {scene.n_frames} frames. {verdict_of(content)}"
        drawn = over_time(scene, content.check, limit_mm=content.limit_mm)
        inner += markup.element(
            "div", chart(drawn, alt, "Measured on the meshes; key segments are shaded."), class_="row"
        )
    inner += _gap_panel(content)
    if not inner:
        return ""
    heading = markup.paragraph("All key segments together", "eyebrow") + markup.element("h2", "The whole scene")
    return markup.element("section", heading + inner, id="scene")


def _gap_panel(content: ReportContent) -> str:
    if content.scene is None:
        return ""
    scene = content.scene
    rows = {
        "Cost": f"{scene.cost:.5g} m²",
        "Lower bound": f"{scene.lower_bound:.5g} m²: no choice of these solutions can cost less",
        "Gap": f"{scene.gap:.2f} %",
    }
    return markup.table(rows, "How good is it?")


def _about(content: ReportContent) -> str:
    inner = "".join(_capture(story) for story in content.about)
    inner = markup.element("div", inner, class_="row half") if inner else ""
    tables = markup.table(content.settings, "Settings") + markup.table(
        {name: f"{seconds:.1f} s" for name, seconds in content.stage_seconds.items()}, "Time per stage"
    )
    inner += markup.element("div", tables, class_="row half") if tables else ""
    inner += markup.bullets(content.notes)
    if not inner:
        return ""
    return markup.element("section", markup.element("h2", "Captures and settings") + inner, id="captures")


def _capture(story: CaptureStory) -> str:
    rows = "".join(_row(name, escape(value)) for name, value in story.facts.items())
    if story.facing:
        rows += _row("facing", escape(story.facing)) + _row("trust in it", markup.trust(story.facing_trust))
    if story.gaze:
        rows += _row("gaze", escape(story.gaze))
    inner = f"<table><tbody>{rows}</tbody></table>" + markup.bullets(story.notes)
    if story.fitted is not None:
        inner += chart(fitted_strip(story.fitted), f"skeleton fitted to {story.name}", FITTED_WORDS)
    return markup.panel(inner, story.name)


def _row(name: str, value: str) -> str:
    return f'<tr><th scope="row">{escape(name)}</th><td>{value}</td></tr>'


def _footer() -> str:
    text = "Made by mhvedit. Frames are those of the edited scene, from 0, unless they are said to be a capture’s."
    return markup.element("footer", escape(text))
