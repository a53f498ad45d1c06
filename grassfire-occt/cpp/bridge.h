// Declarations of the bridge between Rust and OpenCASCADE.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Standard_Failure.hxx>
#include <Standard_Type.hxx>
#include <TopoDS_Shape.hxx>

#include "rust/cxx.h"

// cxx turns std::exception into a Rust error. Before OCCT 8 Standard_Failure is not one, and a foreign exception
// that crosses into Rust would end the process, so everything is caught here, for every function of the bridge.
namespace rust {
namespace behavior {
template <typename Try, typename Fail>
static void trycatch(Try&& call, Fail&& fail) noexcept {
  try {
    call();
  } catch (const Standard_Failure& e) {
    const char* text = e.GetMessageString();
    fail(std::string(e.DynamicType()->Name()) + ": " + (text ? text : ""));
  } catch (const std::exception& e) {
    fail(std::string(e.what()));
  } catch (...) {
    fail(std::string("unknown C++ exception"));
  }
}
}  // namespace behavior
}  // namespace rust

namespace grassfire {

struct Counts;
struct FaceInfo;
struct EdgeInfo;
struct Triangulation;
struct LineHit;
struct StepNames;
struct StepContents;
struct BrepData;
struct Interrupt;

struct Shape {
  TopoDS_Shape shape;
};

struct Boolean {
  TopoDS_Shape result;
  TopoDS_Shape common;
  std::string warnings;
  std::vector<int32_t> origins;
};

struct Filleted {
  TopoDS_Shape result;
  std::vector<int32_t> origins;
};

rust::String occt_version();
void silence();

// build.cpp
std::unique_ptr<Shape> build_brep(const BrepData& data);
std::unique_ptr<Shape> build_faceted(rust::Slice<const double> points, rust::Slice<const uint32_t> triangles);
std::unique_ptr<Shape> make_cylinder(rust::Slice<const double> start, rust::Slice<const double> axis, double radius, double height);
std::unique_ptr<Shape> make_box(rust::Slice<const double> low, rust::Slice<const double> high);
std::unique_ptr<Shape> make_revolve(rust::Slice<const double> origin, rust::Slice<const double> axis, rust::Slice<const double> profile);
std::unique_ptr<Shape> make_compound();
void add_to_compound(Shape& compound, const Shape& part);
std::unique_ptr<Shape> share(const Shape& shape);
std::unique_ptr<Shape> translated(const Shape& shape, rust::Slice<const double> by);
std::unique_ptr<Shape> unified(const Shape& shape);

// boolean.cpp
std::unique_ptr<Boolean> boolean(int32_t operation, const Shape& objects, const Shape& tools, double fuzzy, bool with_common,
                                 const Interrupt& interrupt);
std::unique_ptr<Shape> boolean_result(const Boolean& boolean);
std::unique_ptr<Shape> boolean_common(const Boolean& boolean);
rust::String boolean_warnings(const Boolean& boolean);
rust::Vec<int32_t> boolean_origins(const Boolean& boolean);

// fillet.cpp
rust::Vec<uint32_t> fillet_contour(const Shape& shape, uint32_t edge);
std::unique_ptr<Filleted> fillet(const Shape& shape, rust::Slice<const uint32_t> starts, rust::Slice<const double> radii, double seconds,
                                 const Interrupt& interrupt);
std::unique_ptr<Shape> fillet_result(const Filleted& filleted);
rust::Vec<int32_t> fillet_origins(const Filleted& filleted);

// query.cpp
rust::String faults(const Shape& shape);
Counts counts(const Shape& shape);
std::unique_ptr<Shape> solid(const Shape& shape, size_t index);
double volume(const Shape& shape, double eps);
rust::Vec<double> face_volumes(const Shape& shape, double eps, const Shape& known, rust::Slice<const double> known_volumes);
double area(const Shape& shape, double eps);
double max_tolerance(const Shape& shape);
rust::Vec<FaceInfo> faces(const Shape& shape);
rust::Vec<EdgeInfo> edges(const Shape& shape);
rust::Vec<double> bounds(const Shape& shape);
rust::Vec<LineHit> line_hits(const Shape& shape, rust::Slice<const double> lines);
rust::Vec<uint8_t> contains(const Shape& shape, rust::Slice<const double> points);
rust::Vec<double> distances(const Shape& shape, rust::Slice<const double> points);
rust::Vec<double> face_samples(const Shape& shape, rust::Slice<const uint32_t> faces, size_t per_face);

// exchange.cpp
std::unique_ptr<Shape> read_step(rust::Str path);
void write_step(const Shape& shape, rust::Str path, const StepNames& names);
StepContents step_contents(rust::Str path);
std::unique_ptr<Shape> read_brep(rust::Str path);
void write_brep(const Shape& shape, rust::Str path);
std::unique_ptr<Shape> read_iges(rust::Str path);
void write_iges(const Shape& shape, rust::Str path, const StepNames& names);

// tessellate.cpp
Triangulation tessellate(const Shape& shape, double chord, double angle, rust::Slice<const uint32_t> fine, double fine_chord, double fine_angle);

}  // namespace grassfire
