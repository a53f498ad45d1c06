// Triangulates points (little-endian f64 x y z) with CGAL; prints "<points> <cells> <CPU seconds>".
// Built and run by run.sh; a peer for benches/medial.rs, no part of grassfire.
#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <cstdio>
#include <ctime>
#include <vector>

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Delaunay = CGAL::Delaunay_triangulation_3<Kernel>;

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  std::FILE* file = std::fopen(argv[1], "rb");
  if (!file) return 2;
  std::vector<Kernel::Point_3> points;
  double p[3];
  while (std::fread(p, sizeof(double), 3, file) == 3) points.emplace_back(p[0], p[1], p[2]);
  std::fclose(file);
  const std::clock_t start = std::clock();
  const Delaunay triangulation(points.begin(), points.end());
  const double seconds = double(std::clock() - start) / CLOCKS_PER_SEC;
  std::printf("%zu %zu %.4f\n", points.size(), std::size_t(triangulation.number_of_finite_cells()), seconds);
}
