"""Edits a STEP part as a CAD user would, with OCP; used by verify_step.py."""
import math
import time

# Move of the plane face, mm.
OFFSET = 0.5
# Radii of the fillet, mm: the first one that works counts.
RADII = (0.5, 0.25, 0.1)
# Places that are tried before an edit counts as failed.
TRIES = 8
# An edge belongs to a boss when its two faces are analytic and meet at more than this angle, radians.
SHARP = 0.5


def volume(shape):
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, 1e-8, False, False)
    return properties.Mass()


def explore(shape, kind):
    from OCP.TopExp import TopExp_Explorer

    at = TopExp_Explorer(shape, kind)
    while at.More():
        yield at.Current()
        at.Next()


def fault(shape):
    """Why an edited shape is no good; none when it is one valid solid."""
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopAbs import TopAbs_SOLID

    if shape is None or shape.IsNull():
        return "nothing comes out"
    if not BRepCheck_Analyzer(shape).IsValid():
        return "the result is not valid"
    solids = sum(1 for _ in explore(shape, TopAbs_SOLID))
    return None if solids == 1 else f"{solids} solids come out"


def load(path):
    from OCP.STEPControl import STEPControl_Reader

    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    return reader.OneShape()


class Part:
    """Faces, edges and what they are."""

    def __init__(self, shape):
        from OCP.BRepAdaptor import BRepAdaptor_Surface
        from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
        from OCP.TopoDS import TopoDS

        self.shape = shape
        to_face = getattr(TopoDS, "Face_s", None) or TopoDS.Face
        self.to_edge = getattr(TopoDS, "Edge_s", None) or TopoDS.Edge
        self.faces = [to_face(f) for f in explore(shape, TopAbs_FACE)]
        self.surfaces = [BRepAdaptor_Surface(f) for f in self.faces]
        self.edges = []  # [edge, faces]
        groups = {}
        for k, face in enumerate(self.faces):
            for edge in explore(face, TopAbs_EDGE):
                group = groups.setdefault(hash(edge), [])
                entry = next((e for e in group if e[0].IsSame(edge)), None)
                if entry is None:
                    entry = [self.to_edge(edge), []]
                    group.append(entry)
                    self.edges.append(entry)
                entry[1].append(k)

    def kind(self, k):
        from OCP.GeomAbs import GeomAbs_Cylinder, GeomAbs_Plane

        kinds = {GeomAbs_Plane: "plane", GeomAbs_Cylinder: "cylinder"}
        return kinds.get(self.surfaces[k].GetType(), "other")

    def length(self, edge):
        from OCP.BRepGProp import BRepGProp
        from OCP.GProp import GProp_GProps

        properties = GProp_GProps()
        BRepGProp.LinearProperties_s(edge, properties)
        return properties.Mass()

    def area(self, k):
        from OCP.BRepGProp import BRepGProp
        from OCP.GProp import GProp_GProps

        properties = GProp_GProps()
        BRepGProp.SurfaceProperties_s(self.faces[k], properties)
        return properties.Mass()

    def normal(self, k, point):
        """Outward normal of face k near a point."""
        from OCP.BRepGProp import BRepGProp_Face
        from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
        from OCP.BRep import BRep_Tool
        from OCP.gp import gp_Pnt, gp_Vec

        nearest = GeomAPI_ProjectPointOnSurf(point, BRep_Tool.Surface_s(self.faces[k]))
        u, v = nearest.LowerDistanceParameters()
        place, normal = gp_Pnt(), gp_Vec()
        BRepGProp_Face(self.faces[k]).Normal(u, v, place, normal)
        return normal

    def angle(self, edge, faces):
        """Angle between the normals of the two faces in the middle of an edge, radians."""
        from OCP.BRepAdaptor import BRepAdaptor_Curve

        curve = BRepAdaptor_Curve(edge)
        middle = curve.Value((curve.FirstParameter() + curve.LastParameter()) / 2)
        a, b = (self.normal(k, middle) for k in faces)
        if a.Magnitude() < 1e-12 or b.Magnitude() < 1e-12:
            return 0.0
        return a.Angle(b)


