#!/usr/bin/env python3
"""Reads STEP files with two programs other than grassfire's own kernel and prints what they find.

    verify_step.py FOLDER|PART.step [...] [--volume MM3] [--genus N] [--solids N] [--mesh H[,H...]] [--edit] [--json]

A FOLDER is the output of a run: its part.step is compared with its report.json. Prints one line a file and a table of
what was tried with it, or one JSON object a line; exit code 1 when a check fails: valid, closed, both readers agree, and
volume (1e-4), genus, number of solids and names of faces as in the report or as given.

`--mesh H` makes a tetrahedral mesh with gmsh, once a size (mm; `auto` takes a 140th and a 100th of the diagonal); every
face and the solid must be meshed, while the quality of the elements is only told: SICN, the signed inverse condition
number, 1 for a regular tetrahedron, 0 for a flat one.

`--edit` edits the part as a CAD user would: rounds an edge of a boss, and moves a plane face outward by 0.5 mm; both must
leave one valid solid with the volume that the edit asks for. Where there is no boss edge or no plane that can be edited,
it says so.

Needs gmsh and cadquery-ocp (7.7 or newer, 8 too).
"""
import argparse
import json
import sys
from pathlib import Path

import verify_edits

VOLUME_LIMIT = 1e-4
# gmsh integrates with the kernel's default rule, which can be 1 % wrong on faces of many spans: it is compared with that
# rule in OCP, which shows that both read the same geometry.
GMSH_VOLUME_LIMIT = 1e-4


def distinct(kind, inside):
    """Sub-shapes of a kind, each with the number of times that it occurs. Works without the maps that OCP 8 dropped."""
    from OCP.TopExp import TopExp_Explorer

    found = {}
    at = TopExp_Explorer(inside, kind)
    while at.More():
        group = found.setdefault(hash(at.Current()), [])
        entry = next((e for e in group if e[0].IsSame(at.Current())), None)
        if entry is None:
            group.append([at.Current(), 1])
        else:
            entry[1] += 1
        at.Next()
    return [entry for group in found.values() for entry in group]


def edge_uses(shape):
    """Edges with the number of their uses by faces: the two sides of a closed surface's seam count as two."""
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
    from OCP.TopoDS import TopoDS

    to_edge = getattr(TopoDS, "Edge_s", None) or TopoDS.Edge
    uses = {}
    for face, _ in distinct(TopAbs_FACE, shape):
        for edge, times in distinct(TopAbs_EDGE, face):
            group = uses.setdefault(hash(edge), [])
            entry = next((e for e in group if e[0].IsSame(edge)), None)
            if entry is None:
                group.append([edge, times])
            else:
                entry[1] += times
    # A degenerated edge (the pole of a sphere) is no edge of the surface.
    return [entry for group in uses.values() for entry in group if not BRep_Tool.Degenerated_s(to_edge(entry[0]))]


def face_names(reader, shape):
    """How many faces have each name; faces without one count under the empty name."""
    from OCP.TopAbs import TopAbs_FACE

    transfer = reader.WS().TransferReader()
    names = {}
    for face, _ in distinct(TopAbs_FACE, shape):
        item = transfer.EntityFromShapeResult(face, 1)
        name = item.Name().ToCString() if hasattr(item, "Name") else ""
        names[name] = names.get(name, 0) + 1
    return names


def read_ocp(path):
    """Validity, counts, volume and genus (V - E + F - inner wires = 2 shells - 2 genus)."""
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID, TopAbs_VERTEX, TopAbs_WIRE

    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone:
        raise SystemExit(f"OCP cannot read {path}")
    reader.TransferRoots()
    shape = reader.OneShape()
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, 1e-8, False, False)
    default = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, default)
    vertices, faces, wires, shells, solids = (
        len(distinct(kind, shape)) for kind in (TopAbs_VERTEX, TopAbs_FACE, TopAbs_WIRE, TopAbs_SHELL, TopAbs_SOLID)
    )
    edges = edge_uses(shape)
    euler = vertices - len(edges) + 2 * faces - wires
    return {
        "valid": bool(BRepCheck_Analyzer(shape).IsValid()),
        "solids": solids,
        "faces": faces,
        "open_edges": sum(times != 2 for _, times in edges),
        "genus": shells - euler // 2,
        "volume": properties.Mass(),
        "default_rule_volume": default.Mass(),
        "names": face_names(reader, shape),
    }


