"""The bytes of a Wavefront OBJ, scanned once (compiled): positions and triangles; what is wrong is found, not told."""

from typing import NamedTuple

from numba import njit

from mhvedit.geometry.arrays import ByteArray, FloatArray, IntArray
from mhvedit.sequences.decimals import READ, read_number

NEWLINE, RETURN, TAB, SPACE, HASH, SLASH, BACKSLASH = 10, 13, 9, 32, 35, 47, 92
MINUS, PLUS, DIGIT_0 = 45, 43, 48
MOST_DIGITS = 18  # of an index
LETTER_F, LETTER_V = 102, 118
SOUND, FEW_COORDINATES, FEW_CORNERS, INDEX_0, BAD_CORNER = range(5)  # what is wrong with a line
UNUSED = -1  # place of a number after the third of a vertex


class Scan(NamedTuple):
    """What was found, up to the first line with something wrong."""

    n_vertices: int
    n_triangles: int
    n_odd: int  # numbers that are not simple; maybe more than there was room for
    n_faces: int
    fault: int  # SOUND, or what is wrong with the last line
    line: int  # first byte of that line
    n_words: int  # how many numbers or corners it has


@njit(cache=True, nogil=True)
def scan_obj(text: ByteArray, vertices: FloatArray, triangles: IntArray, odd: IntArray) -> Scan:
    """Read the `v` and `f` lines.

    Args:
        text: (N,) the file, ending in two ends of line.
        vertices: (at least N / 7, 3) filled.
        triangles: (at least N / 2, 3) filled: fans, counted from 0; they may point at vertices there are not.
        odd: (R, 4) filled: numbers that are not simple, as place in `vertices`, first byte, last byte + 1, line.
    """
    at, n_vertices, n_triangles, n_odd, n_faces = 0, 0, 0, 0, 0
    while at < len(text) - 1:
        line, fault, count = at, SOUND, 0
        if text[at] == LETTER_V and _is_gap(text[at + 1]):
            at, count, n_odd = _vertex(text, line, n_vertices, vertices, odd, n_odd)
            fault = FEW_COORDINATES if count < 3 else SOUND
            n_vertices += 1
        elif text[at] == LETTER_F and _is_gap(text[at + 1]):
            i, j, k, at = _plain_triangle(text, line)
            if at > line:
                triangles[n_triangles, 0], triangles[n_triangles, 1], triangles[n_triangles, 2] = i, j, k
                n_triangles += 1
            else:
                at, count, fault = _face(text, line, n_vertices, triangles, n_triangles)
                n_triangles += max(0, count - 2)
            n_faces += 1
        elif text[at] == SPACE or text[at] == TAB:
            at += 1
            continue
        if fault != SOUND:
            return Scan(n_vertices, n_triangles, n_odd, n_faces, fault, line, count)
        while text[at] != NEWLINE and text[at] != RETURN:
            at += 1 if text[at] != BACKSLASH else max(1, _joint(text, at))
        at += 1
    return Scan(n_vertices, n_triangles, n_odd, n_faces, SOUND, 0, 0)


@njit(cache=True, nogil=True)
def _joint(text: ByteArray, at: int) -> int:
    """Length of a backslash and the end of line that it takes back; 0 where it stands before something else."""
    if text[at + 1] == RETURN and text[at + 2] == NEWLINE:
        return 3
    return 2 if text[at + 1] == RETURN or text[at + 1] == NEWLINE else 0


@njit(cache=True, nogil=True)
def _is_gap(byte: int) -> bool:
    return byte == SPACE or byte == TAB or byte == BACKSLASH


@njit(cache=True, nogil=True)
def _ends_line(byte: int) -> bool:
    """Whether nothing more of the line is read from here on."""
    return byte == NEWLINE or byte == RETURN or byte == HASH


@njit(cache=True, nogil=True)
def _ends_word(byte: int) -> bool:
    return byte <= SPACE or byte == HASH or byte == BACKSLASH


