"""Re-reads part.step with gmsh and OCP and compares volume, bodies and genus with report.json."""

import json
import sys
from pathlib import Path

import gmsh
from OCP.BRep import BRep_Tool
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID, TopAbs_VERTEX, TopAbs_WIRE
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedMapOfShape

VOLUME_LIMIT = 1e-4


def by_gmsh(path):
    """Bodies and volume."""
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.importShapes(str(path))
    gmsh.model.occ.synchronize()
    bodies = gmsh.model.occ.getEntities(3)
    volume = sum(gmsh.model.occ.getMass(3, tag) for _, tag in bodies)
    gmsh.finalize()
    return len(bodies), volume


def distinct(shape, kind):
    """Distinct sub-shapes."""
    found = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, kind, found)
    return [found.FindKey(n) for n in range(1, found.Extent() + 1)]


def by_ocp(path):
    """Bodies, volume, validity and genus (V - E + F - inner wires = 2 shells - 2 genus)."""
    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone:
        raise SystemExit(f"OCP cannot read {path}")
    reader.TransferRoots()
    shape = reader.OneShape()
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, 1e-6, False, False)
    count = {kind: len(distinct(shape, kind)) for kind in (TopAbs_VERTEX, TopAbs_FACE, TopAbs_WIRE, TopAbs_SHELL, TopAbs_SOLID)}
    # A degenerated edge (the pole of a sphere) is no edge of the surface.
    edges = sum(not BRep_Tool.Degenerated_s(TopoDS.Edge_s(edge)) for edge in distinct(shape, TopAbs_EDGE))
    euler = count[TopAbs_VERTEX] - edges + 2 * count[TopAbs_FACE] - count[TopAbs_WIRE]
    genus = count[TopAbs_SHELL] - euler // 2
    return count[TopAbs_SOLID], properties.Mass(), BRepCheck_Analyzer(shape).IsValid(), genus


def main(folder):
    """Compares and prints; exit code 1 when something differs."""
    path = folder / "part.step"
    solid = json.loads((folder / "report.json").read_text())["solid"]
    bad = []

    def expect(what, got, want, limit=0.0):
        scale = abs(want) if limit else 1.0
        good = abs(got - want) <= limit * scale
        print(f"  {'ok ' if good else 'BAD'} {what}: {got:g}, report {want:g}")
        if not good:
            bad.append(what)

    bodies, volume = by_gmsh(path)
    expect("gmsh bodies", bodies, solid["bodies"])
    expect("gmsh volume, mm3", volume, solid["volume"], VOLUME_LIMIT)
    bodies, volume, valid, genus = by_ocp(path)
    expect("OCP bodies", bodies, solid["bodies"])
    expect("OCP volume, mm3", volume, solid["volume"], VOLUME_LIMIT)
    expect("OCP valid", valid, solid["valid"])
    expect("OCP genus", genus, solid["genus"])
    if bad:
        sys.exit(f"outside checks differ: {', '.join(bad)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
