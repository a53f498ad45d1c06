#!/usr/bin/env python3
"""The cantilever that optimizers are compared on (48 x 24 x 24 unit cubes, volume fraction 0.25, filter radius sqrt 3, penalty 3,
optimality criteria), by pyMOTO and by grassfire, one thread each, in one run.

    compare.py GRASSFIRE CASE SCALE ITERATIONS

SCALE divides the edge of the voxels: 2 makes 96 x 48 x 48. Prints a table: compliance by iteration, processor seconds an
iteration (mean of the second and third), peak memory.
"""
import json
import os
import resource
import subprocess
import sys
import tempfile
import time


def pymoto(scale, iterations):
    import numpy as np
    import pymoto as pym

    domain = pym.VoxelDomain(48 * scale, 24 * scale, 24 * scale)
    x = pym.Signal("x", state=np.full(domain.nel, 0.25))
    left = domain.nodes[0, :, :].flatten()
    fixed = domain.get_dofnumber(left, np.arange(3)).flatten()
    edge = domain.nodes[-1, 0, :].flatten()
    force = np.zeros(3 * domain.nnodes)
    force[3 * edge + 1] = -1.0 / edge.size
    seconds, values = [], []
    with pym.Network() as network:
        y = pym.FilterConv(domain, radius=3**0.5)(x)
        e = pym.MathExpression("1e-6 + (1 - 1e-6) * inp0^3")(y)
        k = pym.AssembleStiffness(domain, bc=fixed)(e)
        levels, sub = [], domain
        while all(n % 2 == 0 for n in (sub.nelx, sub.nely, sub.nelz)) and sub.nely > 6:
            levels.append(pym.solvers.GeometricMultigrid(sub))
            if len(levels) > 1:
                levels[-2].inner_level = levels[-1]
            sub = levels[-1].sub_domain
        solver = pym.solvers.CG(preconditioner=levels[0], tol=1e-5)
        u = pym.LinSolve(symmetric=True, positive_definite=True, solver=solver)(k, force)
        c = pym.EinSum("i,i->")(u, force)
    optimizer = pym.OC([x], c, function=network, move=0.2, l1l2tol=1e-10, verbosity=0)
    state = None
    for _ in range(iterations):
        begin = time.process_time()
        state, value, _ = optimizer.step(state)
        seconds.append(time.process_time() - begin)
        values.append(float(np.ravel(value)[0]))
    return values, seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def grassfire(program, case, scale, iterations):
    with tempfile.TemporaryDirectory() as out:
        command = [program, "optimize", case, "-o", out, "-q", "--threads", "1", "--set", f"grid.h={1 / scale}",
                   "--set", f"optimize.filter_radius={3**0.5 / scale}", "--set", f"optimize.max_iterations={iterations}"]
        subprocess.run(command, check=False)
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        with open(os.path.join(out, "history.json")) as f:
            history = json.load(f)
    # The same beam of smaller voxels is stiffer by their edge than one of as many unit cubes.
    return [r["compliance"] / scale for r in history], [r["seconds"] for r in history], peak


def main():
    program, case, scale, iterations = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    # First, because a child counts the memory of its parent as its own peak.
    ours = grassfire(program, case, scale, iterations)
    theirs = pymoto(scale, iterations)
    print(f"{48 * scale} x {24 * scale} x {24 * scale} voxels, {iterations} iterations, one thread")
    print("| code | compliance 1 | 2 | 3 | last | CPU s, iterations 2 and 3, mean | all | peak MB |")
    print("|---|---|---|---|---|---|---|---|")
    for name, (values, seconds, memory) in (("pyMOTO", theirs), ("grassfire", ours)):
        first = " | ".join(f"{v:.6f}" for v in values[:3])
        mean = sum(seconds[1:3]) / 2
        print(f"| {name} | {first} | {values[-1]:.6f} | {mean:.3f} | {sum(seconds):.2f} | {memory:.0f} |")
    ratio = sum(ours[1][1:3]) / sum(theirs[1][1:3])
    differences = [abs(a / b - 1) for a, b in zip(ours[0], theirs[0])]
    print(f"ratio of CPU seconds, iterations 2 and 3: {ratio:.3f}")
    print(f"largest relative difference of the compliance: {max(differences):.1e}, first {differences[0]:.1e}, last {differences[-1]:.1e}")


if __name__ == "__main__":
    main()
