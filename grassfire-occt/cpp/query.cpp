// Questions to a shape: validity, counts, volume, surface types, edges, lines, distances.
#include "grassfire-occt/cpp/bridge.h"
#include "grassfire-occt/src/ffi.rs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <sstream>
#include <stdexcept>
#include <vector>

#include <BRepAdaptor_Curve.hxx>
#include <BRepAdaptor_Surface.hxx>
#include <BRepBndLib.hxx>
#include <BRepBuilderAPI_MakeVertex.hxx>
#include <BRepCheck_Analyzer.hxx>
#include <BRepCheck_ListOfStatus.hxx>
#include <BRepCheck_Result.hxx>
#include <BRepClass3d_SolidClassifier.hxx>
#include <BRepExtrema_DistShapeShape.hxx>
#include <BRepGProp.hxx>
#include <BRepGProp_Domain.hxx>
#include <BRepGProp_Face.hxx>
#include <BRepGProp_Vinert.hxx>
#include <BRepMesh_IncrementalMesh.hxx>
#include <BRepTools.hxx>
#include <BRepTopAdaptor_FClass2d.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Bnd_Box.hxx>
#include <GCPnts_AbscissaPoint.hxx>
#include <GProp_GProps.hxx>
#include <Geom2d_Curve.hxx>
#include <Geom_Surface.hxx>
#include <IntCurvesFace_ShapeIntersector.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <Message_Printer.hxx>
#include <Poly_Triangulation.hxx>
#include <Precision.hxx>
#include <ShapeAnalysis_ShapeTolerance.hxx>
#include <Standard_Version.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Vertex.hxx>
#include <TopoDS_Compound.hxx>

