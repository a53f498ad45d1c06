#!/usr/bin/env python3
"""Quads of grassfire, Instant Meshes and QuadriFlow on the same surface and with the same number of quads, in one run.

    compare.py GRASSFIRE FACES PART...

Each part goes through `grassfire reconstruct`. The others get the very surface that our body follows (design_part.stl or,
where no bodies were cut out, proposal.stl), and our number of quads. Our control points count at their places on the limit
surface, and the quads of all three as flat pieces: quads, vertices whose valence is not four, deviation of corners from a
right angle, two-sided distance to the surface in voxels, faces that our spline stage makes of them (FACES, the example of that
name; before the union with non-design bodies), processor seconds (ours: the whole chain with its CAD solid).
"""
import json
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import defaultdict

import numpy as np
from scipy.spatial import cKDTree

# A quad is measured on so many pieces a side.
PIECES = 6
# Triangles whose centres are nearest are looked at: the pieces and the triangles of the surface are all of one size.
NEAREST = 12


def read_stl(path):
    """Points and triangles of a binary STL, equal corners joined."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    corners = np.fromfile(path, record, offset=84)["corners"].reshape(-1, 3)
    points, index = np.unique(corners, axis=0, return_inverse=True)
    triangles = index.reshape(-1, 3)
    return points.astype(float), triangles


def read_obj(path):
    points, faces = [], []
    with open(path) as lines:
        for line in lines:
            words = line.split()
            if words[:1] == ["v"]:
                points.append([float(x) for x in words[1:4]])
            elif words[:1] == ["f"]:
                faces.append([int(word.split("/")[0]) - 1 for word in words[1:]])
    return np.array(points), faces


def limit_points(points, quads):
    """Places of the control points on the Catmull-Clark limit surface."""
    around, diagonal = defaultdict(set), defaultdict(list)
    for quad in quads:
        for k, v in enumerate(quad):
            around[v] |= {quad[k - 1], quad[(k + 1) % 4]}
            diagonal[v].append(quad[(k + 2) % 4])
    out = points.copy()
    for v, edges in around.items():
        n = len(edges)
        out[v] = (n * n * points[v] + 4 * points[list(edges)].sum(0) + points[diagonal[v]].sum(0)) / (n * (n + 5))
    return out


def instant_meshes(points, triangles, quads):
    import pynanoinstantmeshes

    # It makes pure quads by splitting every face in the end, into four where it was a quad.
    points, faces = pynanoinstantmeshes.remesh(
        points.astype(np.float32), triangles.astype(np.uint32), -1, face_count=quads // 4, deterministic=True)
    return np.array(points, float), [[int(v) for v in dict.fromkeys(f)] for f in faces]


def quadriflow(points, triangles, quads):
    from pyQuadriFlow.pyQuadriFlow import pyquadriflow

    mesh = pyquadriflow(quads, 0, points.tolist(), triangles.tolist(), False, False, False, False, False)
    return np.array(mesh["vertices"], float), [list(f) for f in mesh["faces"]]


def peer(name, points, triangles, quads, answers):
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    begin = time.process_time()
    try:
        mesh = {"Instant Meshes": instant_meshes, "QuadriFlow": quadriflow}[name](points, triangles, quads)
        answers.put((*mesh, time.process_time() - begin))
    except Exception as error:  # another's program: whatever it raises is its result
        answers.put(str(error))


def in_its_own_process(name, points, triangles, quads):
    """A peer that crashes or hangs takes nothing else with it."""
    answers = multiprocessing.Queue()
    process = multiprocessing.Process(target=peer, args=(name, points, triangles, quads, answers))
    process.start()
    try:
        answer = answers.get(timeout=900)
    except Exception:
        answer = "no answer"
        process.kill()
    process.join()
    return answer


def ours(program, part, out):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [program, "reconstruct", part, "-o", out, "-q", "--set", "report.pictures=false"]
    subprocess.run(command, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def pieces(points, faces):
    """Small triangles of flat-cornered faces: quads bilinear, others as fans from their middles."""
    s = np.linspace(0, 1, PIECES + 1)
    u, v = np.meshgrid(s, s, indexing="ij")
    triangles = []
    for face in faces:
        p = points[face]
        if len(face) == 4:
            fours = [p]
        else:
            middle, edges = p.mean(0), 0.5 * (p + np.roll(p, -1, 0))
            fours = [np.array([p[k], edges[k], middle, edges[k - 1]]) for k in range(len(face))]
        for a, b, c, d in fours:
            grid = sum(w[..., None] * x for w, x in [((1 - u) * (1 - v), a), (u * (1 - v), b), (u * v, c), ((1 - u) * v, d)])
            corners = [grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]]
            for k in (1, 2):
                triangles.append(np.stack([corners[0], corners[k], corners[k + 1]], 2).reshape(-1, 3, 3))
    return np.concatenate(triangles)


def to_segment(p, a, b):
    along = b - a
    s = np.einsum("...i,...i", p - a, along) / np.maximum(np.einsum("...i,...i", along, along), 1e-300)
    return np.linalg.norm(p - a - np.clip(s, 0, 1)[..., None] * along, axis=-1)


def distances(queries, triangles):
    """Distance of every point to the nearest of the triangles, by the triangles with the nearest centres."""
    _, near = cKDTree(triangles.mean(1)).query(queries, NEAREST)
    a, b, c = (triangles[near, k] for k in range(3))
    p = queries[:, None, :]
    least = np.minimum(np.minimum(to_segment(p, a, b), to_segment(p, b, c)), to_segment(p, c, a))
    normal = np.cross(b - a, c - a)
    square = np.maximum(np.einsum("...i,...i", normal, normal), 1e-300)
    inside = np.ones(least.shape, bool)
    for x, y in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("...i,...i", np.cross(y - x, p - x), normal) >= 0
    height = np.abs(np.einsum("...i,...i", p - a, normal)) / np.sqrt(square)
    return np.where(inside, np.minimum(height, least), least).min(1)


def cad_faces(program, points, faces):
    """Faces of the CAD solid that these quads give."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "quads.obj")
        with open(path, "w") as out:
            out.writelines(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points)
            out.writelines("f " + " ".join(str(v + 1) for v in face) + "\n" for face in faces)
        done = subprocess.run([program, path], check=False, capture_output=True, text=True, timeout=900)
    return done.stdout.strip() or "none"


