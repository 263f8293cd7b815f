"""Small pieces of HTML; every one escapes what it is given."""

import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape

import numpy as np

from mhvedit.geometry.arrays import BoolArray
from mhvedit.scene.edit import EditedScene
from mhvedit.view.placement import short_count
from mhvedit.view.story_pictures import Picture
from mhvedit.view.style import LABEL_NAMES, LABELS, SUBJECTS, TIME_MAP, reason_colours, time_colours

RAMP_STOPS = 9
LOW_TRUST = 0.5


def element(tag: str, inner: str, **attributes: str) -> str:
    """An element around finished markup; `class_` is `class`.

    >>> element("p", "five", class_="muted")
    '<p class="muted">five</p>'
    """
    words = "".join(f' {name.rstrip("_")}="{escape(value)}"' for name, value in attributes.items() if value)
    return f"<{tag}{words}>{inner}</{tag}>"


def paragraph(text: str, kind: str = "") -> str:
    """Escaped text in a paragraph; nothing for nothing."""
    return element("p", escape(text), class_=kind) if text else ""


def bullets(texts: Sequence[str], kind: str = "notes") -> str:
    """A list; nothing for nothing."""
    return element("ul", "".join(element("li", escape(text)) for text in texts), class_=kind) if texts else ""


def figure(picture: Picture, *, caption: str | None = None) -> str:
    """A picture that opens large when clicked."""
    source = "data:image/webp;base64," + base64.b64encode(picture.data).decode()
    size = f'width="{picture.width}" height="{picture.height}"'
    image = f'<img src="{source}" alt="{escape(picture.alt)}" {size} loading="lazy">'
    button = element("button", image, type="button", title="Show large")
    return element("figure", button + element("figcaption", escape(picture.caption if caption is None else caption)))


def figures(pictures: Iterable[Picture], columns: str) -> str:
    """Pictures side by side; nothing for nothing."""
    inner = "".join(figure(picture) for picture in pictures)
    return element("div", inner, class_=f"row {columns}") if inner else ""


def table(rows: Mapping[str, str], title: str = "") -> str:
    """Names and values in a panel; nothing for nothing."""
    if not rows:
        return ""
    body = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td>{escape(value)}</td></tr>' for name, value in rows.items()
    )
    return panel(f"<table><tbody>{body}</tbody></table>", title)


def panel(inner: str, title: str = "") -> str:
    """A framed box."""
    heading = element("h3", escape(title)) if title else ""
    return element("div", heading + inner, class_="panel")


def tiles(values: Mapping[str, tuple[str, str]]) -> str:
    """Key numbers: name -> value and small print."""
    inner = "".join(
        f"<div><dt>{escape(name)}</dt><dd>{escape(value)}<small>{escape(small)}</small></dd></div>"
        for name, (value, small) in values.items()
    )
    return element("dl", inner, class_="tiles")


def reason_bars(counts: Mapping[str, int]) -> str:
    """What became of the poses, by reason; the bars' lengths are logarithmic, the numbers are not."""
    shown = {reason: number for reason, number in counts.items() if reason != "outside the window"}
    longest = np.log10(max(10, *shown.values())) if shown else 1.0
    inner = ""
    for (reason, number), colour in zip(shown.items(), reason_colours(list(shown)), strict=True):
        width = 100 * np.log10(max(1, number)) / longest
        bar = f'<i style="width:{width:.1f}%;background:{colour}"></i>' if number else "<span></span>"
        name = "solutions" if reason == "accepted" else reason
        inner += f"<span>{escape(name)}</span>{bar}<b>{short_count(number)}</b>"
    return element("div", inner, class_="bars")


def contact_strip(contact: BoolArray, first: int) -> str:
    """One cell a frame, marked where they touch.

    Args:
        contact: (tau,).
        first: frame of the scene that the strip begins with.
    """
    cells = "".join('<i class="on"></i>' if touch else "<i></i>" for touch in contact)
    last = first + len(contact) - 1
    label = f"in contact in {int(contact.sum())} of {len(contact)} frames"
    strip = f'<div class="strip" role="img" aria-label="{label}">{cells}</div>'
    return strip + f'<div class="ends"><span>frame {first}</span><span>{label}</span><span>frame {last}</span></div>'


def timeline(scene: EditedScene, failed: frozenset[str]) -> str:
    """The scene from first to last frame with its key segments, which are links."""
    links = ""
    for number, segment in enumerate(scene.segments, 1):
        left = 100 * segment.start / scene.n_frames
        width = 100 * (segment.stop - segment.start) / scene.n_frames
        title = f"{segment.name}: frames {segment.start} to {segment.stop - 1}"
        kind = "failed" if segment.name in failed else ""
        place = f"left:{left:.2f}%;width:{width:.2f}%"
        links += element("a", str(number), href=f"#segment-{number}", style=place, title=title, class_=kind)
    return element("div", links, class_="line")


def segment_links(names: Sequence[str], failed: frozenset[str]) -> str:
    """A numbered list of all key segments."""
    items = ""
    for number, name in enumerate(names, 1):
        kind = "failed" if name in failed else ""
        link = element("a", f"{number} {escape(name)}", href=f"#segment-{number}", class_=kind)
        items += element("li", link)
    return element("ul", items, class_="names")


def people(names: Sequence[str]) -> str:
    """Who is who, by colour."""
    spans = ""
    for i, name in enumerate(names):
        dot = f'<i class="dot" style="background:{SUBJECTS[i % len(SUBJECTS)]}"></i>'
        spans += element("span", dot + escape(name))
    return element("div", spans, class_="people")


def volume_legend(n_frames: int) -> str:
    """What the colours of the volumes mean."""
    stops = ",".join(f"rgb({r},{g},{b})" for r, g, b in time_colours(np.linspace(0, 1, RAMP_STOPS)))
    ramp = f'<i class="ramp" title="{TIME_MAP}" style="background:linear-gradient(90deg,{stops})"></i>'
    inner = element("span", f"Left, when a place is left for good: first frame{ramp}last frame ({n_frames} frames)")
    swatches = "".join(
        element("span", f'<i class="swatch" style="background:{colour}"></i>{escape(LABEL_NAMES[label])}')
        for label, colour in LABELS.items()
    )
    return element("div", inner + "<span>Right:</span>" + swatches, class_="legend")


def trust(value: float | None) -> str:
    """A meter for a trust of 0 to 1."""
    if value is None:
        return "—"
    kind = ' class="low"' if value < LOW_TRUST else ""
    return f'<span class="meter"><i{kind} style="width:{100 * value:.0f}%"></i></span>{value:.2f}'
