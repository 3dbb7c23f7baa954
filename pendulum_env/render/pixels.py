"""Loops over the pixels of moving shapes: plain Python on numbers, which numba compiles.

Both ways to run them give the same pixels. Lengths are in pixels and colours in 0 to 255; the pixel in row i and column
j has its centre at (j + 0.5, i + 0.5). `image` has the shape (H, W, 3) and the type uint8; colours are float32.
Compiled code does not check indices: the arrays must have the shapes that are said here, and rows and columns that are
given must be inside the image. Coordinates must be numbers, but may be far outside. Fractions of pixels are computed in
single precision.
"""

from __future__ import annotations

import math
from typing import Any

from numpy import ceil, float32, float64, uint8

__all__ = ["arrow", "ball", "bar", "blend", "clipped", "disc", "graph", "line", "passages", "pieces", "trail"]

NONE, HALF, FULL, NOWHERE = float32(0.0), float32(0.5), float32(1.0), float32(math.inf)
PARTS = 3
"""Number of strips into which a graph divides each column of pixels."""
TURN = 2 * math.pi
LARGEST = 2.0**53
"""Angle [rad] from which on numbers are more than a radian apart, so that no place on a circle belongs to them."""


def mix(image: Any, row: Any, column: Any, share: Any, colour: Any) -> None:
    """Mix a colour, (3,), into one pixel; `share`, 0 to 1, is the fraction of the colour."""
    for k in range(3):
        under = float32(image[row, column, k])
        image[row, column, k] = uint8((colour[k] - under) * share + under + HALF)


def distance(x: Any, y: Any) -> Any:
    """Return the square root of x^2 + y^2, of numbers in single precision."""
    return float32(math.sqrt(float64(x) * float64(x) + float64(y) * float64(y)))


def blend(image: Any, cover: Any, colour: Any) -> None:
    """Mix a colour, (3,), into all pixels of an image; `cover` (H, W), 0 to 1, is its fraction in each."""
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            if cover[row, column] > NONE:
                mix(image, row, column, cover[row, column], colour)


def disc(
    image: Any, left: int, top: int, right: int, bottom: int, x: float, y: float, radius: float, share: float,
    colour: Any
) -> None:
    """Paint a disc with its centre at (x, y) and the opacity `share`, inside a box of whole pixels."""
    edge = float32(radius + 0.5)
    for row in range(top, bottom):
        for column in range(left, right):
            away = distance(float32(column) + HALF - float32(x), float32(row) + HALF - float32(y))
            cover = min(edge - away, FULL)
            if cover > NONE:
                mix(image, row, column, cover * float32(share), colour)


def line(
    image: Any, swapped: bool, top: int, bottom: int, count: int, x0: float, y0: float, ux: float, uy: float,
    length: float, reach: float, width: float, colours: Any
) -> None:
    """Paint `count` pixels around a straight line in each row from `top` to before `bottom`.

    The line begins at (x0, y0) and has the direction (ux, uy); the colours (n, 3) are those across it, from left to
    right. With `swapped`, rows and columns are exchanged, for the line and for the image.
    """
    columns = image.shape[0] if swapped else image.shape[1]
    half, most = float32(width / 2), float32(min(1.0, width))
    across_x, across_y, along_x, along_y = float32(uy), float32(-ux), float32(ux), float32(uy)
    scale, middle = float32((len(colours) - 1) / width), float32((len(colours) - 1) / 2)
    for row in range(top, bottom):
        y = float32(row) + HALF - float32(y0)
        left = ceil(y * float32(ux / uy) + float32(x0 - reach - 0.5))
        left = left if left > NONE else NONE
        left = min(left, float32(columns - count))
        start = left + float32(0.5 - x0)
        first = int(left)
        for j in range(count):
            across = float32(j) * across_x + (start * across_x + y * across_y)
            along = float32(j) * along_x + (start * along_x + y * along_y)
            share = min(min(float32(length) - along, along), half - abs(across)) + HALF
            if share > NONE:
                tone = colours[int(min(max(across * scale + middle, NONE), float32(len(colours) - 1)))]
                if swapped:
                    mix(image, first + j, row, min(share, most), tone)
                else:
                    mix(image, row, first + j, min(share, most), tone)