namespace grassfire {
namespace {

const char* shape_name(TopAbs_ShapeEnum type) {
  static const char* names[] = {"compound", "compound solid", "solid", "shell", "face", "wire", "edge", "vertex", "shape"};
  return names[type];
}

const char* status_name(BRepCheck_Status status) {
  static const char* names[] = {"no error", "point off its curve", "point off its curve on surface", "point off its surface", "no 3D curve",
    "several 3D curves", "invalid 3D curve", "no curve on surface", "invalid curve on surface", "invalid curve on closed surface",
    "wrong same-range flag", "wrong same-parameter flag", "wrong degenerated flag", "free edge", "edge on too many faces", "invalid range",
    "empty wire", "redundant edge", "self-intersecting wire", "no surface", "invalid wire", "redundant wire", "intersecting wires",
    "wrong nesting of wires", "empty shell", "redundant face", "wrong nesting of shells", "cannot be oriented", "not closed", "not connected",
    "sub-shape not in shape", "wrong orientation", "wrong orientation of a sub-shape", "invalid polygon on triangulation", "invalid tolerance",
    "enclosed region", "check failed"};
  return int(status) < int(sizeof(names) / sizeof(names[0])) ? names[status] : "unknown status";
}

int count(const TopoDS_Shape& shape, TopAbs_ShapeEnum type) {
  TopTools_IndexedMapOfShape map;
  TopExp::MapShapes(shape, type, map);
  return map.Extent();
}

TopoDS_Shape faces_only(const TopoDS_Shape& shape) {
  TopTools_IndexedMapOfShape map;
  TopExp::MapShapes(shape, TopAbs_FACE, map);
  TopoDS_Compound out;
  BRep_Builder builder;
  builder.MakeCompound(out);
  for (int i = 1; i <= map.Extent(); ++i) builder.Add(out, map(i));
  return out;
}

int kind_of(GeomAbs_SurfaceType type) {
  switch (type) {
    case GeomAbs_Plane: return 0;
    case GeomAbs_Cylinder: return 1;
    case GeomAbs_Cone: return 2;
    case GeomAbs_Sphere: return 3;
    case GeomAbs_Torus: return 4;
    default: return 5;
  }
}

void put(std::array<double, 3>& out, const gp_XYZ& v) { out = {v.X(), v.Y(), v.Z()}; }

// Outward normal of a face at a share of one of its edges, through the curve on the surface; false where there is none.
bool normal_at(const TopoDS_Edge& edge, const TopoDS_Face& face, double share, gp_Vec& normal) {
  double a, b;
  Handle(Geom2d_Curve) pcurve = BRep_Tool::CurveOnSurface(edge, face, a, b);
  if (pcurve.IsNull()) return false;
  const gp_Pnt2d uv = pcurve->Value(a + (b - a) * share);
  gp_Pnt p;
  gp_Vec u, v;
  BRep_Tool::Surface(face)->D1(uv.X(), uv.Y(), p, u, v);
  normal = u.Crossed(v);
  if (face.Orientation() == TopAbs_REVERSED) normal.Reverse();
  return true;
}

// Largest angle between the normals of two faces along an edge: 9 points.
double normal_angle(const TopoDS_Edge& edge, const TopoDS_Face& first, const TopoDS_Face& second) {
  double worst = 0;
  for (int q = 1; q < 10; ++q) {
    gp_Vec normal[2];
    if (!normal_at(edge, first, q / 10., normal[0]) || !normal_at(edge, second, q / 10., normal[1]))
      return std::numeric_limits<double>::quiet_NaN();
    if (normal[0].Magnitude() < 1e-14 || normal[1].Magnitude() < 1e-14) continue;
    worst = std::max(worst, normal[0].Angle(normal[1]));
  }
  return worst;
}

// Whether the faces form an inner edge in the middle of the edge: going along it with the first face on the left, the second
// rises above it.
bool inner_edge(const TopoDS_Edge& edge, const TopoDS_Face& first, const TopoDS_Face& second) {
  gp_Vec normal[2], along;
  if (!normal_at(edge, first, 0.5, normal[0]) || !normal_at(edge, second, 0.5, normal[1])) return false;
  const BRepAdaptor_Curve curve(edge);
  gp_Pnt p;
  curve.D1((curve.FirstParameter() + curve.LastParameter()) / 2, p, along);
  for (TopExp_Explorer at(first, TopAbs_EDGE); at.More(); at.Next())
    if (at.Current().IsSame(edge)) {
      if (at.Current().Orientation() == TopAbs_REVERSED) along.Reverse();
      return normal[0].Crossed(normal[1]).Dot(along) < 0;
    }
  return false;
}

}  // namespace

rust::String occt_version() { return rust::String(OCC_VERSION_COMPLETE); }

void silence() { Message::DefaultMessenger()->RemovePrinters(STANDARD_TYPE(Message_Printer)); }

rust::String faults(const Shape& s) {
  BRepCheck_Analyzer analyzer(s.shape);
  if (analyzer.IsValid()) return rust::String();
  std::map<std::string, int> found;
  TopTools_IndexedMapOfShape map;
  TopExp::MapShapes(s.shape, map);
  for (int i = 1; i <= map.Extent(); ++i) {
    const Handle(BRepCheck_Result)& result = analyzer.Result(map(i));
    if (result.IsNull()) continue;
    const std::string name = shape_name(map(i).ShapeType());
    for (BRepCheck_Status status : result->Status())
      if (status != BRepCheck_NoError) found[name + ": " + status_name(status)]++;
    for (result->InitContextIterator(); result->MoreShapeInContext(); result->NextShapeInContext())
      for (BRepCheck_Status status : result->StatusOnShape())
        if (status != BRepCheck_NoError) found[name + " in " + shape_name(result->ContextualShape().ShapeType()) + ": " + status_name(status)]++;
  }
  std::ostringstream text;
  for (const auto& [name, times] : found) text << (text.tellp() > 0 ? "; " : "") << name << " (" << times << ")";
  if (found.empty()) text << "invalid, no reason given";
  return rust::String::lossy(text.str());
}

Counts counts(const Shape& s) {
  Counts out{};
  out.solids = count(s.shape, TopAbs_SOLID);
  out.shells = count(s.shape, TopAbs_SHELL);
  out.faces = count(s.shape, TopAbs_FACE);
  out.wires = count(s.shape, TopAbs_WIRE);
  out.edges = count(s.shape, TopAbs_EDGE);
  out.vertices = count(s.shape, TopAbs_VERTEX);
  TopTools_IndexedDataMapOfShapeListOfShape on;
  TopExp::MapShapesAndAncestors(s.shape, TopAbs_EDGE, TopAbs_FACE, on);
  for (int i = 1; i <= on.Extent(); ++i)
    if (BRep_Tool::Degenerated(TopoDS::Edge(on.FindKey(i)))) --out.edges;
    else if (on(i).Extent() != 2) ++out.bad_edges;
  return out;
}

std::unique_ptr<Shape> solid(const Shape& s, size_t index) {
  TopTools_IndexedMapOfShape map;
  TopExp::MapShapes(s.shape, TopAbs_SOLID, map);
  auto out = std::make_unique<Shape>();
  out->shape = map.FindKey(int(index) + 1);
  return out;
}

// The overload without eps does not break its Gauss rule at the knots and is wrong by 1e-4 on faces of many spans.
double volume(const Shape& s, double eps) {
  GProp_GProps props;
  BRepGProp::VolumeProperties(s.shape, props, eps, false, false);
  return props.Mass();
}

// What each face adds to the volume: the signed cone over it from the middle of the box around `known`. A face that is
// also in `known` (the same face in the same place, not an equal one) is not integrated again.
rust::Vec<double> face_volumes(const Shape& s, double eps, const Shape& known, rust::Slice<const double> known_volumes) {
  TopTools_IndexedMapOfShape faces, before;
  TopExp::MapShapes(s.shape, TopAbs_FACE, faces);
  TopExp::MapShapes(known.shape, TopAbs_FACE, before);
  Bnd_Box box;
  BRepBndLib::Add(known.shape, box, false);
  gp_Pnt apex;
  if (!box.IsVoid()) apex = gp_Pnt((box.CornerMin().XYZ() + box.CornerMax().XYZ()) / 2.);
  rust::Vec<double> out;
  for (int i = 1; i <= faces.Extent(); ++i) {
    const int at = before.FindIndex(faces(i));
    if (at > 0 && size_t(at) <= known_volumes.size()) {
      const double volume = known_volumes[size_t(at) - 1];
      out.push_back(before(at).Orientation() == faces(i).Orientation() ? volume : -volume);
      continue;
    }
    BRepGProp_Face face(TopoDS::Face(faces(i)));
    BRepGProp_Domain domain(TopoDS::Face(faces(i)));
    BRepGProp_Vinert cone;
    cone.SetLocation(apex);
    cone.Perform(face, domain, eps);
    out.push_back(cone.Mass());
  }
  return out;
}

double area(const Shape& s, double eps) {
  GProp_GProps props;
  BRepGProp::SurfaceProperties(s.shape, props, eps, false);
  return props.Mass();
}

double max_tolerance(const Shape& s) { return ShapeAnalysis_ShapeTolerance().Tolerance(s.shape, 1); }

rust::Vec<FaceInfo> faces(const Shape& s) {
  rust::Vec<FaceInfo> out;
  TopTools_IndexedMapOfShape map;
  TopExp::MapShapes(s.shape, TopAbs_FACE, map);
  for (int i = 1; i <= map.Extent(); ++i) {
    const TopoDS_Face face = TopoDS::Face(map(i));
    const BRepAdaptor_Surface surface(face);
    FaceInfo info{};
    info.kind = kind_of(surface.GetType());
    BRepTools::UVBounds(face, info.u0, info.u1, info.v0, info.v1);
    gp_Pnt middle;
    gp_Vec du, dv;
    surface.D1((info.u0 + info.u1) / 2, (info.v0 + info.v1) / 2, middle, du, dv);
    gp_Vec normal = du.Crossed(dv);
    if (face.Orientation() == TopAbs_REVERSED) normal.Reverse();
    if (normal.Magnitude() > 1e-14) normal.Normalize();
    put(info.normal, normal.XYZ());
    put(info.middle, middle.XYZ());
    gp_Ax1 axis(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1));
    if (info.kind == 0) axis = surface.Plane().Axis();
    if (info.kind == 1) axis = surface.Cylinder().Axis(), info.radius = surface.Cylinder().Radius();
    if (info.kind == 2) axis = surface.Cone().Axis(), info.radius = surface.Cone().RefRadius(), info.minor = surface.Cone().SemiAngle();
    if (info.kind == 3) axis.SetLocation(surface.Sphere().Location()), info.radius = surface.Sphere().Radius();
    if (info.kind == 4) axis = surface.Torus().Axis(), info.radius = surface.Torus().MajorRadius(), info.minor = surface.Torus().MinorRadius();
    put(info.origin, axis.Location().XYZ());
    put(info.axis, axis.Direction().XYZ());
    if (info.kind == 1) {
      const gp_Vec from(axis.Location(), middle);
      const gp_Vec radial = from - gp_Vec(axis.Direction()) * from.Dot(gp_Vec(axis.Direction()));
      info.concave = normal.Dot(radial) < 0;
    }
    GProp_GProps props;
    BRepGProp::SurfaceProperties(face, props, 1e-6, false);
    info.area = props.Mass();
    out.push_back(info);
  }
  return out;
}

