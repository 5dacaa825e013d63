"""Direct solution of five-point systems on an image, by nested dissection.

The image is cut into cells with lines of pixels (separators) between them. The pixels of all cells
are eliminated at once, as a batch of small dense systems; then neighbouring cells are merged by
eliminating the separator between them, all pairs at once, until one cell is left. That takes about
10 n^3 operations for n x n pixels, most of them in large matrix products, whatever the coefficients
are: neither their range nor their asymmetry matters, as it would to an iteration.

A cell of h x w pixels has four sides, in the order top, bottom (w pixels each), left, right (h
each), which are separators; with five-point links the corners between the sides do not matter.
"""

from collections.abc import Iterator
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

_PITCHES = range(4, 10)  # pixels of a cell and one separator: few steps, yet small matrices


class FivePoint(NamedTuple):
    """Coefficients of a system, float64 (N, H, W) each.

    The row of pixel p reads `centre(p) t(p) + up(p) t(above p) + down(p) t(below p) +
    left(p) t(left of p) + right(p) t(right of p)`; links over the border of the image are 0.
    """

    centre: Tensor
    up: Tensor
    down: Tensor
    left: Tensor
    right: Tensor

    def apply(self, t: Tensor) -> Tensor:
        """The left-hand side for `t`, float64 (N, H, W)."""
        answer = self.centre * t
        answer[:, 1:] += self.up[:, 1:] * t[:, :-1]
        answer[:, :-1] += self.down[:, :-1] * t[:, 1:]
        answer[..., 1:] += self.left[..., 1:] * t[..., :-1]
        answer[..., :-1] += self.right[..., :-1] * t[..., 1:]
        return answer

    def transpose(self) -> "FivePoint":
        """The same system with rows and columns of the image exchanged."""
        order = (self.centre, self.left, self.right, self.up, self.down)
        return FivePoint(*(part.transpose(1, 2) for part in order))


