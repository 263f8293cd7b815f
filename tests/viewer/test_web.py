"""The viewer in a browser, as a person uses it."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page, sync_playwright

from mhvedit.geometry.arrays import ByteArray
from mhvedit.project.scene_file import load_scene
from mhvedit.viewer.web import free_port
from tests.viewer.needed import program

FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
PATIENCE = 30_000  # ms


@pytest.fixture
def page(folder: Path) -> Iterator[Page]:
    """The page that `mhvedit view OUT --web` serves; it may have nothing to complain about."""
    chromium = program("chromium", "chromium-browser", "google-chrome")
    command = [sys.executable, "-m", "mhvedit.cli", "view", str(folder / "out"), "--web", "--workers", "1"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=_environment())
    try:
        assert server.stdout is not None
        address = next(word for line in server.stdout for word in line.split() if word.startswith("http://"))
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
            page = browser.new_page(viewport={"width": 1300, "height": 800})
            complaints: list[str] = []
            page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
            page.on("pageerror", lambda error: complaints.append(str(error)))
            page.set_default_timeout(PATIENCE)
            page.goto(address)
            page.wait_for_selector("#map[src]")
            page.wait_for_function("document.querySelector('#scene img, #scene canvas')")
            yield page
            assert complaints == []
            browser.close()
    finally:
        server.terminate()
        _, said = server.communicate(timeout=20)
    assert "Traceback" not in said, said


def _environment() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name != "DISPLAY"} | {"PYTHONUNBUFFERED": "1"}


def scene_of(page: Page) -> ByteArray:
    """What the 3D view shows, once it stays the same."""
    last = None
    for _ in range(40):
        picture = np.asarray(Image.open(BytesIO(page.locator("#scene").screenshot())).convert("RGB"))
        if last is not None and last.shape == picture.shape and (picture == last).mean() > 0.999 and picture.std() > 5:
            return picture
        last = picture
        time.sleep(0.25)
    raise AssertionError("the 3D view does not come to rest")


def differing(a: ByteArray, b: ByteArray) -> float:
    """Share of pixels that differ clearly."""
    return float((np.abs(a.astype(int) - b).max(-1) > 40).mean())


def test_an_editor_at_work(page: Page, folder: Path) -> None:
    first = scene_of(page)
    assert (first[..., 2].astype(int) - first[..., 0] > 40).mean() > 0.02  # Anna
    assert (first[..., 0].astype(int) - first[..., 2] > 40).mean() > 0.02  # Ben

    page.mouse.move(*_on_map(page, 0.3, 0.15))
    page.wait_for_function("document.querySelector('#hover').innerText.length > 5")
    _click_a_solution(page)
    page.wait_for_function("document.querySelector('#shown').innerText.startsWith('preview: ben')")
    second = scene_of(page)
    assert differing(first, second) > 0.02

    before = page.inner_text("#frame")
    page.click("#play")
    page.wait_for_function(f"document.querySelector('#frame').innerText !== '{before}'")
    seen = set()
    for _ in range(12):
        page.wait_for_timeout(70)
        seen.add(page.inner_text("#frame"))
    assert len(seen) > 3
    page.keyboard.press("Space")
    page.keyboard.press("Home")
    page.wait_for_function("document.querySelector('#frame').innerText === '0'")
    page.keyboard.press("3")
    page.wait_for_function("window.trame.state.get('camera') === 'top'")
    assert differing(second, scene_of(page)) > 0.02

    _click_a_solution(page)
    page.click("#pin")
    page.wait_for_function("document.querySelector('#message').innerText === 'solved'")
    page.click("#save")
    page.wait_for_function("document.querySelector('#message').innerText.startsWith('saved ')")
    assert load_scene(folder / "scene.toml").segments[0].pin is not None

    page.click("#undo")
    page.wait_for_function("!document.querySelector('#save').disabled")
    page.wait_for_function("!window.trame.state.get('busy')")
    page.fill("#half-angle", "70")
    page.locator("#half-angle").press("Enter")
    page.locator("#half-angle").blur()
    page.wait_for_function("!document.querySelector('#solve').disabled")
    page.click("#solve")
    page.wait_for_function("document.querySelector('#solve').disabled && !window.trame.state.get('busy')")
    page.click("#save")
    page.wait_for_function("document.querySelector('#message').innerText.startsWith('saved ')")
    raised = load_scene(folder / "scene.toml").segments[0]
    assert raised.pin is None and raised.visibility is not None
    assert raised.visibility.half_angle == pytest.approx(np.radians(70))

    page.keyboard.press("h")
    page.wait_for_selector("#help-card")


def _on_map(page: Page, right: float, down: float) -> tuple[float, float]:
    box = page.locator("#map").bounding_box()
    assert box is not None
    return box["x"] + right * box["width"], box["y"] + down * box["height"]


def _click_a_solution(page: Page) -> None:
    """On the map, where a solution is that is not the chosen one."""
    for down in np.arange(0.1, 0.5, 0.02):
        page.mouse.move(*_on_map(page, 0.45, float(down)))
        page.wait_for_timeout(150)
        if "facings fit" in page.inner_text("#hover"):
            page.mouse.click(*_on_map(page, 0.45, float(down)))
            return
    raise AssertionError("no solution on the map")


def test_a_port_in_use_is_left_to_whoever_has_it() -> None:
    with closing(socket.socket()) as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert free_port("127.0.0.1", port) > port