def ball(
    image: Any, left: int, top: int, right: int, bottom: int, x: float, y: float, radius: float, shades: Any
) -> None:
    """Paint a ball with its centre at (x, y), inside a box of whole pixels.

    The table `shades` (n, 3) has its colours by the distance from its brightest point, from 0 to 3 radii.
    """
    edge, scale = float32(radius + 0.5), float32(len(shades) / (3 * radius))
    for row in range(top, bottom):
        dy = float32(row) + HALF - float32(y)
        for column in range(left, right):
            dx = float32(column) + HALF - float32(x)
            share = min(edge - distance(dx, dy), FULL)
            if share > NONE:
                far = distance(dx + float32(0.36 * radius), dy + float32(0.40 * radius)) * scale
                mix(image, row, column, share, shades[min(max(int(far), 0), len(shades) - 1)])


def bar(image: Any, left: float, top: int, right: float, bottom: int, colour: Any) -> None:
    """Paint the part inside an image of an upright rectangle between whole rows.

    Its left and right ends may be fractions of a pixel.
    """
    columns = image.shape[1]
    left, right = min(max(left, -2.0), columns + 2.0), min(max(right, -2.0), columns + 2.0)
    first, last = math.ceil(left), math.floor(right)
    for row in range(max(top, 0), min(bottom, image.shape[0])):
        for column in range(max(first, 0), min(last, columns)):
            for k in range(3):
                image[row, column, k] = uint8(colour[k])
        if first > last:
            if 0 <= last < columns:
                mix(image, row, last, float32(right - left), colour)
        else:
            if left < first and 0 < first <= columns:
                mix(image, row, first - 1, float32(first - left), colour)
            if last < right and 0 <= last < columns:
                mix(image, row, last, float32(right - last), colour)


def passages(strength: Any, path: Any, sizes: Any, fade: Any) -> tuple[float, float]:
    """Write how visible a trail is at each of the equal parts of a circle that `strength` (bins,) has.

    The trail goes through the angles `path` (n,) [rad] with the opacities `fade` (n,), linearly from one to the next;
    where it passes a part again, the later passage stays. A path of more than a turn with a step of more than a turn is
    changed: its steps are cut to one turn. The sizes of its steps are written to `sizes` (n - 1,).

    Returns the lowest and the highest angle of the path [rad]; two zeros, and no strength, for a path with an angle
    beyond LARGEST.
    """
    bins, low, high, longest = len(strength), path[0], path[0], 0.0
    for angle in path:
        if not abs(angle) < LARGEST:
            return 0.0, 0.0
    for k in range(1, len(path)):
        sizes[k - 1] = abs(path[k] - path[k - 1])
        low, high, longest = min(low, path[k]), max(high, path[k]), max(longest, sizes[k - 1])
    if high - low > TURN and longest > TURN:
        before, newest, path[0] = path[0], path[-1], 0.0
        for k in range(1, len(path)):
            step = min(max(path[k] - before, -TURN), TURN)
            before, path[k], sizes[k - 1] = path[k], path[k - 1] + step, abs(step)
        shift = newest - path[-1]
        for k in range(len(path)):
            path[k] += shift
            low, high = (path[k], path[k]) if k == 0 else (min(low, path[k]), max(high, path[k]))
    end, scale = 0.0, bins / TURN
    for k in range(len(sizes)):
        begin, end = end, end + math.ceil(sizes[k] * scale + 1)
        start, goal = path[k] * scale, path[k + 1] * scale
        turned, faded = (goal - start) / (end - begin), (fade[k + 1] - fade[k]) / (end - begin)
        for moment in range(int(begin) + 1, int(end)):
            strength[round(turned * (moment - begin) + start) % bins] = faded * (moment - begin) + fade[k]
        strength[round(goal) % bins] = fade[k + 1]
    return low, high


def trail(
    image: Any, rows: Any, columns: Any, bins: Any, cover: Any, first: int, last: int, strength: Any, colour: Any
) -> None:
    """Mix a colour into the pixels from `first` to before `last` of a circle, by their cover and their bin's strength.
    """
    for k in range(first, last):
        share = strength[bins[k]] * cover[k]
        if share > NONE:
            mix(image, rows[k], columns[k], share, colour)


