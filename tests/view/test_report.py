from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from mhvedit.constraints.dictionary import InteractionType
from mhvedit.view import studio as studio_module
from mhvedit.view.content import ReportContent
from mhvedit.view.report import report_page, write_report
from mhvedit.view.words import TYPE_WORDS, asked_in_words, place_of, shown_frame, verdict_of

VOID = {"meta", "img", "br", "link", "input"}


class Page(HTMLParser):
    """Collects tags and checks that they nest."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.words = ""
        self.feed(page)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data

    def all(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def source(content: ReportContent, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("out") / "report.html"
    write_report(path, content)
    assert [entry.name for entry in path.parent.iterdir()] == ["report.html"]
    return path.read_text("utf-8")


@pytest.fixture(scope="module")
def page(source: str) -> Page:
    return Page(source)


def test_the_page_needs_nothing_from_elsewhere(page: Page, source: str) -> None:
    for _, attributes in page.tags:
        for name in ("src", "href"):
            assert attributes.get(name, "data:").startswith(("data:", "#"))
        assert "url(" not in attributes.get("style", "")
    assert "http" not in source.replace("http-equiv", "") and "@import" not in source


def test_every_picture_has_words(page: Page) -> None:
    pictures = [image for image in page.all("img") if image["src"] != "data:,"]
    assert len(pictures) >= 12
    assert all(len(image["alt"]) > 20 for image in pictures)
    assert len({image["alt"] for image in pictures}) == len(pictures)


def test_links_lead_somewhere(page: Page) -> None:
    places = {attributes.get("id") for _, attributes in page.tags}
    links = [attributes["href"][1:] for attributes in page.all("a")]
    assert len(links) == 4 and set(links) <= places


def test_the_first_words_are_the_verdict(page: Page) -> None:
    assert "1 of 2 segments placed; deepest body contact 28 mm in meet, frame 7." in page.words


def test_what_people_wrote_is_not_taken_for_markup(page: Page, source: str) -> None:
    assert "a <b>greeting</b>" in page.words and "watertight <everywhere>" in page.words
    assert "<everywhere>" not in source


def test_each_segment_tells_its_story(page: Page) -> None:
    for words in (
        "both motions end in the contact", "connected region", "Distance L", "in contact in 1 of 8 frames",
        "28 mm in frame 7", "No pose fits.", "“no contact” rejects all.", "The nearest pose misses by 14 mm.",
        "θ of anna", "ben lies on its side", "50 mm", "Lower bound", "search",
    ):  # fmt: skip
        assert words in page.words, words


def test_without_3d_the_report_is_written_and_says_why(content: ReportContent, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(studio_module, "_has_egl_device", lambda: False)
    monkeypatch.setattr(studio_module, "has_screen", lambda: False)
    page = Page(report_page(content))
    assert "apt-get install libegl1" in page.words
    assert len(page.all("img")) >= 5  # the charts are there


def test_next_to_nothing_is_still_a_report(content: ReportContent) -> None:
    bare = ReportContent("bare", tuple(replace(s, found=None, group=None, chosen=None) for s in content.stories))
    page = Page(report_page(bare))
    assert "0 of 2 segments placed." in page.words and "Not searched." in page.words
    assert "no segments" not in Page(report_page(ReportContent("nothing", ()))).words


def test_a_failure_leaves_the_old_report_and_no_litter(
    tmp_path: Path, content: ReportContent, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "report.html"
    path.write_text("old")

    def full(self: Path, *args: object, **kwargs: object) -> int:
        self.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OSError, match="No space"):
        write_report(path, ReportContent("nothing", ()))
    assert path.read_text() == "old" and [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_every_type_has_words(content: ReportContent) -> None:
    assert set(TYPE_WORDS) == set(InteractionType)
    story = content.stories[0]
    assert asked_in_words(replace(story, interaction="+&0")) == "anna’s motion ends on ben"
    assert asked_in_words(replace(story, interaction="?")) == "?"


def test_the_frame_shown_is_the_type_s_own_moment(content: ReportContent) -> None:
    story = content.stories[0]
    assert shown_frame(content, story) == story.n_frames - 1
    assert shown_frame(content, replace(story, interaction="-&-")) == 0
    assert shown_frame(content, replace(story, interaction="0&0b")) == 5  # frame 7 of the scene, where they touch


def test_the_verdict_says_where(content: ReportContent) -> None:
    assert content.check is not None
    apart = replace(content, check=replace(content.check, penetration_mm=np.zeros(20)))
    assert verdict_of(apart).endswith("nobody sinks into the other in any frame.")
    assert [place_of(content.scene, frame) for frame in (0, 10, 15)] == ["before meet", "after meet", "in part"]
