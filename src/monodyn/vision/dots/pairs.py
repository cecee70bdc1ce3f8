"""Rows and columns of a table of costs brought into pairs, so that all pairs together cost least."""

from __future__ import annotations

import numpy as np


def cheapest_pairs(cost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which row goes with which column; as many pairs as there are of what is fewer.

    Args:
        cost: Cost of each pair, finite, (row, column).

    Returns:
        Rows in order, and the column of each, (2, row) in all, or (2, column) where there are fewer.

    Source:
        The Hungarian method by shortest augmenting paths: Jonker and Volgenant, A shortest augmenting path
        algorithm for dense and sparse linear assignment problems, 1987.
    """
    if cost.shape[0] > cost.shape[1]:
        columns, rows = cheapest_pairs(cost.T)
        order = np.argsort(rows)
        return rows[order], columns[order]
    count, width = cost.shape
    price, paid = np.zeros(count), np.zeros(width)
    owner = np.full(width, -1)
    for row in range(count):
        # Grow a tree of least reduced cost from this row until it meets a column that nobody owns; the prices
        # keep all reduced costs of the tree at zero, and no other one below.
        short, before, done = np.full(width, np.inf), np.full(width, -1), np.zeros(width, dtype=bool)
        at, last = row, -1
        while True:
            reduced = cost[at] - price[at] - paid
            better = ~done & (reduced < short)
            short[better], before[better] = reduced[better], last
            column = int(np.argmin(np.where(done, np.inf, short)))
            step = short[column]
            price[row] += step
            price[owner[done]] += step
            paid[done] -= step
            short[~done] -= step
            done[column], last, at = True, column, owner[column]
            if at < 0:
                break
        # every column on the way back goes to the row before it
        while last >= 0:
            owner[last] = row if before[last] < 0 else owner[before[last]]
            last = before[last]
    rows = np.arange(count)
    columns = np.argsort(np.where(owner < 0, count, owner), kind="stable")[:count]
    return rows, columns
