// Booleans with one intersection (pave filler) shared by the operation and the common part, face history and warnings.
#include "grassfire-occt/cpp/bridge.h"
#include "grassfire-occt/src/ffi.rs.h"

#include <limits>
#include <sstream>
#include <stdexcept>

#include <BOPAlgo_BOP.hxx>
#include <BOPAlgo_PaveFiller.hxx>
#include <Message_ProgressIndicator.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopTools_ListOfShape.hxx>

namespace grassfire {
namespace {

// Asks Rust between the steps of OCCT whether to stop.
class Watch : public Message_ProgressIndicator {
 public:
  explicit Watch(const Interrupt& interrupt) : interrupt_(interrupt) {}
  Standard_Boolean UserBreak() override { return interrupt_.interrupted(); }
  void Show(const Message_ProgressScope&, const Standard_Boolean) override {}

 private:
  const Interrupt& interrupt_;
};

TopTools_ListOfShape solids_of(const TopoDS_Shape& shape) {
  TopTools_ListOfShape out;
  for (TopExp_Explorer at(shape, TopAbs_SOLID); at.More(); at.Next()) out.Append(at.Current());
  return out;
}

void collect(const BOPAlgo_Options& algorithm, std::ostringstream& warnings) {
  if (algorithm.HasErrors()) {
    std::ostringstream text;
    algorithm.DumpErrors(text);
    throw std::runtime_error("boolean operation failed: " + text.str());
  }
  if (algorithm.HasWarnings()) algorithm.DumpWarnings(warnings);
}

void configure(BOPAlgo_BOP& algorithm, BOPAlgo_Operation operation, const TopTools_ListOfShape& objects, const TopTools_ListOfShape& tools) {
  algorithm.SetArguments(objects);
  for (const TopoDS_Shape& tool : tools) algorithm.AddTool(tool);
  algorithm.SetOperation(operation);
  algorithm.SetRunParallel(false);
  algorithm.SetNonDestructive(true);
}

// For each face of the result: i when it comes from face i of the objects, -(i + 1) when from face i of the tools.
// The tools win where both contribute (coincident faces): they are the exact, named side.
void trace(BOPAlgo_BOP& algorithm, const TopoDS_Shape& argument, bool is_tool, const TopTools_IndexedMapOfShape& result, std::vector<int32_t>& origins) {
  TopTools_IndexedMapOfShape from;
  TopExp::MapShapes(argument, TopAbs_FACE, from);
  for (int i = 1; i <= from.Extent(); ++i) {
    const int32_t code = is_tool ? -i : i - 1;
    const TopTools_ListOfShape& images = algorithm.Modified(from(i));
    if (images.IsEmpty()) {
      const int at = result.FindIndex(from(i));
      if (at > 0) origins[at - 1] = code;
    }
    for (const TopoDS_Shape& image : images) {
      const int at = result.FindIndex(image);
      if (at > 0) origins[at - 1] = code;
    }
  }
}

}  // namespace

std::unique_ptr<Boolean> boolean(int32_t operation, const Shape& objects, const Shape& tools, double fuzzy, bool with_common,
                                 const Interrupt& interrupt) {
  static const BOPAlgo_Operation operations[] = {BOPAlgo_FUSE, BOPAlgo_CUT, BOPAlgo_COMMON};
  if (operation < 0 || operation > 2) throw std::runtime_error("no such boolean operation");
  const TopTools_ListOfShape left = solids_of(objects.shape), right = solids_of(tools.shape);
  if (left.IsEmpty() || right.IsEmpty()) throw std::runtime_error("a boolean operation needs solids on both sides");
  TopTools_ListOfShape all(left);
  for (const TopoDS_Shape& s : right) all.Append(s);

  Handle(Watch) watch = new Watch(interrupt);
  Message_ProgressScope scope(watch->Start(), "boolean", 3);
  std::ostringstream warnings;
  BOPAlgo_PaveFiller filler;
  filler.SetArguments(all);
  filler.SetFuzzyValue(fuzzy);
  filler.SetRunParallel(false);
  filler.SetNonDestructive(true);
  // Oriented boxes take longer to make than they save: two thirds of the faces are near no tool anyway.
  filler.SetUseOBB(false);
  filler.Perform(scope.Next());
  if (watch->UserBreak()) throw std::runtime_error("interrupted");
  collect(filler, warnings);

  auto out = std::make_unique<Boolean>();
  BOPAlgo_BOP algorithm;
  configure(algorithm, operations[operation], left, right);
  algorithm.PerformWithFiller(filler, scope.Next());
  if (watch->UserBreak()) throw std::runtime_error("interrupted");
  collect(algorithm, warnings);
  out->result = algorithm.Shape();
  if (out->result.IsNull()) throw std::runtime_error("boolean operation gave nothing");

  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(out->result, TopAbs_FACE, faces);
  out->origins.assign(size_t(faces.Extent()), std::numeric_limits<int32_t>::min());
  trace(algorithm, objects.shape, false, faces, out->origins);
  trace(algorithm, tools.shape, true, faces, out->origins);

  if (with_common) {
    BOPAlgo_BOP common;
    configure(common, BOPAlgo_COMMON, left, right);
    common.PerformWithFiller(filler, scope.Next());
    if (watch->UserBreak()) throw std::runtime_error("interrupted");
    collect(common, warnings);
    out->common = common.Shape();
  }
  out->warnings = warnings.str();
  return out;
}

std::unique_ptr<Shape> boolean_result(const Boolean& boolean) {
  auto out = std::make_unique<Shape>();
  out->shape = boolean.result;
  return out;
}

std::unique_ptr<Shape> boolean_common(const Boolean& boolean) {
  if (boolean.common.IsNull()) throw std::runtime_error("the common part was not asked for");
  auto out = std::make_unique<Shape>();
  out->shape = boolean.common;
  return out;
}

rust::String boolean_warnings(const Boolean& boolean) { return rust::String::lossy(boolean.warnings); }

rust::Vec<int32_t> boolean_origins(const Boolean& boolean) {
  rust::Vec<int32_t> out;
  for (int32_t o : boolean.origins) out.push_back(o);
  return out;
}

}  // namespace grassfire