rust::Vec<EdgeInfo> edges(const Shape& s) {
  rust::Vec<EdgeInfo> out;
  TopTools_IndexedDataMapOfShapeListOfShape on;
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapesAndAncestors(s.shape, TopAbs_EDGE, TopAbs_FACE, on);
  TopExp::MapShapes(s.shape, TopAbs_FACE, faces);
  for (int i = 1; i <= on.Extent(); ++i) {
    const TopoDS_Edge edge = TopoDS::Edge(on.FindKey(i));
    if (BRep_Tool::Degenerated(edge)) continue;
    EdgeInfo info{};
    info.faces = {-1, -1};
    info.angle = std::numeric_limits<double>::quiet_NaN();
    const BRepAdaptor_Curve curve(edge);
    info.length = GCPnts_AbscissaPoint::Length(curve, 1e-7);
    put(info.middle, curve.Value((curve.FirstParameter() + curve.LastParameter()) / 2).XYZ());
    if (on(i).Extent() == 2) {
      const TopoDS_Face a = TopoDS::Face(on(i).First()), b = TopoDS::Face(on(i).Last());
      info.faces = {faces.FindIndex(a) - 1, faces.FindIndex(b) - 1};
      if (!a.IsSame(b)) {
        info.angle = normal_angle(edge, a, b);
        info.concave = inner_edge(edge, a, b);
      }
    }
    out.push_back(info);
  }
  return out;
}