def arrow(
    image: Any, rows: Any, columns: Any, angles: Any, side: Any, cone: Any, slope: Any, first: int, last: int,
    end: float, radius: float, long: float, whole: float, colour: Any
) -> None:
    """Paint an arrow on the pixels from `first` to before `last` of a circle.

    It has a head of length `long` whose tip is at the angle `end` [rad], and the length `whole`; a negative radius is
    that of an arrow in the clockwise direction.
    """
    neck, tip = float32(0.9) * float32(long) - HALF, float32(long) + HALF
    for k in range(first, last):
        rest = (float32(end) - angles[k]) * float32(radius)
        shaft = min(min(rest - neck, side[k]), float32(whole + 0.5) - rest)
        share = max(min(rest * float32(slope) + cone[k], tip - rest), shaft)
        if share > NONE:
            mix(image, rows[k], columns[k], min(share, FULL), colour)


def clipped(path: Any, right: float, bottom: float, least: float, rows: Any) -> tuple[int, float, float, float, float]:
    """Write the straight pieces of a path that are inside a box to `rows` (n, 6): (x0, y0, strength, x1, y1, strength).

    The points (x, y, strength) of the path are joined by straight lines; where one is nan, the path is interrupted. The
    box reaches from `least` to `right` and from `least` to `bottom`. Returns the number of pieces, and the box that
    their ends fill: left, top, right and bottom.
    """
    count, first_x, first_y, last_x, last_y = 0, math.inf, math.inf, -math.inf, -math.inf
    for k in range(len(path) - 1):
        begin, end = 0.0, 1.0
        for i in range(3):
            if math.isnan(path[k, i]) or math.isnan(path[k + 1, i]):
                begin = 2.0
        for i in range(2):
            start, span = path[k, i], path[k + 1, i] - path[k, i]
            most = right if i == 0 else bottom
            if span == 0.0:
                if start < least or start > most:
                    begin = 2.0
            else:
                near, far = (least - start) / span, (most - start) / span
                begin, end = max(begin, min(near, far)), min(end, max(near, far))
        if begin < end:
            for i in range(3):
                span = path[k + 1, i] - path[k, i]
                rows[count, i], rows[count, 3 + i] = path[k, i] + begin * span, path[k, i] + end * span
            first_x, last_x = min(first_x, rows[count, 0], rows[count, 3]), max(last_x, rows[count, 0], rows[count, 3])
            first_y, last_y = min(first_y, rows[count, 1], rows[count, 4]), max(last_y, rows[count, 1], rows[count, 4])
            count += 1
    return count, first_x, first_y, last_x, last_y


def pieces(shown: Any, rows: Any, count: int, left: int, top: int, width: float, longest: float) -> None:
    """Raise the opacities `shown` (h, w) to those of `count` straight lines, `width` pixels wide.

    The rows are (x0, y0, strength, x1, y1, strength): the ends of a line and the opacities there. A line is painted in
    pieces of at most `longest` pixels. The first pixel of `shown` is the one at (left, top) of the image.
    """
    edge, most = float32(width / 2 + 0.5), float32(min(1.0, width))
    near = edge * edge
    for k in range(count):
        parts = max(math.ceil(math.hypot(rows[k, 3] - rows[k, 0], rows[k, 4] - rows[k, 1]) / longest), 1)
        step_x, step_y = (rows[k, 3] - rows[k, 0]) / parts, (rows[k, 4] - rows[k, 1]) / parts
        fade = (rows[k, 5] - rows[k, 2]) / parts
        for part in range(parts):
            x0, y0, first = rows[k, 0] + part * step_x, rows[k, 1] + part * step_y, rows[k, 2] + part * fade
            x1, y1 = rows[k, 0] + (part + 1) * step_x, rows[k, 1] + (part + 1) * step_y
            last = rows[k, 2] + (part + 1) * fade
            dx, dy = float32(x1 - x0), float32(y1 - y0)
            square = dx * dx + dy * dy
            square = square if square > NONE else FULL
            pad = width / 2 + 1.0
            column, row = math.floor(min(x0, x1) - pad), math.floor(min(y0, y1) - pad)
            for i in range(math.floor(max(y0, y1) + pad) - row + 1):
                y = float32(row + 0.5 - y0) + float32(i)
                for j in range(math.floor(max(x0, x1) + pad) - column + 1):
                    x = float32(column + 0.5 - x0) + float32(j)
                    along = min(max((x * dx + y * dy) / square, NONE), FULL)
                    off_x, off_y = x - along * dx, y - along * dy
                    if off_x * off_x + off_y * off_y < near:  # a root takes longer than all else here
                        strength = float32(first + float64(along) * (last - first))
                        cover = min(edge - distance(off_x, off_y), most) * strength
                        if cover > shown[row - top + i, column - left + j]:
                            shown[row - top + i, column - left + j] = cover