def tetrahedra(size):
    """Meshes the open gmsh model."""
    import gmsh
    import numpy

    gmsh.model.mesh.clear()
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", min(0.3, size))
    gmsh.option.setNumber("Mesh.Algorithm3D", 10)
    # Short curved edges stay whole: three nodes nearly on a line make flat elements.
    gmsh.option.setNumber("Mesh.MinimumCurveNodes", 2)
    gmsh.option.setNumber("Mesh.OptimizeNetgen", 1)
    row = {"size": size, "failed_faces": 0, "tetrahedra": 0}
    try:
        gmsh.model.mesh.generate(3)
    except Exception as e:  # gmsh raises plain Exception
        row["error"] = str(e)
    faces = [tag for _, tag in gmsh.model.getEntities(2)]
    row["failed_faces"] = sum(not any(len(t) for t in gmsh.model.mesh.getElements(2, tag)[1]) for tag in faces)
    tags = [t for block in gmsh.model.mesh.getElements(3)[1] for t in block]
    if tags:
        quality = numpy.array(gmsh.model.mesh.getElementQualities(tags, "minSICN"))
        row |= {
            "tetrahedra": len(tags),
            "min_sicn": float(quality.min()),
            "low_sicn": float(numpy.quantile(quality, 0.01)),
            "mean_sicn": float(quality.mean()),
            "below_tenth": int((quality < 0.1).sum()),
            "inverted": int((quality <= 0).sum()),
        }
    return row


def read_gmsh(path, sizes):
    """Bodies, faces and volume, and a mesh of each size."""
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.importShapes(str(path))
    gmsh.model.occ.synchronize()
    solids = gmsh.model.getEntities(3)
    out = {
        "solids": len(solids),
        "faces": len(gmsh.model.getEntities(2)),
        "volume": sum(gmsh.model.occ.getMass(3, tag) for _, tag in solids),
    }
    if sizes == ["auto"]:
        box = gmsh.model.getBoundingBox(-1, -1)
        diagonal = sum((box[d + 3] - box[d]) ** 2 for d in range(3)) ** 0.5
        sizes = [round(diagonal / n, 3) for n in (140, 100)]
    if sizes:
        out["meshes"] = [tetrahedra(float(size)) for size in sizes]
    gmsh.finalize()
    return out


def expected(path, args):
    """The STEP file, and what it must hold."""
    want = {"volume": args.volume, "genus": args.genus, "solids": args.solids, "valid": True, "names": {}}
    if not path.is_dir():
        return path, want
    report = json.loads((path / "report.json").read_text())
    solid = report["solid"]
    # Bodies side by side have faces of their own, which the report does not count.
    names = {b["name"]: b["faces"] for b in report.get("non_design", []) if b["kept"]}
    names["organic"] = solid["faces"] - sum(names.values()) if solid["valid"] else None
    # A solid may be called invalid for reasons that BRepCheck does not see (a body not kept), never the other way.
    want = {"volume": solid["volume"], "genus": solid["genus"], "solids": solid["bodies"], "valid": solid["valid"]}
    return path / "part.step", want | {"names": names}