class _Cells(NamedTuple):
    """A level of the dissection: `rows` x `columns` cells of `height` x `width` pixels."""

    rows: int
    columns: int
    height: int
    width: int

    @property
    def pitches(self) -> tuple[int, int]:
        return self.height + 1, self.width + 1

    def merged(self) -> Iterator[tuple[int, "_Cells"]]:
        """The later levels, each with the axis of the merge (0 stacks rows, 1 joins columns)."""
        cells = self
        while cells.rows * cells.columns > 1:
            join = cells.rows == 1 or (cells.columns > 1 and cells.width <= cells.height)
            if join:
                cells = cells._replace(columns=cells.columns // 2, width=2 * cells.width + 1)
            else:
                cells = cells._replace(rows=cells.rows // 2, height=2 * cells.height + 1)
            yield int(join), cells


def solve(system: FivePoint, target: Tensor) -> Tensor:
    """Solve `system.apply(t) = target` for t, float64 (N, H, W)."""
    height, width = target.shape[1:]
    (rows, high), (columns, wide) = _divide(height), _divide(width)
    first = _Cells(rows, columns, high - 1, wide - 1)
    # One more row and column before the image, so that every cell has four sides; pixels beyond
    # the image are unknowns that nothing links to.
    extra = (1, columns * wide - width, 1, rows * high - height)
    padded = FivePoint(
        F.pad(system.centre, extra, value=1.0), *(F.pad(part, extra) for part in system[1:])
    )
    t = F.pad(target, extra)
    solution, schur = _start(padded, t, first)
    levels: list[tuple[int | None, _Cells, Tensor]] = [(None, first, solution)]
    cells = first
    for axis, merged in first.merged():
        solution, schur = _merge(padded, t, cells, merged, axis, schur)
        levels.append((axis, merged, solution))
        cells = merged
    _finish(padded, t, schur, height, width)
    for joined, cells, solution in reversed(levels):
        _substitute(t, cells, joined, solution)
    return t[:, 1 : height + 1, 1 : width + 1]


def _divide(size: int) -> tuple[int, int]:
    """Number of cells (a power of 2) and their pitch for a side, with the least waste."""
    choices = []
    for pitch in _PITCHES:
        count = 1
        while count * pitch < size:
            count *= 2
        choices.append((count * pitch, pitch, count))
    _, pitch, count = min(choices)
    return count, pitch


def _split(part: Tensor, axis: int, pitch: int) -> Tensor:
    """A view with the axis cut into blocks of `pitch`."""
    shape = part.shape
    return part.view(*shape[:axis], -1, pitch, *shape[axis + 1 :])


def _inner(part: Tensor, cells: _Cells) -> Tensor:
    """Values of the pixels of cells, (N, rows, columns, height, width)."""
    high, wide = cells.pitches
    blocks = _split(_split(part[:, 1:, 1:], 2, wide), 1, high)
    return blocks[:, :, : cells.height, :, : cells.width].transpose(2, 3)


def _sides(parts: tuple[Tensor, Tensor, Tensor, Tensor], cells: _Cells) -> list[Tensor]:
    """Values at the four sides, the k-th of `parts[k]`, (N, rows, columns, length)."""
    high, wide = cells.pitches
    top, bottom, left, right = parts
    horizontal = [
        _split(part[..., 1:], 2, wide)[..., : cells.width]
        for part in (top[:, :-1:high], bottom[:, high::high])
    ]
    vertical = [
        _split(part[:, 1:], 1, high)[:, :, : cells.height].transpose(2, 3)
        for part in (left[..., :-1:wide], right[..., wide::wide])
    ]
    return horizontal + vertical


def _start(system: FivePoint, target: Tensor, cells: _Cells) -> tuple[Tensor, Tensor]:
    """Eliminate the pixels of the first cells; gives their solution and what the sides get."""
    height, width = cells.height, cells.width
    index = torch.arange(height * width).view(height, width)
    size, border = height * width, 2 * (height + width)
    centre, up, down, left, right = (_inner(part, cells) for part in system)
    batch = centre.shape[:3]
    inner = centre.new_zeros(*batch, size, size)
    inner[..., index, index] = centre
    inner[..., index[1:], index[:-1]] = up[..., 1:, :]
    inner[..., index[:-1], index[1:]] = down[..., :-1, :]
    inner[..., index[:, 1:], index[:, :-1]] = left[..., 1:]
    inner[..., index[:, :-1], index[:, 1:]] = right[..., :-1]
    beside = torch.cat([index[0], index[-1], index[:, 0], index[:, -1]])
    links = torch.cat([up[..., 0, :], down[..., -1, :], left[..., 0], right[..., -1]], dim=-1)
    outer = centre.new_zeros(*batch, size, border + 1)
    outer[..., beside, torch.arange(border)] = links
    outer[..., -1] = _inner(target, cells).flatten(-2)
    solution = torch.linalg.solve_ex(inner, outer).result
    back = torch.cat(_sides((system.down, system.up, system.right, system.left), cells), dim=-1)
    return solution, -back.unsqueeze(-1) * solution[..., beside, :]


def _merge(
    system: FivePoint, target: Tensor, cells: _Cells, merged: _Cells, axis: int, schur: Tensor
) -> tuple[Tensor, Tensor]:
    """Eliminate the separators between pairs of cells."""
    length = cells.height if axis == 1 else cells.width
    starts = _offsets(merged, length)
    size = starts[-1]
    batch = (target.shape[0], merged.rows, merged.columns)
    front = schur.new_zeros(*batch, size, size + 1)
    pairs = (
        (schur[:, :, 0::2], schur[:, :, 1::2]) if axis == 1 else (schur[:, 0::2], schur[:, 1::2])
    )
    for second, part in enumerate(pairs):
        _add(front, part, cells, _places(cells, starts, axis, second))
    corners = (starts[0] + cells.width, starts[1] + cells.width)
    if axis == 0:
        corners = (starts[2] + cells.height, starts[3] + cells.height)
    _add_separator(front, system, target, cells, axis, corners)
    solution = torch.linalg.solve_ex(
        front[..., :length, :length], front[..., :length, length:]
    ).result
    flat = front.flatten(0, 2)
    rest = torch.baddbmm(
        flat[:, length:, length:], flat[:, length:, :length], solution.flatten(0, 2), alpha=-1
    )
    return solution, rest.view(*batch, *rest.shape[1:])


def _offsets(cells: _Cells, start: int) -> list[int]:
    """Where the four sides begin and end when they are laid out from `start`."""
    ends = [start]
    for length in (cells.width, cells.width, cells.height, cells.height):
        ends.append(ends[-1] + length)
    return ends


def _places(cells: _Cells, starts: list[int], axis: int, second: int) -> list[int]:
    """Where the four sides of the first or second cell of a pair lie; the shared one lies at 0."""
    places = list(starts[:4])
    if axis == 1:
        places[2 if second else 3] = 0
        places[0] += second * (cells.width + 1)
        places[1] += second * (cells.width + 1)
    else:
        places[0 if second else 1] = 0
        places[2] += second * (cells.height + 1)
        places[3] += second * (cells.height + 1)
    return places


def _add(front: Tensor, part: Tensor, cells: _Cells, places: list[int]) -> None:
    own = _offsets(cells, 0)
    for i in range(4):
        rows = slice(own[i], own[i + 1])
        to_rows = slice(places[i], places[i] + own[i + 1] - own[i])
        front[..., to_rows, -1] += part[..., rows, -1]
        for j in range(4):
            to_columns = slice(places[j], places[j] + own[j + 1] - own[j])
            front[..., to_rows, to_columns] += part[..., rows, own[j] : own[j + 1]]


def _add_separator(
    front: Tensor,
    system: FivePoint,
    target: Tensor,
    cells: _Cells,
    axis: int,
    corners: tuple[int, int],
) -> None:
    """Add the equations of the separators between pairs, and their links to both corners."""
    if axis == 0:
        system, target = system.transpose(), target.transpose(1, 2)
    high, wide = cells.pitches if axis == 1 else cells.pitches[::-1]

    def line(part: Tensor) -> Tensor:
        columns = _split(part[:, 1:, wide :: 2 * wide], 1, high)
        return turn(columns[:, :, :-1].transpose(2, 3))

    def turn(values: Tensor) -> Tensor:
        return values if axis == 1 else values.transpose(1, 2)

    length = high - 1
    index = torch.arange(length)
    up, down = line(system.up), line(system.down)
    front[..., index, index] += line(system.centre)
    front[..., index[1:], index[:-1]] += up[..., 1:]
    front[..., index[:-1], index[1:]] += down[..., :-1]
    front[..., :length, -1] += line(target)
    first, last = corners
    front[..., 0, first] += up[..., 0]
    front[..., length - 1, last] += down[..., -1]
    front[..., first, 0] += turn(system.down[:, :-1:high, wide :: 2 * wide])
    front[..., last, length - 1] += turn(system.up[:, high::high, wide :: 2 * wide])


def _finish(system: FivePoint, t: Tensor, schur: Tensor, height: int, width: int) -> None:
    """Solve for the last row and column of the grid, where they are pixels of the image."""
    rows, columns = t.shape[1] - 1, t.shape[2] - 1
    bottom = torch.arange(width if rows == height else 0)[: columns - 1]
    right = torch.arange(height if columns == width else 0)[: rows - 1]
    corner = int(rows == height and columns == width)
    size = len(bottom) + len(right) + corner
    if not size:
        return
    places = torch.cat([columns - 1 + bottom, 2 * (columns - 1) + rows - 1 + right])
    dense = t.new_zeros(t.shape[0], size, size + 1)
    known = len(places)
    dense[:, :known, :known] = schur[:, 0, 0][:, places[:, None], places]
    dense[:, :known, -1] = schur[:, 0, 0][:, places, -1]
    y = torch.cat([torch.full_like(bottom, rows), 1 + right, torch.full((corner,), rows)])
    x = torch.cat([1 + bottom, torch.full_like(right, columns), torch.full((corner,), columns)])
    every = torch.arange(size)
    dense[:, every, every] += system.centre[:, y, x]
    dense[:, every, -1] += t[:, y, x]
    for part, dy, dx in (
        (system.up, -1, 0),
        (system.down, 1, 0),
        (system.left, 0, -1),
        (system.right, 0, 1),
    ):
        i, j = torch.nonzero((y[:, None] + dy == y) & (x[:, None] + dx == x), as_tuple=True)
        dense[:, i, j] += part[:, y[i], x[i]]
    t[:, y, x] = torch.linalg.solve_ex(dense[..., :-1], dense[..., -1:]).result[..., 0]


def _substitute(t: Tensor, cells: _Cells, axis: int | None, solution: Tensor) -> None:
    """Write what a level eliminated into `t`, whose values at the sides of its cells are known."""
    known = torch.cat(_sides((t, t, t, t), cells), dim=-1)
    value = solution[..., -1] - (solution[..., :-1] @ known.unsqueeze(-1))[..., 0]
    if axis is None:
        _inner(t, cells).copy_(value.view(*value.shape[:-1], cells.height, cells.width))
        return
    high, wide = cells.pitches
    if axis == 1:
        middle = _split(t[:, 1:, wide // 2 :: wide], 1, high)
        middle[:, :, :-1].copy_(value.transpose(2, 3))
    else:
        middle = _split(t[:, high // 2 :: high, 1:], 2, wide)
        middle[..., :-1].copy_(value)