@njit(cache=True, nogil=True)
def _next_word(text: ByteArray, at: int) -> int:
    """The next word of the line, or where the line ends."""
    while True:
        while text[at] <= SPACE and not _ends_line(text[at]):
            at += 1
        step = _joint(text, at) if text[at] == BACKSLASH else 0
        if step == 0:
            return at
        at += step


@njit(cache=True, nogil=True)
def _vertex(
    text: ByteArray, line: int, vertex: int, vertices: FloatArray, odd: IntArray, n_odd: int
) -> tuple[int, int, int]:
    """Read a `v` line: where it ends, how many numbers it has, and how many odd ones there are now."""
    at, count = _next_word(text, line + 1), 0
    while not _ends_line(text[at]):
        value, stop, state = read_number(text, at)
        if state != READ or not _ends_word(text[stop]):
            while not _ends_word(text[stop]) or stop == at:
                stop += 1
            if n_odd < len(odd):
                odd[n_odd, 0] = 3 * vertex + count if count < 3 else UNUSED
                odd[n_odd, 1], odd[n_odd, 2], odd[n_odd, 3] = at, stop, line
            n_odd += 1
        if count < 3:
            vertices[vertex, count] = value
        count += 1
        plain = text[stop] == SPACE and HASH < text[stop + 1] < BACKSLASH
        at = stop + 1 if plain else _next_word(text, stop)
    return at, count, n_odd


@njit(cache=True, nogil=True)
def _plain_triangle(text: ByteArray, line: int) -> tuple[int, int, int, int]:
    """The corners of an `f` line of the commonest kind, counted from 0, and where it ends: at its start if it is none.

    Three corners, counted from the first vertex, after one space each; this is `_face` where most of the time goes.
    """
    i, j, k, at = 0, 0, 0, line + 1
    for _ in range(3):
        i, j, k = j, k, 0
        if text[at] != SPACE:
            return 0, 0, 0, line
        start = at + 1
        at = start
        while DIGIT_0 <= text[at] <= DIGIT_0 + 9:
            k = 10 * k + int(text[at]) - DIGIT_0
            at += 1
        if k == 0 or at - start > MOST_DIGITS:
            return 0, 0, 0, line
        if text[at] == SLASH:  # `/texture/normal`
            while HASH < text[at] < BACKSLASH:
                at += 1
    return i - 1, j - 1, k - 1, (at if text[at] == NEWLINE or text[at] == RETURN else line)


@njit(cache=True, nogil=True)
def _face(text: ByteArray, line: int, n_vertices: int, triangles: IntArray, n_triangles: int) -> tuple[int, int, int]:
    """Read an `f` line into a fan: where it ends, how many corners it has, and what is wrong with it."""
    at, count, first, before = _next_word(text, line + 1), 0, 0, 0
    while not _ends_line(text[at]):
        index, stop = _index(text, at)
        if stop == at or not (_ends_word(text[stop]) or text[stop] == SLASH):
            return at, count, BAD_CORNER
        if index == 0:
            return at, count, INDEX_0
        corner = index - 1 if index > 0 else n_vertices + index
        if count == 0:
            first = corner
        elif count >= 2:
            triangle = n_triangles + count - 2
            triangles[triangle, 0], triangles[triangle, 1], triangles[triangle, 2] = first, before, corner
        before = corner
        count += 1
        while not _ends_word(text[stop]):  # `/texture/normal`
            stop += 1
        at = _next_word(text, stop)
    return at, count, FEW_CORNERS if count < 3 else SOUND


@njit(cache=True, nogil=True)
def _index(text: ByteArray, start: int) -> tuple[int, int]:
    """The whole number that starts at a byte, and where it ends: there again if it is none, or too long."""
    at = start + 1 if text[start] == MINUS or text[start] == PLUS else start
    first, value = at, 0
    while DIGIT_0 <= text[at] <= DIGIT_0 + 9:
        value = 10 * value + int(text[at]) - DIGIT_0
        at += 1
    if at == first or at - first > MOST_DIGITS:
        return 0, start
    return (-value if text[start] == MINUS else value), at
