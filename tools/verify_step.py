#!/usr/bin/env python3
"""Reads STEP files with two programs other than grassfire's own kernel and prints what they find.

    verify_step.py PART.step [...] [--volume MM3] [--genus N] [--solids N] [--mesh H]

Needs `pip install gmsh cadquery-ocp`. Prints one JSON line a file; exit code 1 when a check fails:
valid, closed, volumes of both readers equal to 1e-6, and volume, genus, number of solids as given.
`--mesh H` also makes a tetrahedral mesh of size H with gmsh.
"""
import argparse
import json
import sys


def read_ocp(path):
    from OCP.BRep import BRep_Tool
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID, TopAbs_VERTEX, TopAbs_WIRE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    reader = STEPControl_Reader()
    reader.ReadFile(path)
    reader.TransferRoots()
    shape = reader.OneShape()
    props = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, props, 1e-9, False, False)

    def distinct(kind, inside):
        found = {}
        at = TopExp_Explorer(inside, kind)
        while at.More():
            group = found.setdefault(hash(at.Current()), [])
            if not any(other.IsSame(at.Current()) for other, _ in group):
                group.append([at.Current(), 0])
            next(entry for entry in group if entry[0].IsSame(at.Current()))[1] += 1
            at.Next()
        return [entry for group in found.values() for entry in group]

    def count(kind):
        return len(distinct(kind, shape))

    to_edge = getattr(TopoDS, "Edge_s", None) or TopoDS.Edge
    # Uses by faces: the two sides of a closed surface's seam count as two.
    uses = {}
    for face, _ in distinct(TopAbs_FACE, shape):
        for edge, times in distinct(TopAbs_EDGE, face):
            group = uses.setdefault(hash(edge), [])
            entry = next((e for e in group if e[0].IsSame(edge)), None)
            if entry is None:
                group.append([edge, times])
            else:
                entry[1] += times
    edges = [entry for group in uses.values() for entry in group if not BRep_Tool.Degenerated_s(to_edge(entry[0]))]
    open_edges = sum(times != 2 for _, times in edges)
    faces = count(TopAbs_FACE)
    euler = count(TopAbs_VERTEX) - len(edges) + 2 * faces - count(TopAbs_WIRE)
    return {
        "valid": bool(BRepCheck_Analyzer(shape).IsValid()),
        "solids": count(TopAbs_SOLID),
        "faces": faces,
        "open_edges": open_edges,
        "genus": count(TopAbs_SHELL) - euler // 2,
        "volume": props.Mass(),
    }


def read_gmsh(path, size):
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.importShapes(path)
    gmsh.model.occ.synchronize()
    solids = gmsh.model.getEntities(3)
    out = {
        "solids": len(solids),
        "faces": len(gmsh.model.getEntities(2)),
        "mass": sum(gmsh.model.occ.getMass(3, tag) for _, tag in solids),
        "shortest_edge": min(gmsh.model.occ.getMass(1, tag) for _, tag in gmsh.model.getEntities(1)),
    }
    if size:
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.3)
        gmsh.option.setNumber("Mesh.Algorithm3D", 10)
        try:
            gmsh.model.mesh.generate(3)
            tags = [t for block in gmsh.model.mesh.getElements(3)[1] for t in block]
            quality = sorted(gmsh.model.mesh.getElementQualities(tags, "minSICN"))
            out["tets"] = len(tags)
            out["mesh_volume"] = float(sum(gmsh.model.mesh.getElementQualities(tags, "volume")))
            out["min_quality"] = float(quality[0])
            out["inverted"] = int(sum(q <= 0 for q in quality))
        except Exception as e:  # gmsh raises plain Exception
            out["mesh_error"] = str(e)
    gmsh.finalize()
    return out


def check(path, args):
    ocp, gm = read_ocp(path), read_gmsh(path, args.mesh)
    faults = []
    if not ocp["valid"]:
        faults.append("BRepCheck fails")
    if ocp["open_edges"]:
        faults.append(f"{ocp['open_edges']} edges have not exactly two faces")
    if ocp["solids"] != gm["solids"] or (args.solids is not None and ocp["solids"] != args.solids):
        faults.append(f"solids: {ocp['solids']} and {gm['solids']}")
    # gmsh integrates with the kernel's default rule, which is 1e-4 wrong on faces of many spans.
    if abs(gm["mass"] - ocp["volume"]) > 1e-3 * abs(ocp["volume"]):
        faults.append(f"volumes differ: {ocp['volume']} and {gm['mass']}")
    if args.volume is not None and abs(ocp["volume"] - args.volume) > 1e-6 * abs(args.volume):
        faults.append(f"volume {ocp['volume']} instead of {args.volume}")
    if args.genus is not None and ocp["genus"] != args.genus:
        faults.append(f"genus {ocp['genus']} instead of {args.genus}")
    if "mesh_error" in gm:
        faults.append(f"gmsh: {gm['mesh_error']}")
    print(json.dumps({"file": path, "ok": not faults, "faults": faults, "ocp": ocp, "gmsh": gm}))
    return not faults


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+")
    parser.add_argument("--volume", type=float)
    parser.add_argument("--genus", type=int)
    parser.add_argument("--solids", type=int)
    parser.add_argument("--mesh", type=float, default=0.0)
    args = parser.parse_args()
    sys.exit(0 if all([check(path, args) for path in args.files]) else 1)


if __name__ == "__main__":
    main()