def row(part, name, points, faces, surface, voxel, cad, seconds):
    valence = defaultdict(int)
    deviation = []
    for face in faces:
        p = points[face]
        for k, v in enumerate(face):
            valence[v] += 1
            x, y = p[k - 1] - p[k], p[(k + 1) % len(face)] - p[k]
            cosine = x @ y / max(np.linalg.norm(x) * np.linalg.norm(y), 1e-300)
            deviation.append(abs(np.degrees(np.arccos(np.clip(cosine, -1, 1))) - 90))
    irregular = sum(n != 4 for n in valence.values())
    small = pieces(points, faces)
    off = np.concatenate([distances(small.mean(1), surface), distances(surface.mean(1), small)]) / voxel
    others = sum(len(face) != 4 for face in faces)
    print(f"| {part} | {name} | {len(faces) - others} | {others} | {irregular} | {np.mean(deviation):.1f} "
          f"| {np.percentile(deviation, 95):.1f} | {np.sqrt(np.mean(off**2)):.2f} | {np.percentile(off, 95):.2f} "
          f"| {off.max():.1f} | {cad} | {seconds:.1f} |", flush=True)


def compare(program, faces, part):
    name = os.path.splitext(os.path.basename(part))[0]
    with tempfile.TemporaryDirectory() as out:
        seconds = ours(program, part, out)
        if not os.path.exists(os.path.join(out, "body.obj")):
            print(f"| {name} | grassfire | no body | | | | | | | | | |")
            return
        with open(os.path.join(out, "report.json")) as f:
            voxel = json.load(f)["remesh"]["voxel"]
        design = os.path.join(out, "design_part.stl")
        points, triangles = read_stl(design if os.path.exists(design) else os.path.join(out, "proposal.stl"))
        control, quads = read_obj(os.path.join(out, "body.obj"))
    surface = points[triangles]
    cad = cad_faces(faces, control, quads)
    row(name, "grassfire", limit_points(control, quads), quads, surface, voxel, cad, seconds)
    for other in ("Instant Meshes", "QuadriFlow"):
        answer = in_its_own_process(other, points, triangles, len(quads))
        if isinstance(answer, str):
            print(f"| {name} | {other} | {answer} | | | | | | | | | |", flush=True)
        else:
            cad = cad_faces(faces, answer[0], answer[1])
            row(name, other, answer[0], answer[1], surface, voxel, cad, answer[2])


def main():
    print("| part | program | quads | other faces | irregular vertices | corners, mean | p95 | rms | p95 | max | CAD faces | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    for part in sys.argv[3:]:
        compare(sys.argv[1], sys.argv[2], part)


main()
