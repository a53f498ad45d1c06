#!/usr/bin/env python3
"""Whether two skeletons have the same sheets, seams and beams at the same places.

    compare_skeletons.py A/skeleton.ply B/skeleton.ply [TOLERANCE]

A sheet is a set of quads joined over edges of two quads; a seam is a chain of edges of three or more quads; a beam is a chain of
beam edges. Two of them match where their middles (centres of area or of length) are nearer than TOLERANCE, a share of the
skeleton's diagonal (default 0.05); each is matched once, nearest pairs first. Prints counts and what has no match; the exit
code is 0 when everything has one, else 1.
"""
import sys
from collections import defaultdict


def read(path):
    """Points, quads and beam edges of a skeleton.ply as grassfire writes it (ASCII)."""
    with open(path) as lines:
        counts = {}
        for line in lines:
            words = line.split()
            if words[0] == "element":
                counts[words[1]] = int(words[2])
            if words[0] == "end_header":
                break
        points = [[float(x) for x in next(lines).split()[:3]] for _ in range(counts["vertex"])]
        quads = [[int(x) for x in next(lines).split()[1:]] for _ in range(counts.get("face", 0))]
        beams = [[int(x) for x in next(lines).split()[:2]] for _ in range(counts.get("edge", 0))]
    return points, quads, beams


def groups(count, pairs):
    """Sets of 0..count that the pairs join."""
    parent = list(range(count))

    def root(i):
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    for a, b in pairs:
        parent[root(a)] = root(b)
    sets = defaultdict(list)
    for i in range(count):
        sets[root(i)].append(i)
    return list(sets.values())


def subtract(a, b):
    return [x - y for x, y in zip(a, b)]


def length(a):
    return sum(x * x for x in a) ** 0.5


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def middle(weighted):
    """Mean of places, each with a weight; the whole weight beside it."""
    whole = sum(w for _, w in weighted)
    return [sum(p[k] * w for p, w in weighted) / max(whole, 1e-300) for k in range(3)], whole


def chains(points, edges, ends):
    """Middles and lengths of chains of edges; a chain ends at points in `ends` and where it branches."""
    at = defaultdict(list)
    for i, edge in enumerate(edges):
        for p in edge:
            at[p].append(i)
    joined = [tuple(e) for p, e in at.items() if len(e) == 2 and p not in ends]

    def weighted(i):
        a, b = (points[p] for p in edges[i])
        return [(x + y) / 2 for x, y in zip(a, b)], length(subtract(a, b))

    return [middle([weighted(i) for i in chain]) for chain in groups(len(edges), joined)]


def features(path):
    points, quads, beams = read(path)
    around = defaultdict(list)
    for i, quad in enumerate(quads):
        for k, p in enumerate(quad):
            around[tuple(sorted((p, quad[k - 1])))].append(i)
    joined = [tuple(q) for q in around.values() if len(q) == 2]

    def weighted(i):
        a, b, c, d = (points[p] for p in quads[i])
        return [sum(x) / 4 for x in zip(a, b, c, d)], 0.5 * length(cross(subtract(c, a), subtract(d, b)))

    seams = [edge for edge, q in around.items() if len(q) > 2]
    on_quads = {p for quad in quads for p in quad}
    found = {
        "sheets": [middle([weighted(i) for i in sheet]) for sheet in groups(len(quads), joined)],
        "seams": chains(points, seams, {p for beam in beams for p in beam}),
        "beams": chains(points, beams, on_quads),
    }
    diagonal = length([max(p[k] for p in points) - min(p[k] for p in points) for k in range(3)])
    return found, diagonal


def compare(first, second, tolerance):
    """Pairs whose middles are nearer than the tolerance, and what is left of both."""
    near = sorted((length(subtract(a[0], b[0])), i, j) for i, a in enumerate(first) for j, b in enumerate(second))
    left, right = set(range(len(first))), set(range(len(second)))
    for distance, i, j in near:
        if distance <= tolerance and i in left and j in right:
            left.remove(i)
            right.remove(j)
    return [first[i] for i in sorted(left)], [second[j] for j in sorted(right)]


def main():
    (a, diagonal), (b, _) = features(sys.argv[1]), features(sys.argv[2])
    tolerance = (float(sys.argv[3]) if len(sys.argv) > 3 else 0.05) * diagonal
    same = True
    for kind in ("sheets", "seams", "beams"):
        only_first, only_second = compare(a[kind], b[kind], tolerance)
        same &= not only_first and not only_second
        print(f"{kind}: {len(a[kind])} and {len(b[kind])}, {len(a[kind]) - len(only_first)} match")
        for name, rest in (("first", only_first), ("second", only_second)):
            for place, size in rest:
                print(f"  only in the {name}: {size:.1f} at ({', '.join(f'{x:.1f}' for x in place)})")
    sys.exit(0 if same else 1)


main()
