//! Control mesh to patches, faces and triangles: exactness on closed shapes, random nets and real fitted bodies.

mod brep;
mod limit_surface;
mod patches;
mod shapes;
mod tessellation;