rust::Vec<double> bounds(const Shape& s) {
  Bnd_Box box;
  BRepBndLib::AddOptimal(s.shape, box, false, false);
  rust::Vec<double> out;
  if (box.IsVoid()) return out;
  double v[6];
  box.Get(v[0], v[1], v[2], v[3], v[4], v[5]);
  for (double x : v) out.push_back(x);
  return out;
}

// `lines`: point, direction (6 numbers), lower and upper bound of the parameter; 8 numbers a line.
rust::Vec<LineHit> line_hits(const Shape& s, rust::Slice<const double> lines) {
  IntCurvesFace_ShapeIntersector intersector;
  intersector.Load(s.shape, 1e-7);
  rust::Vec<LineHit> out;
  for (size_t i = 0; i + 7 < lines.size(); i += 8) {
    const double* q = &lines[i];
    intersector.Perform(gp_Lin(gp_Pnt(q[0], q[1], q[2]), gp_Dir(q[3], q[4], q[5])), q[6], q[7]);
    if (!intersector.IsDone()) throw std::runtime_error("a line could not be intersected with the shape");
    for (int k = 1; k <= intersector.NbPnt(); ++k) out.push_back(LineHit{uint32_t(i / 8), intersector.WParameter(k)});
  }
  return out;
}

// 1 for each point that lies strictly inside one of the solids.
rust::Vec<uint8_t> contains(const Shape& s, rust::Slice<const double> points) {
  const size_t n = points.size() / 3;
  std::vector<uint8_t> in(n, 0);
  for (TopExp_Explorer at(s.shape, TopAbs_SOLID); at.More(); at.Next()) {
    BRepClass3d_SolidClassifier classifier(at.Current());
    for (size_t i = 0; i < n; ++i) {
      if (in[i]) continue;
      classifier.Perform(gp_Pnt(points[3 * i], points[3 * i + 1], points[3 * i + 2]), 1e-7);
      in[i] = classifier.State() == TopAbs_IN;
    }
  }
  rust::Vec<uint8_t> out;
  for (uint8_t flag : in) out.push_back(flag);
  return out;
}