def boss_edges(part):
    """Edges between a plane and a cylinder, sharp, longest first: rims of bosses and bores."""
    found = []
    for edge, faces in part.edges:
        if len(faces) != 2 or sorted(part.kind(k) for k in faces) != ["cylinder", "plane"]:
            continue
        if part.angle(edge, faces) > SHARP:
            found.append((part.length(edge), edge, faces))
    return sorted(found, key=lambda entry: -entry[0])


def fillet(part):
    """Rounds the rim of a boss or bore."""
    from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet

    start = time.time()
    out = {"edit": "fillet", "ok": False, "error": "", "place": "-", "tries": 0}
    candidates = boss_edges(part)
    if not candidates:
        return {"edit": "fillet", "skipped": "no edge between a plane and a cylinder"}
    before = volume(part.shape)
    for length, edge, _ in candidates[:TRIES]:
        for radius in RADII:
            out["tries"] += 1
            try:
                maker = BRepFilletAPI_MakeFillet(part.shape)
                maker.Add(radius, edge)
                maker.Build()
                result = maker.Shape() if maker.IsDone() else None
            except Exception as e:  # OCP raises its own kinds
                out["error"] = str(e).splitlines()[0] if str(e) else type(e).__name__
                continue
            problem = fault(result)
            change = 0.0 if problem else volume(result) - before
            # A quarter round takes (1 - pi/4) r^2 a length off a convex edge; a concave one gains it.
            most = 2 * (1 - math.pi / 4) * radius**2 * length
            if problem is None and not 0 < abs(change) < most:
                problem = f"the volume changes by {change:.3f} mm3"
            out |= {"place": f"an edge of {length:.1f} mm, radius {radius}", "error": problem or "", "ok": problem is None}
            if out["ok"]:
                out |= {"change": change, "wanted": f"about {math.copysign(most / 2, change):.3f}", "seconds": time.time() - start}
                return out
    out["seconds"] = time.time() - start
    return out


def offset(part):
    """Moves a plane face outward: a prism over it is united with the part."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
    from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism

    start = time.time()
    out = {"edit": "offset", "ok": False, "error": "", "place": "-", "tries": 0}
    planes = sorted((k for k in range(len(part.faces)) if part.kind(k) == "plane"), key=lambda k: -part.area(k))
    if not planes:
        return {"edit": "offset", "skipped": "no plane face"}
    before = volume(part.shape)
    for k in planes[:TRIES]:
        out["tries"] += 1
        edge = next(edge for edge, faces in part.edges if k in faces)
        curve = BRepAdaptor_Curve(edge)
        normal = part.normal(k, curve.Value(curve.FirstParameter()))
        normal.Normalize()
        try:
            prism = BRepPrimAPI_MakePrism(part.faces[k], normal.Multiplied(OFFSET)).Shape()
            fused = BRepAlgoAPI_Fuse(part.shape, prism)
            result = fused.Shape() if fused.IsDone() else None
        except Exception as e:  # OCP raises its own kinds
            out["error"] = str(e).splitlines()[0] if str(e) else type(e).__name__
            continue
        problem, wanted = fault(result), part.area(k) * OFFSET
        change = 0.0 if problem else volume(result) - before
        # Walls beside the face may lean into the prism, so it gains no more than its volume.
        if problem is None and not 0 < change < wanted * (1 + 1e-4):
            problem = f"the volume changes by {change:.3f} mm3"
        place = f"a plane of {part.area(k):.1f} mm2, {OFFSET} mm"
        out |= {"place": place, "error": problem or "", "ok": problem is None}
        if out["ok"]:
            out |= {"change": change, "wanted": f"at most {wanted:.3f}", "seconds": time.time() - start}
            return out
    out["seconds"] = time.time() - start
    return out


def edits(path):
    """All edits of a file."""
    part = Part(load(path))
    return [fillet(part), offset(part)]
