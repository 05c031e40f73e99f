"""The same deck with smaller elements: quadrilaterals of eight nodes, each divided into equal ones."""

from __future__ import annotations

import re
from itertools import product

BLOCK = re.compile(r"^(?P<head>\*(?P<name>NODE|ELEMENT|NSET), (?P<rest>[^\n]*))\n(?P<data>[^*]*)", re.MULTILINE)
CORNERS, MIDDLES = ((0, 0), (2, 0), (2, 2), (0, 2)), ((1, 0), (2, 1), (1, 2), (0, 1))
EDGES = ((0, 4, 1), (1, 5, 2), (2, 6, 3), (3, 7, 0))


def refined(text: str, times: int) -> str:
    """Return a deck whose elements have sides of ``1/times`` the length; a set goes on along the edges that it has."""
    blocks = list(BLOCK.finditer(text))
    rows = [[line.split(",") for line in block["data"].splitlines()] for block in blocks]
    points, elements, sets = {}, [], {}
    for block, lines in zip(blocks, rows, strict=True):
        if block["name"] == "NODE":
            points |= {int(line[0]): (float(line[1]), float(line[2])) for line in lines}
        elif block["name"] == "ELEMENT":
            elements += [[int(word) for word in line[1:]] for line in lines]
        else:
            sets[block["head"]] = {int(word) for line in lines for word in line if word.strip()}
    places, numbers, cells = {}, {}, []
    members = {head: set() for head in sets}

    def number(at):
        key = tuple(round(value, 6) for value in at)
        places.setdefault(key, at)
        return numbers.setdefault(key, len(numbers) + 1)

    for element in elements:
        corners = [points[node] for node in element[:4]]

        def at(i, j, corners=corners):
            s, t = i / (2 * times), j / (2 * times)
            weights = (1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t
            return tuple(sum(w * corner[axis] for w, corner in zip(weights, corners, strict=True)) for axis in (0, 1))

        for j, i in product(range(times), repeat=2):
            cells.append([number(at(2 * i + a, 2 * j + b)) for a, b in (*CORNERS, *MIDDLES)])
        for first, middle, second in EDGES:
            ends = [tuple(times * step for step in CORNERS[corner]) for corner in (first, second)]
            for head, nodes in sets.items():
                if {element[first], element[middle], element[second]} <= nodes:
                    shares = [step / (2 * times) for step in range(2 * times + 1)]
                    along = [[a + share * (b - a) for a, b in zip(*ends, strict=True)] for share in shares]
                    members[head] |= {number(at(*each)) for each in along}

    def data(block):
        if block["name"] == "NODE":
            lines = [f"{numbers[key]}, {place[0]:.7g}, {place[1]:.7g}, 0." for key, place in places.items()]
        elif block["name"] == "ELEMENT":
            lines = [f"{index}, {', '.join(map(str, cell))}" for index, cell in enumerate(cells, start=1)]
        else:
            nodes = [str(node) for node in sorted(members[block["head"]])]
            lines = [", ".join(nodes[start : start + 12]) for start in range(0, len(nodes), 12)]
        return "\n".join([block["head"], *lines, ""])

    return BLOCK.sub(data, text)