rust::Vec<double> distances(const Shape& s, rust::Slice<const double> points) {
  const TopoDS_Shape target = faces_only(s.shape);
  rust::Vec<double> out;
  for (size_t i = 0; i + 2 < points.size(); i += 3) {
    const TopoDS_Shape vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(points[i], points[i + 1], points[i + 2])).Vertex();
    BRepExtrema_DistShapeShape distance(vertex, target);
    if (!distance.IsDone()) throw std::runtime_error("no distance found");
    out.push_back(distance.Value());
  }
  return out;
}

// Points inside the trimmed faces: the middles of triangles in parameter space, put back on the exact surface.
// A triangle cuts across the hollow side of a curved edge, so its middle can lie outside the trimming: then the next one
// is taken. A face without any middle inside (a sliver) keeps the first ones: the caller then sees too large a distance.
rust::Vec<double> face_samples(const Shape& s, rust::Slice<const uint32_t> wanted, size_t per_face) {
  TopTools_IndexedMapOfShape map;
  TopExp::MapShapes(s.shape, TopAbs_FACE, map);
  rust::Vec<double> out;
  for (uint32_t index : wanted) {
    const TopoDS_Face face = TopoDS::Face(map.FindKey(int(index) + 1));
    TopLoc_Location place;
    Handle(Poly_Triangulation) mesh = BRep_Tool::Triangulation(face, place);
    if (mesh.IsNull()) {
      BRepMesh_IncrementalMesh(face, 0.1, false, 0.3, false);
      mesh = BRep_Tool::Triangulation(face, place);
    }
    if (mesh.IsNull() || !mesh->HasUVNodes()) continue;
    const BRepAdaptor_Surface surface(face);
    BRepTopAdaptor_FClass2d trimming(face, Precision::PConfusion());
    const size_t n = size_t(mesh->NbTriangles()), step = std::max<size_t>(1, n / std::max<size_t>(1, per_face));
    const auto middle = [&](size_t t) {
      int a, b, c;
      mesh->Triangle(int(t) + 1).Get(a, b, c);
      return gp_Pnt2d((mesh->UVNode(a).XY() + mesh->UVNode(b).XY() + mesh->UVNode(c).XY()) / 3.);
    };
    const auto add = [&](const gp_Pnt2d& uv) {
      const gp_Pnt p = surface.Value(uv.X(), uv.Y());
      out.push_back(p.X());
      out.push_back(p.Y());
      out.push_back(p.Z());
    };
    const size_t before = out.size();
    for (size_t first = 0; first < n; first += step)
      for (size_t t = first; t < std::min(n, first + step); ++t)
        if (trimming.Perform(middle(t)) == TopAbs_IN) {
          add(middle(t));
          break;
        }
    if (out.size() == before)
      for (size_t t = 0; t < n; t += step) add(middle(t));
  }
  return out;
}

}  // namespace grassfire
