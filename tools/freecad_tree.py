#!/usr/bin/env python3
"""Makes a FreeCAD document with live features from the pieces of a run.

    freecad_tree.py FOLDER [-o PART.FCStd] [--json]

FOLDER is the output of `grassfire reconstruct ... --format pieces`. The document's tree holds the organic body, each
non-design body (its bores filled), their fuse, each bore as a cylinder, and the part: the fuse without the bores.
Change the Radius of a bore and recompute: everything after it follows.

The result is compared with part.step, as FreeCAD measures both. Exit codes: 0 all well, 1 the part in the tree is not
valid or differs from part.step, 2 bad usage or input, 4 FreeCAD is not installed (Debian: freecad-python3).
"""
import argparse
import json
import sys
from pathlib import Path

# Relative difference of volume between the tree and part.step.
LIMIT = 1e-4
# Where Debian and others put FreeCAD's Python modules.
FOLDERS = ("/usr/lib/freecad-python3/lib", "/usr/lib/freecad/lib", "/usr/lib64/freecad/lib", "/opt/freecad/lib")


def fail(code, text):
    print(f"error: {text}", file=sys.stderr)
    sys.exit(code)


def freecad():
    """The modules FreeCAD and Part."""
    sys.path += [folder for folder in FOLDERS if Path(folder).is_dir()]
    try:
        import FreeCAD
        import Part
    except ImportError as missing:
        fail(4, f"FreeCAD is not installed ({missing}); on Debian: apt-get install freecad-python3")
    return FreeCAD, Part


def read_solids(part, path):
    """The shape of a STEP file; one solid comes without a compound around it."""
    shape = part.Shape()
    shape.read(str(path))
    if not shape.Solids:
        fail(2, f"{path} holds no solid")
    return shape.Solids[0] if len(shape.Solids) == 1 else shape


def add_bore(app, document, body, number, bore):
    """A cylinder over the length that grassfire cut."""
    start, end = bore["cut"]
    axis = app.Vector(*bore["axis"])
    cylinder = document.addObject("Part::Cylinder", "Bore")
    cylinder.Label = f"{body['name']}: bore" + (f" {number}" if len(body["bores"]) > 1 else "")
    cylinder.Radius = bore["radius"]
    cylinder.Height = end - start
    cylinder.Placement = app.Placement(app.Vector(*bore["origin"]) + axis * start, app.Rotation(app.Vector(0, 0, 1), axis))
    return cylinder


def joined(document, name, label, objects):
    """The union of objects: themselves when there is one."""
    if len(objects) == 1:
        return objects[0]
    fuse = document.addObject("Part::MultiFuse", name)
    fuse.Label = label
    fuse.Shapes = objects
    return fuse


def tree(app, part, folder, report):
    """The document, its last feature and the bores."""
    document = app.newDocument("part")
    organic = document.addObject("Part::Feature", "Organic")
    organic.Label = "organic body"
    organic.Shape = read_solids(part, folder / "pieces" / "organic.step")
    objects, bores = [organic], []
    for body in report.get("non_design", []):
        if "piece" not in body:
            fail(2, f"{folder} has no pieces: run grassfire with --format pieces")
        feature = document.addObject("Part::Feature", "Body")
        feature.Label = body["name"]
        feature.Shape = read_solids(part, folder / body["piece"])
        objects.append(feature)
        bores += [add_bore(app, document, body, k + 1, bore) for k, bore in enumerate(body.get("bores", []))]
    result = joined(document, "Fuse", "fuse", objects)
    if bores:
        cut = document.addObject("Part::Cut", "Part")
        cut.Label = "part"
        cut.Base = result
        cut.Tool = joined(document, "Bores", "bores", bores)
        result = cut
    document.recompute()
    return document, result, bores


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, help="default: FOLDER/part.FCStd")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    app, part = freecad()
    try:
        report = json.loads((args.folder / "report.json").read_text())
    except (OSError, ValueError) as error:
        fail(2, f"{args.folder}: {error}")
    if not (args.folder / "pieces" / "organic.step").is_file():
        fail(2, f"{args.folder} has no pieces: run grassfire with --format pieces")
    document, result, bores = tree(app, part, args.folder, report)
    output = args.output or args.folder / "part.FCStd"
    document.saveAs(str(output))
    wanted = read_solids(part, args.folder / "part.step").Volume
    shape = result.Shape
    found = {
        "file": str(output),
        "valid": bool(shape.isValid()) and all(o.isValid() for o in document.Objects),
        "solids": len(shape.Solids),
        "faces": len(shape.Faces),
        "volume": shape.Volume,
        "part_volume": wanted,
        "features": [[o.TypeId, o.Label] for o in document.Objects],
        "bores": [[b.Name, b.Radius.Value] for b in bores],
    }
    difference = abs(shape.Volume / wanted - 1)
    good = found["valid"] and len(shape.Solids) == report["solid"]["bodies"] and difference <= LIMIT
    if args.json:
        print(json.dumps(found))
    else:
        state = "valid" if found["valid"] else "NOT VALID"
        print(f"{output}: {state}, {found['solids']} solids, {len(bores)} bores, {shape.Volume:.2f} mm3 ({difference:.1e} from part.step)")
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
