"""The loops of embodied.light.moving over texels and discs, compiled by Numba (extra [numba]): the same within one of
255, sooner."""

import math

import numpy as np

from embodied.render.kernels import compiled_for

ROWS = "float32[:, ::1]"
FLOATS = "float32[::1]"
PICTURE = "uint8[:, :, :]"


@compiled_for(f"void({ROWS}, {ROWS}, {ROWS}, {ROWS}, boolean[::1], {FLOATS}, {ROWS}, {FLOATS}, {ROWS}, {ROWS})")
def hiding(
    position: np.ndarray,
    normal: np.ndarray,
    at: np.ndarray,
    out: np.ndarray,
    thin: np.ndarray,
    area: np.ndarray,
    sent: np.ndarray,
    total: np.ndarray,
    mean: np.ndarray,
    light: np.ndarray,
) -> None:
    """Write what `movers.hiding` returns, the mean direction not yet of unit length."""
    pi, none, least = np.float32(math.pi), np.float32(0), np.float32(1e-6)
    for i in range(len(position)):
        px, py, pz = position[i, 0], position[i, 1], position[i, 2]
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        whole = mx = my = mz = red = green = blue = none
        for k in range(len(at)):
            x, y, z = at[k, 0] - px, at[k, 1] - py, at[k, 2] - pz
            here = nx * x + ny * y + nz * z
            if here <= none:
                continue
            there = -(out[k, 0] * x + out[k, 1] * y + out[k, 2] * z)
            if thin[k]:
                there = abs(there)
            if there <= none:
                continue
            far2 = max(x * x + y * y + z * z, least)
            share = here * there * area[k] / (far2 * (pi * far2 + area[k]))
            whole += share
            mx, my, mz = mx + share * x, my + share * y, mz + share * z
            red, green, blue = red + share * sent[k, 0], green + share * sent[k, 1], blue + share * sent[k, 2]
        scale = np.float32(1) / whole if whole > np.float32(1) else np.float32(1)
        total[i] = whole * scale
        mean[i, 0], mean[i, 1], mean[i, 2] = mx, my, mz
        light[i, 0], light[i, 1], light[i, 2] = red * scale, green * scale, blue * scale


@compiled_for(
    f"void({PICTURE}, float32[:, :, ::1], int64[::1], int64, boolean[:, :], float32[:, ::1], float32[:, :, ::1],"
    f" {FLOATS}, uint8[::1], uint8[:, :, ::1])"
)
def paint(
    albedo: np.ndarray,
    light: np.ndarray,
    margin: np.ndarray,
    fineness: int,
    changes: np.ndarray,
    sun: np.ndarray,
    sunlight: np.ndarray,
    linear: np.ndarray,
    shown: np.ndarray,
    picture: np.ndarray,
) -> None:
    """Write exposed radiance as it is displayed (`tone.displayed`) where luxels change.

    Args:
      albedo, picture: (h f, w f, 3) uint8.
      light: exposed light of luxels, with a margin of so many above and left, and perhaps below and right.
      changes: (h, w) luxels.
      sun: (h f, w f) share of the sun; (0, 0) where there is none.
      sunlight: (h, w, 3) exposed light of all of it.
      linear: (256,) reflectance.
      shown: values of 0 to 1, evenly.
    """
    one, half, most = np.float32(1), np.float32(0.5), np.float32(len(shown) - 1)
    step, white = one / np.float32(fineness), np.float32(1 / 25)
    last_row, last_column = light.shape[0] - 1, light.shape[1] - 1
    x = np.empty(3, np.float32)
    for row in range(changes.shape[0]):
        for column in range(changes.shape[1]):
            if not changes[row, column]:
                continue
            for i in range(row * fineness, (row + 1) * fineness):
                v = min(
                    max((np.float32(i) + half) * step - half + np.float32(margin[0]), np.float32(0)),
                    np.float32(last_row),
                )
                top = min(int(v), last_row)
                bottom, down = min(top + 1, last_row), v - np.float32(top)
                for j in range(column * fineness, (column + 1) * fineness):
                    u = (np.float32(j) + half) * step - half + np.float32(margin[1])
                    u = min(max(u, np.float32(0)), np.float32(last_column))
                    left = min(int(u), last_column)
                    right, across = min(left + 1, last_column), u - np.float32(left)
                    share = sun[i, j] if len(sun) else np.float32(0)
                    for c in range(3):
                        above = light[top, left, c] * (one - across) + light[top, right, c] * across
                        below = light[bottom, left, c] * (one - across) + light[bottom, right, c] * across
                        e = above * (one - down) + below * down + share * sunlight[row, column, c]
                        x[c] = linear[albedo[i, j, c]] * e
                    y = np.float32(0.2126) * x[0] + np.float32(0.7152) * x[1] + np.float32(0.0722) * x[2]
                    bright = (one + y * white) / (one + y)
                    for c in range(3):
                        mixed = half * (min(x[c] * bright, one) + x[c] * (one + x[c] * white) / (one + x[c]))
                        picture[i, j, c] = shown[int(min(max(mixed, np.float32(0)), one) * most + half)]