def faults(ocp, gm, want):
    """What differs, in words."""
    out = []
    if want["valid"] and not ocp["valid"]:
        out.append("BRepCheck fails")
    if ocp["open_edges"]:
        out.append(f"{ocp['open_edges']} edges have not exactly two faces")
    if ocp["solids"] != gm["solids"]:
        out.append(f"the readers find {ocp['solids']} and {gm['solids']} solids")
    if abs(gm["volume"] - ocp["default_rule_volume"]) > GMSH_VOLUME_LIMIT * abs(ocp["volume"]):
        out.append(f"by the default rule the readers find {ocp['default_rule_volume']:.3f} and {gm['volume']:.3f} mm3")
    for name in ("solids", "genus"):
        if want[name] is not None and ocp[name] != want[name]:
            out.append(f"{name} {ocp[name]} instead of {want[name]}")
    if want["volume"] is not None and abs(ocp["volume"] - want["volume"]) > VOLUME_LIMIT * abs(want["volume"]):
        out.append(f"volume {ocp['volume']:.3f} instead of {want['volume']:.3f} mm3")
    for name, count in want["names"].items():
        have = sum(n for face, n in ocp["names"].items() if face == name or face.startswith(name + ": "))
        if count is not None and have != count:
            out.append(f"{have} faces are named after {name} instead of {count}")
    for row in gm.get("meshes", []):
        what = f"at {row['size']} mm"
        if "error" in row:
            out.append(f"gmsh cannot mesh it {what}: {row['error']}")
        elif row["failed_faces"]:
            out.append(f"gmsh leaves {row['failed_faces']} faces without a mesh {what}")
        elif not row["tetrahedra"] or row["inverted"]:
            out.append(f"gmsh makes {row['tetrahedra']} tetrahedra, {row.get('inverted', 0)} of them inverted, {what}")
    return out


def table(gm, edits):
    """What was tried, as lines."""
    lines = []
    if gm.get("meshes"):
        lines.append("    mesh mm  tetrahedra  failed faces  SICN min   1 %   mean  below 0.1")
        for row in gm["meshes"]:
            quality = ("{min_sicn:8.4f}  {low_sicn:5.3f}  {mean_sicn:5.3f}  {below_tenth:9}" if row["tetrahedra"] else row.get("error", "")).format(**row)
            lines.append(f"    {row['size']:7.3f}  {row['tetrahedra']:10}  {row['failed_faces']:12}  {quality}")
    for edit in edits:
        lines.append("    " + edit_line(edit))
    return lines


def edit_line(edit):
    """One edit in words."""
    if "skipped" in edit:
        return f"{edit['edit']}: skipped, {edit['skipped']}"
    verdict = "works" if edit["ok"] else f"FAILS: {edit['error']}"
    volume = f", {edit['change']:+.3f} mm3 ({edit['wanted']} wanted)" if "change" in edit else ""
    return f"{edit['edit']} on {edit['place']}: {verdict}{volume}; {edit['tries']} tried, {edit['seconds']:.1f} s"


def check(path, args):
    """Checks one file or folder and prints; true when all is well."""
    step, want = expected(Path(path), args)
    ocp, gm = read_ocp(step), read_gmsh(step, args.mesh)
    edits = verify_edits.edits(step) if args.edit else []
    bad = faults(ocp, gm, want)
    bad += [edit_line(edit) for edit in edits if not edit.get("ok", True)]
    if args.json:
        print(json.dumps({"file": str(step), "ok": not bad, "faults": bad, "ocp": ocp, "gmsh": gm, "edits": edits}))
    else:
        error = "" if want["volume"] is None else f" ({ocp['volume'] / want['volume'] - 1:+.1e} to the report)"
        print(
            f"{'ok ' if not bad else 'BAD'} {path}: {'valid' if ocp['valid'] else 'NOT VALID'}, {ocp['solids']} solids, "
            f"{ocp['faces']} faces, genus {ocp['genus']}, {ocp['volume']:.2f} mm3{error}"
            + "".join(f"; {text}" for text in bad)
        )
        for line in table(gm, edits):
            print(line)
    return not bad


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+")
    parser.add_argument("--volume", type=float)
    parser.add_argument("--genus", type=int)
    parser.add_argument("--solids", type=int)
    parser.add_argument("--mesh", type=lambda text: text.split(","), default=[])
    parser.add_argument("--edit", action="store_true")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    sys.exit(0 if all([check(path, args) for path in args.files]) else 1)


if __name__ == "__main__":
    main()
