"""What a ground is built of, in numbers: the same measures for terrainkit and for other works."""

from itertools import pairwise

import numpy as np

LEVEL = 1e-3
"""Height difference within level ground [m]; heights of other works are stored in whole 5 mm."""


def runs(line, cell, level=LEVEL):
    """Return the lengths [m] and the heights of the level parts of a line of samples."""
    edges = np.flatnonzero(np.abs(np.diff(line)) > level) + 1
    bounds = [0, *edges.tolist(), len(line)]
    lengths = [(end - start) * cell for start, end in pairwise(bounds)]
    return lengths, [float(line[start]) for start in bounds[:-1]]


def around_center(grounds, cell):
    """Return the numbers of ground that is the same on all four sides of a platform."""
    line = grounds[0][:, grounds[0].shape[1] // 2]
    lengths, heights = runs(line, cell)
    middle = int(np.searchsorted(np.cumsum(lengths), len(line) // 2 * cell + cell / 2))
    changes = np.abs(np.diff(heights[: middle + 1]))
    return {
        "edge": lengths[0],
        "rises": middle,
        "rise": float(changes.max(initial=0.0)),
        "tread": max(lengths[1:middle], default=0.0),
        "platform": lengths[middle],
        "top": heights[middle] - heights[0],
    }


def slope(grounds, cell):
    """Return the numbers of slopes around a platform, along their middle and at its corners."""
    ground = grounds[0]
    line = ground[:, ground.shape[1] // 2]
    half = line[: len(line) // 2 + 1]
    changes = np.abs(np.diff(half))
    is_top = np.abs(ground - ground[ground.shape[0] // 2, ground.shape[1] // 2]) < 4 * LEVEL
    return {
        "edge": runs(line, cell, LEVEL / 10)[0][0] if changes.any() else 0.0,
        "grade": float(np.median(changes[changes > LEVEL / 10])) / cell if changes.any() else 0.0,
        "platform": int(is_top[:, ground.shape[1] // 2].sum()) * cell,
        "platform_diagonal": int(np.diag(is_top).sum()) * cell,
        "top": float(line[len(line) // 2] - line[0]),
    }


def field(grounds, cell):
    """Return the numbers of random heights around a platform."""
    grounds = np.array(grounds)
    middle = np.array(grounds.shape[1:]) // 2
    is_level = np.abs(grounds) < LEVEL
    half = 0
    while half < middle.min():
        block = tuple(slice(center - half - 1, center + half + 1) for center in middle)
        if not is_level.all(axis=0)[block].all():
            break
        half += 1
    sides = []
    for line in grounds[:, 1:-1].reshape(-1, grounds.shape[2]):
        lengths, heights = runs(line, cell)
        pairs = list(zip(lengths, heights, strict=True))
        sides += [length for length, height in pairs[1:-1] if abs(height) > LEVEL]
    return {
        "low": float(grounds.min()),
        "high": float(grounds.max()),
        "level": float(is_level.mean()),
        "platform": 2 * half * cell,
        "side": float(np.median(sides)) if sides else 0.0,
    }


def stones(grounds, cell):
    """Return the numbers of stones over holes: sizes along x and y, heights, depth, platform."""
    sides, gaps = [], []
    tops = np.concatenate([ground[ground > -0.5] for ground in grounds])
    for ground in grounds:
        for line in [*ground, *ground.T]:
            is_hole = line < -0.5
            edges = np.flatnonzero(np.diff(is_hole)) + 1
            for start, end in pairwise(edges.tolist()):
                (gaps if is_hole[start] else sides).append((end - start) * cell)
    numbers = field(grounds, cell)
    return {
        "stone": float(np.median(sides)) if sides else 0.0,
        "gap": float(np.median(gaps)) if gaps else 0.0,
        "low": float(tops.min()),
        "high": float(tops.max()),
        "depth": -numbers["low"],
        "holes": float((np.array(grounds) < -0.5).mean()),
        "platform": numbers["platform"],
    }


def lane(grounds, cell):
    """Return the numbers of obstacles in a row along x: each is [smallest, largest]."""
    starts, lengths, pitches, heights, widths, counts, strips = [], [], [], [], [], [], []
    for ground in grounds:
        middle = ground.shape[1] // 2
        is_off = np.abs(ground[:, middle]) > 0.02
        is_off[[0, -1]] = False
        edges = (np.flatnonzero(np.diff(is_off)) + 1).reshape(-1, 2)
        centers = edges.mean(axis=1) * cell
        starts.append(edges[0, 0] * cell)
        counts.append(len(edges))
        lengths += ((edges[:, 1] - edges[:, 0]) * cell).tolist()
        pitches += np.diff(centers).tolist()
        for end, start in zip(edges[:-1, 1].tolist(), edges[1:, 0].tolist(), strict=True):
            strips.append(int((np.abs(ground[(start + end) // 2]) < LEVEL).sum()) * cell)
        for start, end in edges.tolist():
            across = ground[(start + end) // 2]
            heights.append(float(across[middle]))
            widths.append(int((np.abs(across - across[middle]) < LEVEL).sum()) * cell)
    names = "start", "number", "length", "pitch", "height", "width", "strip"
    values = starts, counts, lengths, pitches, heights, widths, strips
    return {name: [min(each), max(each)] for name, each in zip(names, values, strict=True) if each}


def stairs(grounds, cell):
    """Return the numbers of steps in a row along x."""
    changes, treads = [], []
    for ground in grounds:
        lengths, heights = runs(ground[1:-1, ground.shape[1] // 2], cell)
        changes.append(np.diff(heights))
        treads += lengths[1:-1]
    return {
        "up": int(min((each > 0).sum() for each in changes)),
        "down": int(min((each < 0).sum() for each in changes)),
        "rise": float(np.abs(np.concatenate(changes)).max(initial=0.0)),
        "top": float(max(np.cumsum(each).max(initial=0.0) for each in changes)),
        "tread": [min(treads), max(treads)] if treads else [0.0, 0.0],
    }


def ramps(grounds, cell):
    """Return the numbers of ramps that tilt sideways over a pit, left and right in turn."""
    names = "number", "length", "pitch", "top", "width", "offset", "depth"
    values = {name: [] for name in names}
    for ground in grounds:
        pit = float(ground.min())
        middle = ground.shape[1] // 2
        centers = []
        for side in (-1, 1):
            line = middle + side * round(0.45 / cell)
            edges = np.flatnonzero(np.diff(ground[:, line] > pit / 2)) + 1
            edges = edges[edges < len(ground) - 2]
            edges = edges[1 : 1 + (len(edges) - 1) // 2 * 2].reshape(-1, 2)
            for start, end in edges.tolist():
                across = ground[(start + end) // 2] > pit / 2
                first = line - np.flatnonzero(~across[line::-1])[0] + 1
                last = line + np.flatnonzero(~across[line:])[0]
                values["length"].append((end - start) * cell)
                values["top"].append(float(np.abs(ground[(start + end) // 2, first:last]).max()))
                values["width"].append(int(last - first) * cell)
                values["offset"].append(float(abs((first + last) / 2 - middle)) * cell)
                centers.append((start + end) / 2 * cell)
        values["number"].append(len(centers))
        values["depth"].append(-pit)
        values["pitch"] += np.diff(np.sort(centers)).tolist()
    return {name: [min(each), max(each)] for name, each in values.items() if each}


def bars(grounds, _):
    """Return the numbers of bars above a lane: grounds with the corners of the bars."""
    corners = np.array([each for _, boxes in grounds for each in boxes])
    numbers = {"number": len(corners) / len(grounds)}
    numbers["clearance"] = float(corners[:, 0, 2].min())
    sizes = corners[:, 1] - corners[:, 0]
    numbers["length"] = [float(sizes[:, 0].min()), float(sizes[:, 0].max())]
    numbers["thickness"] = float(sizes[:, 2].max())
    return numbers


def slits(grounds, cell):
    """Return the numbers of walls across a lane with an opening."""
    lengths, openings, tops = [], [], []
    for ground in grounds:
        is_wall = (ground > 0.1).any(axis=1)
        edges = (np.flatnonzero(np.diff(is_wall)) + 1).reshape(-1, 2)
        lengths += ((edges[:, 1] - edges[:, 0]) * cell).tolist()
        for start, end in edges.tolist():
            is_open = ground[(start + end) // 2] < 0.1
            middle = len(is_open) // 2
            left = middle - 1 - np.flatnonzero(~is_open[:middle])[-1]
            right = np.flatnonzero(~is_open[middle:])[0]
            openings.append(float(left + right) * cell)
            tops.append(float(ground[(start + end) // 2].max()))
    numbers = {"opening": [min(openings), max(openings)], "length": [min(lengths), max(lengths)]}
    return numbers | {"top": max(tops)}


ALL = (around_center, slope, field, stones, lane, stairs, ramps, bars, slits)
MEASURES = {each.__name__: each for each in ALL}


def rounded(numbers):
    """Return numbers in whole millimeters."""
    return {key: np.round(value, 3).tolist() for key, value in numbers.items()}
