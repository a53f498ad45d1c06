// Fillets of constant radius along edges, with the history of the faces.
#include "grassfire-occt/cpp/bridge.h"
#include "grassfire-occt/src/ffi.rs.h"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <BRepFilletAPI_MakeFillet.hxx>
#include <BRep_Tool.hxx>
#include <BinTools.hxx>
#include <Geom_BSplineSurface.hxx>
#include <TopExp.hxx>
#include <TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>

namespace grassfire {
namespace {

// The edges that `edges` lists, in its order.
std::vector<TopoDS_Edge> edges_of(const TopoDS_Shape& shape) {
  TopTools_IndexedDataMapOfShapeListOfShape map;
  TopExp::MapShapesAndAncestors(shape, TopAbs_EDGE, TopAbs_FACE, map);
  std::vector<TopoDS_Edge> out;
  for (int i = 1; i <= map.Extent(); ++i) {
    const TopoDS_Edge edge = TopoDS::Edge(map.FindKey(i));
    if (!BRep_Tool::Degenerated(edge)) out.push_back(edge);
  }
  return out;
}

// Control points of a face beyond which a fillet is no use to a designer: the kernel gives some thousands of knots where it hardly finds a
// way, and files of many megabytes.
constexpr int MOST_POLES = 1500;
constexpr int TOO_FINE = 2;

int poles(const TopoDS_Face& face) {
  Handle(Geom_BSplineSurface) surface = Handle(Geom_BSplineSurface)::DownCast(BRep_Tool::Surface(face));
  return surface.IsNull() ? 0 : surface->NbUPoles() * surface->NbVPoles();
}

// The fillets and where the faces come from, into a file; 0 when all went well. In a process of its own: the kernel may take hours for
// a fillet, or break down, and has no way to be asked to stop.
int write_fillet(const TopoDS_Shape& shape, rust::Slice<const uint32_t> starts, rust::Slice<const double> radii, double seconds, std::FILE* file) {
  try {
    const rlim_t most = rlim_t(std::max(1., std::min(seconds, 1e6)));
    const rlimit limit{most, most + 1}, none{0, 0};
    setrlimit(RLIMIT_CPU, &limit);
    setrlimit(RLIMIT_CORE, &none);
    std::signal(SIGXCPU, SIG_DFL);
    const std::vector<TopoDS_Edge> edges = edges_of(shape);
    BRepFilletAPI_MakeFillet maker(shape);
    for (size_t k = 0; k < starts.size(); ++k) {
      if (starts[k] >= edges.size()) return 1;
      maker.Add(radii[k], edges[starts[k]]);
    }
    maker.Build();
    if (!maker.IsDone()) return 1;
    const TopoDS_Shape result = maker.Shape();
    TopTools_IndexedMapOfShape before, after;
    TopExp::MapShapes(shape, TopAbs_FACE, before);
    TopExp::MapShapes(result, TopAbs_FACE, after);
    std::vector<int32_t> origins(size_t(after.Extent()), std::numeric_limits<int32_t>::min());
    for (int i = 1; i <= before.Extent(); ++i) {
      const int same = after.FindIndex(before(i));
      if (same > 0) origins[size_t(same) - 1] = i - 1;
      for (const TopoDS_Shape& image : maker.Modified(before(i))) {
        const int at = after.FindIndex(image);
        if (at > 0) origins[size_t(at) - 1] = i - 1;
      }
    }
    for (int i = 1; i <= after.Extent(); ++i)
      if (origins[size_t(i) - 1] < 0 && poles(TopoDS::Face(after(i))) > MOST_POLES) return TOO_FINE;
    std::ostringstream text;
    text << origins.size() << '\n';
    for (int32_t o : origins) text << o << '\n';
    BinTools::Write(result, text);
    const std::string bytes = text.str();
    return std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size() && std::fflush(file) == 0 ? 0 : 1;
  } catch (...) {
    return 1;
  }
}

// What `write_fillet` wrote.
std::unique_ptr<Filleted> read_fillet(std::FILE* file) {
  std::string bytes;
  std::rewind(file);
  std::vector<char> part(1 << 16);
  for (size_t n; (n = std::fread(part.data(), 1, part.size(), file)) > 0;) bytes.append(part.data(), n);
  std::istringstream text(bytes);
  size_t count = 0;
  text >> count;
  auto out = std::make_unique<Filleted>();
  for (size_t k = 0; k < count && text; ++k) {
    int32_t origin = 0;
    text >> origin;
    out->origins.push_back(origin);
  }
  text.get();
  BinTools::Read(out->result, text);
  TopTools_IndexedMapOfShape faces;
  if (!out->result.IsNull()) TopExp::MapShapes(out->result, TopAbs_FACE, faces);
  if (faces.IsEmpty() || size_t(faces.Extent()) != out->origins.size()) throw std::runtime_error("the kernel's fillet could not be read back");
  return out;
}

struct Closing {
  std::FILE* file;
  ~Closing() { std::fclose(file); }
};

}  // namespace

// Edges that run on smoothly from one: they get one fillet together.
rust::Vec<uint32_t> fillet_contour(const Shape& s, uint32_t edge) {
  const std::vector<TopoDS_Edge> edges = edges_of(s.shape);
  if (edge >= edges.size()) throw std::runtime_error("there is no such edge");
  BRepFilletAPI_MakeFillet maker(s.shape);
  maker.Add(edges[edge]);
  rust::Vec<uint32_t> out;
  if (maker.NbContours() < 1) return out;
  for (int k = 1; k <= maker.NbEdges(1); ++k)
    for (size_t i = 0; i < edges.size(); ++i)
      if (edges[i].IsSame(maker.Edge(1, k))) out.push_back(uint32_t(i));
  return out;
}

std::unique_ptr<Filleted> fillet(const Shape& s, rust::Slice<const uint32_t> starts, rust::Slice<const double> radii, double seconds,
                                 const Interrupt& interrupt) {
  if (starts.size() != radii.size() || starts.empty()) throw std::runtime_error("every fillet needs an edge and a radius");
  std::FILE* file = std::tmpfile();
  if (!file) throw std::runtime_error("no temporary file can be made");
  const Closing closing{file};
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("no process can be made");
  if (child == 0) _exit(write_fillet(s.shape, starts, radii, seconds, file));
  int status = 0;
  while (waitpid(child, &status, WNOHANG) == 0) {
    if (interrupt.interrupted()) {
      kill(child, SIGKILL);
      waitpid(child, &status, 0);
      throw std::runtime_error("interrupted");
    }
    usleep(2000);
  }
  if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL))
    throw std::runtime_error("the kernel took too long");
  if (!WIFEXITED(status)) throw std::runtime_error("the kernel broke down");
  if (WEXITSTATUS(status) == TOO_FINE) throw std::runtime_error("the kernel's fillet would have thousands of control points");
  if (WEXITSTATUS(status) != 0) throw std::runtime_error("the kernel found no fillet");
  return read_fillet(file);
}

std::unique_ptr<Shape> fillet_result(const Filleted& filleted) {
  auto out = std::make_unique<Shape>();
  out->shape = filleted.result;
  return out;
}

rust::Vec<int32_t> fillet_origins(const Filleted& filleted) {
  rust::Vec<int32_t> out;
  for (int32_t o : filleted.origins) out.push_back(o);
  return out;
}

}  // namespace grassfire