def graph(
    image: Any, left: int, top: int, right: int, bottom: int, xs: Any, ys: Any, pad: int, step: int, shifts: Any,
    rises: Any, opacities: Any, tones: Any, heights: Any, edges: Any
) -> None:
    """Paint a graph, the line through the points (xs, ys), into a box of whole pixels, in bands, the widest first.

    The arrays `heights` and `edges` (bands, 2, parts of all columns) are for scratch: the first has room for the
    heights of the graph below the top of the box at points of which each part of a column has `step`, from `pad` pixels
    left of the box to `pad` right of it. A band reaches from each point of the graph by `shifts` (bands, n), in points,
    and `rises` (bands, n), in pixels; it has an opacity and a tone (3,). Heights of nan are left out.
    """
    bands, _, count = edges.shape
    fine, last = PARTS * step, len(xs) - 1
    begin, end, place = 0, 0, 0
    for i in range(len(heights)):
        x = float(left - pad) + i / fine
        begin, end = begin + (x < xs[0]), end + (x < xs[last])
        if x < xs[0]:
            height = ys[0]
        elif x >= xs[last]:
            height = ys[last]
        else:
            while xs[place + 1] <= x:
                place += 1
            height = ys[place]
            if x != xs[place]:
                height += (ys[place + 1] - ys[place]) / (xs[place + 1] - xs[place]) * (x - xs[place])
        heights[i] = float32(height - top)
    for band in range(bands):
        for i in range(count):
            edges[band, 0, i], edges[band, 1, i] = NOWHERE, -NOWHERE
        for k in range(shifts.shape[1]):
            shift, rise = pad * fine + step // 2 + shifts[band, k], rises[band, k]
            for i in range(max(0, -((shift - begin) // step)), min(count, (end - shift) // step + 1)):
                level = heights[shift + i * step]
                if level - rise < edges[band, 0, i]:
                    edges[band, 0, i] = level - rise
                if level + rise > edges[band, 1, i]:
                    edges[band, 1, i] = level + rise
    for column in range(left, right):
        place = (column - left) * PARTS
        highest, lowest = NOWHERE, -NOWHERE
        for part in range(place, place + PARTS):
            highest, lowest = min(highest, edges[0, 0, part]), max(lowest, edges[0, 1, part])
        if not highest < lowest:
            continue
        first = int(min(max(highest, NONE), float32(bottom - top)))
        for row in range(first, math.ceil(min(max(lowest, NONE), float32(bottom - top)))):
            red, green, blue = (float32(image[top + row, column, 0]), float32(image[top + row, column, 1]),
                                float32(image[top + row, column, 2]))
            for band in range(bands):
                cover = NONE
                for part in range(place, place + PARTS):
                    above, below = edges[band, 0, part], edges[band, 1, part]
                    cover += max(min(float32(row) + FULL, below) - max(float32(row), above), NONE)
                cover *= float32(opacities[band] / PARTS)
                red += (tones[band, 0] - red) * cover
                green += (tones[band, 1] - green) * cover
                blue += (tones[band, 2] - blue) * cover
            image[top + row, column, 0] = uint8(red + HALF)
            image[top + row, column, 1] = uint8(green + HALF)
            image[top + row, column, 2] = uint8(blue + HALF)
