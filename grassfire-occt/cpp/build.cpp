// Shapes from plain numbers: the direct B-rep, faceted solids and primitives.
#include "grassfire-occt/cpp/bridge.h"
#include "grassfire-occt/src/ffi.rs.h"

#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepBuilderAPI_Transform.hxx>
#include <BRepLib.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeRevol.hxx>
#include <BRep_Builder.hxx>
#include <Geom2d_Line.hxx>
#include <Geom_BSplineCurve.hxx>
#include <Geom_BSplineSurface.hxx>
#include <Geom_Line.hxx>
#include <Geom_Plane.hxx>
#include <ShapeUpgrade_UnifySameDomain.hxx>
#include <gp_Pln.hxx>
#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColgp_Array1OfPnt.hxx>
#include <TColgp_Array2OfPnt.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Compound.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Shell.hxx>
#include <TopoDS_Solid.hxx>
#include <TopoDS_Vertex.hxx>
#include <TopoDS_Wire.hxx>

namespace grassfire {
namespace {

const double kTolerance = 1e-7;
const int kDegree = 5;

gp_Pnt point(rust::Slice<const double> v, size_t i) { return gp_Pnt(v[3 * i], v[3 * i + 1], v[3 * i + 2]); }

gp_Dir direction(rust::Slice<const double> v) { return gp_Dir(v[0], v[1], v[2]); }

std::unique_ptr<Shape> wrap(const TopoDS_Shape& shape) {
  if (shape.IsNull()) throw std::runtime_error("the result is empty");
  auto out = std::make_unique<Shape>();
  out->shape = shape;
  return out;
}

// Knots 0..spans, C1 inside (multiplicity 4 of degree 5), clamped at the ends.
void fill_knots(int spans, TColStd_Array1OfReal& knots, TColStd_Array1OfInteger& multiplicities) {
  for (int i = 0; i <= spans; ++i) {
    knots.SetValue(i + 1, i);
    multiplicities.SetValue(i + 1, (i == 0 || i == spans) ? kDegree + 1 : kDegree - 1);
  }
}

Handle(Geom_BSplineSurface) surface(int wide, int high, rust::Slice<const double> control, size_t first) {
  const int nu = 4 * wide + 2, nv = 4 * high + 2;
  TColgp_Array2OfPnt poles(1, nu, 1, nv);
  size_t at = first;
  for (int i = 1; i <= nu; ++i)
    for (int j = 1; j <= nv; ++j) poles.SetValue(i, j, point(control, at++));
  TColStd_Array1OfReal ku(1, wide + 1), kv(1, high + 1);
  TColStd_Array1OfInteger mu(1, wide + 1), mv(1, high + 1);
  fill_knots(wide, ku, mu);
  fill_knots(high, kv, mv);
  return new Geom_BSplineSurface(poles, ku, kv, mu, mv, kDegree, kDegree);
}

Handle(Geom_BSplineCurve) curve(int spans, rust::Slice<const double> control, size_t first) {
  const int n = 4 * spans + 2;
  TColgp_Array1OfPnt poles(1, n);
  for (int i = 0; i < n; ++i) poles.SetValue(i + 1, point(control, first + i));
  TColStd_Array1OfReal knots(1, spans + 1);
  TColStd_Array1OfInteger multiplicities(1, spans + 1);
  fill_knots(spans, knots, multiplicities);
  return new Geom_BSplineCurve(poles, knots, multiplicities, kDegree);
}

struct EdgeMaker {
  BRep_Builder builder;
  std::vector<TopoDS_Vertex> vertices;
  std::vector<TopoDS_Edge> edges;
  std::vector<double> length;  // parameter range
};

void make_edges(const BrepData& data, EdgeMaker& out) {
  rust::Slice<const double> vertices(data.vertices.data(), data.vertices.size());
  rust::Slice<const double> control(data.edge_control.data(), data.edge_control.size());
  for (size_t i = 0; i < data.vertices.size() / 3; ++i) {
    TopoDS_Vertex v;
    out.builder.MakeVertex(v, point(vertices, i), kTolerance);
    out.vertices.push_back(v);
  }
  size_t at = 0;
  for (size_t e = 0; e + 2 < data.edges.size(); e += 3) {
    const int spans = int(data.edges[e + 2]);
    TopoDS_Edge edge;
    out.builder.MakeEdge(edge, curve(spans, control, at), kTolerance);
    out.builder.Add(edge, out.vertices.at(data.edges[e]).Oriented(TopAbs_FORWARD));
    out.builder.Add(edge, out.vertices.at(data.edges[e + 1]).Oriented(TopAbs_REVERSED));
    out.builder.Range(edge, 0., double(spans));
    out.edges.push_back(edge);
    out.length.push_back(spans);
    at += size_t(4 * spans + 2);
  }
}

// Curve and pcurve run at the same speed (parameter = number of cells), so SameParameter holds exactly.
TopoDS_Face make_face(const BrepData& data, EdgeMaker& maker, size_t face, size_t first_control, size_t first_use) {
  rust::Slice<const double> control(data.face_control.data(), data.face_control.size());
  BRep_Builder& builder = maker.builder;
  TopoDS_Face out;
  builder.MakeFace(out, surface(int(data.faces[3 * face]), int(data.faces[3 * face + 1]), control, first_control), kTolerance);
  TopoDS_Wire wire;
  builder.MakeWire(wire);
  for (size_t k = first_use; k < first_use + data.faces[3 * face + 2]; ++k) {
    TopoDS_Edge& edge = maker.edges.at(data.uses[2 * k]);
    const double* uv = &data.use_uv[4 * k];
    Handle(Geom2d_Line) line = new Geom2d_Line(gp_Pnt2d(uv[0], uv[1]), gp_Dir2d(uv[2] - uv[0], uv[3] - uv[1]));
    builder.UpdateEdge(edge, line, out, kTolerance);
    builder.Range(edge, out, 0., maker.length.at(data.uses[2 * k]));
    builder.Add(wire, edge.Oriented(data.uses[2 * k + 1] ? TopAbs_REVERSED : TopAbs_FORWARD));
  }
  wire.Closed(true);
  builder.Add(out, wire);
  builder.NaturalRestriction(out, true);
  return out;
}

}  // namespace

std::unique_ptr<Shape> build_brep(const BrepData& data) {
  EdgeMaker maker;
  make_edges(data, maker);
  std::vector<TopoDS_Face> faces;
  size_t control = 0, use = 0;
  for (size_t f = 0; f < data.faces.size() / 3; ++f) {
    faces.push_back(make_face(data, maker, f, control, use));
    control += size_t(4 * data.faces[3 * f] + 2) * size_t(4 * data.faces[3 * f + 1] + 2);
    use += data.faces[3 * f + 2];
  }
  for (TopoDS_Edge& edge : maker.edges) {
    maker.builder.SameRange(edge, true);
    maker.builder.SameParameter(edge, true);
  }
  TopoDS_Compound all;
  maker.builder.MakeCompound(all);
  size_t at = 0, shell_at = 0;
  for (uint32_t shells : data.solids) {
    TopoDS_Solid solid;
    maker.builder.MakeSolid(solid);
    for (uint32_t s = 0; s < shells; ++s) {
      TopoDS_Shell shell;
      maker.builder.MakeShell(shell);
      for (uint32_t k = 0; k < data.shells[shell_at]; ++k) maker.builder.Add(shell, faces.at(data.shell_faces[at++]));
      ++shell_at;
      shell.Closed(true);
      maker.builder.Add(solid, shell);
    }
    maker.builder.Add(all, solid);
  }
  return wrap(all);
}

std::unique_ptr<Shape> build_faceted(rust::Slice<const double> points, rust::Slice<const uint32_t> triangles) {
  BRep_Builder builder;
  std::vector<TopoDS_Vertex> vertices(points.size() / 3);
  std::map<std::pair<uint32_t, uint32_t>, TopoDS_Edge> edges;
  for (size_t i = 0; i < vertices.size(); ++i) builder.MakeVertex(vertices[i], point(points, i), kTolerance);
  TopoDS_Shell shell;
  builder.MakeShell(shell);
  for (size_t t = 0; t + 2 < triangles.size(); t += 3) {
    const gp_Pnt a = point(points, triangles[t]), b = point(points, triangles[t + 1]), c = point(points, triangles[t + 2]);
    const gp_Vec normal = gp_Vec(a, b).Crossed(gp_Vec(a, c));
    Handle(Geom_Plane) plane = new Geom_Plane(gp_Ax3(a, gp_Dir(normal), gp_Dir(gp_Vec(a, b))));
    TopoDS_Face face;
    builder.MakeFace(face, plane, kTolerance);
    TopoDS_Wire wire;
    builder.MakeWire(wire);
    for (int k = 0; k < 3; ++k) {
      uint32_t from = triangles[t + k], to = triangles[t + (k + 1) % 3];
      const bool against = from > to;
      if (against) std::swap(from, to);
      TopoDS_Edge& edge = edges[{from, to}];
      if (edge.IsNull()) {
        const gp_Pnt p = point(points, from), q = point(points, to);
        builder.MakeEdge(edge, new Geom_Line(p, gp_Dir(gp_Vec(p, q))), kTolerance);
        builder.Add(edge, vertices.at(from).Oriented(TopAbs_FORWARD));
        builder.Add(edge, vertices.at(to).Oriented(TopAbs_REVERSED));
        builder.Range(edge, 0., p.Distance(q));
      }
      builder.Add(wire, edge.Oriented(against ? TopAbs_REVERSED : TopAbs_FORWARD));
    }
    wire.Closed(true);
    builder.Add(face, wire);
    builder.Add(shell, face);
  }
  shell.Closed(true);
  TopoDS_Solid solid;
  builder.MakeSolid(solid);
  builder.Add(solid, shell);
  return wrap(solid);
}

std::unique_ptr<Shape> make_cylinder(rust::Slice<const double> start, rust::Slice<const double> axis, double radius, double height) {
  return wrap(BRepPrimAPI_MakeCylinder(gp_Ax2(point(start, 0), direction(axis)), radius, height).Shape());
}

std::unique_ptr<Shape> make_box(rust::Slice<const double> low, rust::Slice<const double> high) {
  return wrap(BRepPrimAPI_MakeBox(point(low, 0), point(high, 0)).Shape());
}

// `profile`: (radius, height) pairs of a closed polygon in the half plane radius >= 0.
std::unique_ptr<Shape> make_revolve(rust::Slice<const double> origin, rust::Slice<const double> axis, rust::Slice<const double> profile) {
  const gp_Ax2 frame(point(origin, 0), direction(axis));
  const gp_Vec out(frame.XDirection()), up(frame.Direction());
  std::vector<TopoDS_Vertex> corners;
  BRep_Builder builder;
  for (size_t i = 0; i + 1 < profile.size(); i += 2) {
    TopoDS_Vertex v;
    builder.MakeVertex(v, point(origin, 0).Translated(out * profile[i] + up * profile[i + 1]), kTolerance);
    corners.push_back(v);
  }
  BRepBuilderAPI_MakeWire wire;
  for (size_t i = 0; i < corners.size(); ++i) wire.Add(BRepBuilderAPI_MakeEdge(corners[i], corners[(i + 1) % corners.size()]).Edge());
  const gp_Pln plane(gp_Ax3(point(origin, 0), gp_Dir(out.Crossed(up)), gp_Dir(out)));
  TopoDS_Shape solid = BRepPrimAPI_MakeRevol(BRepBuilderAPI_MakeFace(plane, wire.Wire()).Face(), frame.Axis()).Shape();
  if (solid.ShapeType() == TopAbs_SOLID) {
    TopoDS_Solid closed = TopoDS::Solid(solid);
    BRepLib::OrientClosedSolid(closed);
    solid = closed;
  }
  return wrap(solid);
}

std::unique_ptr<Shape> make_compound() {
  TopoDS_Compound compound;
  BRep_Builder().MakeCompound(compound);
  return wrap(compound);
}

void add_to_compound(Shape& compound, const Shape& part) { BRep_Builder().Add(compound.shape, part.shape); }

std::unique_ptr<Shape> share(const Shape& shape) { return wrap(shape.shape); }

std::unique_ptr<Shape> translated(const Shape& shape, rust::Slice<const double> by) {
  gp_Trsf move;
  move.SetTranslation(gp_Vec(by[0], by[1], by[2]));
  return wrap(BRepBuilderAPI_Transform(shape.shape, move, true).Shape());
}

std::unique_ptr<Shape> unified(const Shape& shape) {
  ShapeUpgrade_UnifySameDomain unify(shape.shape, true, true, false);
  unify.Build();
  return wrap(unify.Shape());
}

}  // namespace grassfire
