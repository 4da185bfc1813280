"""The pages of a house side by side in one large picture, with smaller copies of it to its right."""

import math
from collections.abc import Sequence

import cv2
import numpy as np

from embodied.render.camera import Pixels

LEVELS = 5
"""Smaller copies, each half as large as the last."""
BLOCK = 2**LEVELS
"""Pages begin at multiples of this, so that no texel of a copy is of two of them."""
GUTTER = BLOCK // 2
"""Texels around a page that repeat its edge, at least."""
NARROWEST = 8192
"""Least width of the picture without its copies, texels; it is about square where that is more."""


def packed(pages: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """One picture of all `pages`, (h, w, 3) uint8 each.

    Returns:
      (h, w + w / 2, 4) uint8: right of the pages their copies, from the top down, the largest first.
      (pages, 2) int: column and row of each page.
    """
    corners = np.zeros((len(pages), 2), int)
    sides = [[-(-(n + 2 * GUTTER) // BLOCK) * BLOCK for n in p.shape[:2]] for p in pages]
    width = -(-max(NARROWEST, math.isqrt(sum(h * w for h, w in sides))) // BLOCK) * BLOCK
    column = row = tall = 0
    for i in sorted(range(len(pages)), key=lambda i: -sides[i][0]):
        if column + sides[i][1] > width:
            column, row, tall = 0, row + tall, 0
        corners[i] = column, row
        column, tall = column + sides[i][1], max(tall, sides[i][0])
    picture = np.zeros((max(row + tall, BLOCK), width + width // 2, 4), np.uint8)
    for page, (column, row), (rows, columns) in zip(pages, corners.tolist(), sides, strict=True):
        below, beside = rows - page.shape[0] - GUTTER, columns - page.shape[1] - GUTTER
        image = cv2.copyMakeBorder(np.ascontiguousarray(page), GUTTER, below, GUTTER, beside, cv2.BORDER_REPLICATE)
        picture[row : row + rows, column : column + columns, :3] = image
    image, row = picture[:, :width], 0
    for _ in range(LEVELS):
        image = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        picture[row : row + len(image), width : width + image.shape[1]] = image
        row += len(image)
    return picture, corners + GUTTER


def repaint(picture: np.ndarray, place: np.ndarray, shape: Pixels, at: tuple[int, int], part: np.ndarray) -> None:
    """Change part of a page in what `packed` returned, and its copies.

    Args:
      picture: (h, w + w / 2, 4) uint8, changed.
      place: column and row of the page.
      shape: height and width of the page.
      at: row and column in the page where `part` (h, w, 3) uint8 goes.
    """
    ends = at[0] + part.shape[0], at[1] + part.shape[1]
    edges = [GUTTER * side for side in (at[0] == 0, ends[0] == shape[0], at[1] == 0, ends[1] == shape[1])]
    image = cv2.copyMakeBorder(np.ascontiguousarray(part), edges[0], edges[1], edges[2], edges[3], cv2.BORDER_REPLICATE)
    row, column = int(place[1]) + at[0] - edges[0], int(place[0]) + at[1] - edges[2]
    bottom, right = row + image.shape[0], column + image.shape[1]
    picture[row:bottom, column:right, :3] = image
    height, width = picture.shape[0], picture.shape[1] * 2 // 3
    above, beside = 0, 0
    for level in range(1, LEVELS + 1):
        row, column, bottom, right = row >> 1, column >> 1, (bottom + 1) >> 1, (right + 1) >> 1
        larger = picture[above + 2 * row : above + 2 * bottom, beside + 2 * column : beside + 2 * right]
        above = 0 if level == 1 else above + (height >> (level - 1))
        beside = width
        smaller = cv2.resize(larger, (right - column, bottom - row), interpolation=cv2.INTER_AREA)
        picture[above + row : above + bottom, beside + column : beside + right] = smaller
