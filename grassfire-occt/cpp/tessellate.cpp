// Triangulation.
#include "grassfire-occt/cpp/bridge.h"
#include "grassfire-occt/src/ffi.rs.h"

#include <cmath>
#include <map>
#include <numeric>
#include <stdexcept>

#include <BRepMesh_IncrementalMesh.hxx>
#include <BRepTools.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Poly_PolygonOnTriangulation.hxx>
#include <Poly_Triangulation.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Compound.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Vertex.hxx>

namespace grassfire {
namespace {

class UnionFind {
 public:
  explicit UnionFind(size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), size_t(0)); }
  size_t find(size_t a) {
    while (parent_[a] != a) a = parent_[a] = parent_[parent_[a]];
    return a;
  }
  void join(size_t a, size_t b) {
    a = find(a), b = find(b);
    if (a != b) parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<size_t> parent_;
};

// Joins the nodes of neighbouring faces: by position along a shared edge and by shared vertex, never by distance.
void join_edges(const TopTools_IndexedMapOfShape& faces, const std::vector<size_t>& first_node, UnionFind& nodes) {
  TopTools_IndexedMapOfShape edges, vertices;
  std::map<std::pair<int, int>, size_t> edge_node;
  std::map<int, size_t> vertex_node;
  auto meet = [&](auto& map, const auto& key, size_t node) {
    const auto [at, is_new] = map.emplace(key, node);
    if (!is_new) nodes.join(at->second, node);
  };
  for (int f = 1; f <= faces.Extent(); ++f) {
    TopLoc_Location place;
    const Handle(Poly_Triangulation)& mesh = BRep_Tool::Triangulation(TopoDS::Face(faces(f)), place);
    if (mesh.IsNull()) continue;
    // FORWARD, so that the two sides of a seam edge give the two polygons of its closed surface.
    for (TopExp_Explorer at(faces(f).Oriented(TopAbs_FORWARD), TopAbs_EDGE); at.More(); at.Next()) {
      const TopoDS_Edge edge = TopoDS::Edge(at.Current());
      const Handle(Poly_PolygonOnTriangulation)& line = BRep_Tool::PolygonOnTriangulation(edge, mesh, place);
      if (line.IsNull()) throw std::runtime_error("an edge has no polygon on the triangulation of its face");
      const int e = edges.Add(edge), n = line->NbNodes();
      const int from = vertices.Add(TopExp::FirstVertex(edge)), to = vertices.Add(TopExp::LastVertex(edge));
      const bool collapsed = BRep_Tool::Degenerated(edge);
      for (int k = 1; k <= n; ++k) {
        const size_t node = first_node[size_t(f) - 1] + size_t(line->Node(k)) - 1;
        if (k == 1 || collapsed) meet(vertex_node, from, node);
        else if (k == n) meet(vertex_node, to, node);
        else meet(edge_node, std::make_pair(e, k), node);
      }
    }
  }
}

// Number of the first face that has no triangles, from 1; 0 when all have.
int without_triangles(const TopTools_IndexedMapOfShape& faces) {
  for (int f = 1; f <= faces.Extent(); ++f) {
    TopLoc_Location place;
    if (BRep_Tool::Triangulation(TopoDS::Face(faces(f)), place).IsNull()) return f;
  }
  return 0;
}

}  // namespace

// The faces `fine` first, finer; then the rest, which takes over the points on shared edges. A face that the mesher gives
// up on is tried again with all others at a smaller chord: neighbours must agree on the points of their edges.
Triangulation tessellate(const Shape& s, double chord, double angle, rust::Slice<const uint32_t> fine, double fine_chord, double fine_angle) {
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(s.shape, TopAbs_FACE, faces);
  TopoDS_Compound first;
  BRep_Builder builder;
  builder.MakeCompound(first);
  for (uint32_t f : fine) builder.Add(first, faces.FindKey(int(f) + 1));
  constexpr int tries = 4;
  for (int k = 0; k < tries; ++k) {
    BRepTools::Clean(s.shape);
    const double factor = std::pow(0.5, k);
    if (fine.size() > 0) BRepMesh_IncrementalMesh(first, factor * fine_chord, false, fine_angle, false);
    BRepMesh_IncrementalMesh(s.shape, factor * chord, false, angle, false);
    const int missing = without_triangles(faces);
    if (missing == 0) break;
    if (k + 1 == tries) throw std::runtime_error("face " + std::to_string(missing - 1) + " could not be triangulated");
  }
  std::vector<size_t> first_node;
  size_t total = 0;
  for (int f = 1; f <= faces.Extent(); ++f) {
    TopLoc_Location place;
    const Handle(Poly_Triangulation)& mesh = BRep_Tool::Triangulation(TopoDS::Face(faces(f)), place);
    first_node.push_back(total);
    total += size_t(mesh->NbNodes());
  }
  UnionFind nodes(total);
  join_edges(faces, first_node, nodes);

  Triangulation out;
  std::vector<uint32_t> number(total, UINT32_MAX);
  for (int f = 1; f <= faces.Extent(); ++f) {
    TopLoc_Location place;
    const Handle(Poly_Triangulation)& mesh = BRep_Tool::Triangulation(TopoDS::Face(faces(f)), place);
    const bool flip = faces(f).Orientation() == TopAbs_REVERSED;
    for (int t = 1; t <= mesh->NbTriangles(); ++t) {
      int local[3];
      mesh->Triangle(t).Get(local[0], local[1], local[2]);
      size_t root[3];
      for (int k = 0; k < 3; ++k) root[k] = nodes.find(first_node[size_t(f) - 1] + size_t(local[k]) - 1);
      if (root[0] == root[1] || root[1] == root[2] || root[2] == root[0]) continue;
      for (int k = 0; k < 3; ++k) {
        if (number[root[k]] == UINT32_MAX) {
          number[root[k]] = uint32_t(out.points.size() / 3);
          const gp_Pnt p = mesh->Node(local[k]).Transformed(place.Transformation());
          out.points.push_back(p.X());
          out.points.push_back(p.Y());
          out.points.push_back(p.Z());
        }
      }
      for (int k = 0; k < 3; ++k) out.triangles.push_back(number[root[flip ? 2 - k : k]]);
      out.faces.push_back(uint32_t(f) - 1);
    }
  }
  return out;
}

}  // namespace grassfire
