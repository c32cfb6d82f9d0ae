"""Translucent panels as an image, sorted by depth in every pixel.

Surfaces that cut each other come out right, and neighbouring panels show no seams: a pixel on the
edge of two triangles belongs to one of them.
"""

from __future__ import annotations

import numpy as np

from duoglide.arrays import BoolArray, FloatArray


def paint_panels(
    corners: FloatArray, colours: FloatArray, extent: tuple[float, float, float, float], size: int
) -> FloatArray:
    """Paint quadrilaterals of the page.

    Args:
        corners: Corners: right, up and towards the eye, shape (n, 4, 3).
        colours: Red, green, blue, opacity from 0 to 1, shape (n, 4).
        extent: Left, right, bottom, top of the image on the page.
        size: Its greater side [pixels].

    Returns:
        Image of shape (rows, columns, 4), first row at the top, colours not premultiplied.
    """
    left, right, bottom, top = extent
    scale = size / max(right - left, top - bottom)
    shape = (max(int(scale * (top - bottom)), 1), max(int(scale * (right - left)), 1))
    page = np.stack(
        [(corners[..., 0] - left) * scale, (top - corners[..., 1]) * scale, corners[..., 2]],
        axis=-1,
    )
    parts = [
        (pixels, depths, np.full(pixels.size, number))
        for number, quad in enumerate(page)
        for triangle in (quad[[0, 1, 2]], quad[[0, 2, 3]])
        for pixels, depths in [_fragments(triangle, shape)]
    ]
    pixels, depths, owners = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort((depths, pixels))
    return _composed(pixels[order], colours[owners[order]], shape)


def _fragments(triangle: FloatArray, shape: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Return the pixels whose centres a triangle covers, as flat indices, and its depth there."""
    low = np.maximum(np.floor(triangle[:, :2].min(axis=0) - 0.5).astype(int), 0)
    high = np.minimum(np.ceil(triangle[:, :2].max(axis=0) + 0.5).astype(int), shape[::-1])
    if (low >= high).any():
        return np.empty(0, dtype=int), np.empty(0)
    x = np.arange(low[0], high[0]) + 0.5
    y = np.arange(low[1], high[1])[:, None] + 0.5
    rows, columns = np.nonzero(_inside(triangle[:, :2], x, y))
    flat = (rows + low[1]) * shape[1] + columns + low[0]
    (ux, uy, ud), (wx, wy, wd) = triangle[1] - triangle[0], triangle[2] - triangle[0]
    area = ux * wy - uy * wx
    if abs(area) < 1e-12:
        return np.empty(0, dtype=int), np.empty(0)
    dx, dy = x[columns] - triangle[0, 0], y[rows, 0] - triangle[0, 1]
    s, t = (dx * wy - dy * wx) / area, (ux * dy - uy * dx) / area
    return flat, triangle[0, 2] + s * ud + t * wd


def _inside(triangle: FloatArray, x: FloatArray, y: FloatArray) -> BoolArray:
    """Whether pixel centres lie in a triangle, by the signs of its edge functions."""
    a, b, c = triangle
    if (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) < 0.0:
        b, c = c, b
    inside = np.ones(np.broadcast_shapes(x.shape, y.shape), dtype=np.bool_)
    for p, q in ((a, b), (b, c), (c, a)):
        side = (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])
        owns = (q[1] - p[1], q[0] - p[0]) > (0.0, 0.0)  # of the two triangles at an edge one has it
        inside &= (side >= 0.0) if owns else (side > 0.0)
    return inside


def _composed(pixels: FloatArray, colours: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Lay fragments over each other, from back to front; they are sorted by pixel, then depth."""
    image = np.zeros((shape[0] * shape[1], 4))  # premultiplied
    first = np.flatnonzero(np.diff(pixels, prepend=-1))
    counts = np.diff(np.append(first, pixels.size))
    for layer in range(int(counts.max(initial=0))):
        at = first[counts > layer] + layer
        colour = colours[at]
        alpha = colour[:, 3:]
        source = np.concatenate([colour[:, :3], np.ones_like(alpha)], axis=1)
        image[pixels[at]] = image[pixels[at]] * (1.0 - alpha) + alpha * source
    opacity = image[:, 3:]
    image[:, :3] = np.divide(image[:, :3], opacity, out=image[:, :3], where=opacity > 0.0)
    return image.reshape(*shape, 4)
