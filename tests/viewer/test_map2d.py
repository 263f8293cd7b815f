import numpy as np

from mhvedit.geometry.planar import rotation
from mhvedit.search.solve import ACCEPTED
from mhvedit.view.style import SUBJECTS, rgb
from mhvedit.viewer.deciding import pinned, region_excluded
from mhvedit.viewer.map2d import EXCLUDED, MapPicture, draw_map, marked
from mhvedit.viewer.preview import cell_of_row
from mhvedit.viewer.state import ViewerState, looked_at_row

SIZE = (460, 640)


def drawn(state: ViewerState) -> MapPicture:
    made = draw_map(state, width=SIZE[0], height=SIZE[1])
    assert made is not None and made.picture.shape == (SIZE[1], SIZE[0], 3)
    return made


def count(picture: np.ndarray[tuple[int, ...], np.dtype[np.uint8]], colour: str) -> int:
    return int((np.abs(picture.astype(int) - np.rint(255 * rgb(colour))) <= 2).all(-1).sum())


def test_a_pixel_means_the_place_that_is_drawn_there(state: ViewerState) -> None:
    made = drawn(state)
    view = made.view
    rows = np.arange(0, view.n_solutions, 11)
    for row in rows:
        pose = view.group.poses[row]
        x, y = made.pixels(rotation(pose[2]) @ view.grid.root_b + pose[:2])
        place = made.place(x, y)
        wanted = cell_of_row(view, int(row))[:2]
        assert place is not None and np.abs(np.subtract(place, wanted)).max() <= 1  # true to half a step


def test_a_click_on_the_colour_of_solutions_finds_one(state: ViewerState) -> None:
    made = drawn(state)
    fits = (made.view.found.reason == ACCEPTED).any(2)
    for x in range(0, SIZE[0], 9):
        for y in range(0, SIZE[1], 9):
            place, cell = made.place(x, y), made.cell(x, y)
            assert (place is None) == (cell is None)
            if place is not None and cell is not None:
                assert fits[place] == (made.view.found.reason[cell] == ACCEPTED)
                dark = made.picture[y, x].astype(int).sum() < 400
                inside = all(fits[place[0] + i, place[1] + j] for i in (-1, 0, 1) for j in (-1, 0, 1))
                assert not inside or dark


def test_beside_the_map_there_is_no_pose(state: ViewerState) -> None:
    made = drawn(state)
    for x, y in ((2, 300), (200, 3), (200, SIZE[1] - 2), (-1, -1)):
        assert made.cell(x, y) is None and made.words(x, y) == ""


def test_hovering_tells_why(state: ViewerState) -> None:
    made = drawn(state)
    said = {made.words(x, y) for x in range(0, SIZE[0], 5) for y in range(0, SIZE[1], 5)}
    assert any(words.startswith("no solution: contact at a wrong moment") for words in said)
    assert any(words.startswith("no solution: no contact (") for words in said)
    assert any("facings fit; most room" in words for words in said)


def test_what_is_excluded_has_a_colour_of_its_own(state: ViewerState) -> None:
    before = drawn(state)
    after = drawn(region_excluded(looked_at_row(state, 40)))
    assert count(before.picture, EXCLUDED) < 200  # edges of letters
    assert count(after.picture, EXCLUDED) > 5000


def test_marks_are_where_people_stand(state: ViewerState) -> None:
    made = drawn(state)
    view, row = made.view, 300
    pose = view.group.poses[row]
    at = made.pixels(rotation(pose[2]) @ view.grid.root_b + pose[:2])
    picture = marked(made, looked_at_row(state, row))
    x, y = np.rint(at).astype(int)
    assert count(picture[y - 4 : y + 5, x - 4 : x + 5], SUBJECTS[1]) > 40
    x, y = np.rint(made.pixels(view.grid.root_a)).astype(int)
    assert count(picture[y - 4 : y + 5, x - 4 : x + 5], SUBJECTS[0]) > 40
    pin = "#E69F00"
    assert count(marked(made, pinned(looked_at_row(state, row))), pin) > count(picture, pin) + 50
