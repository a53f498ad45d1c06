#[path = "../tests/thicken_support/mod.rs"]
mod support;
use grassfire::mesh::self_intersection::self_intersections;
use grassfire::monitor::Monitor;
use grassfire::spline::catmull_clark::limit_mesh;
use grassfire::thicken::{ThickenOptions, thicken};
fn main() {
    for a in ["398", "055", "576", "623"] {
        for scale in [1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.07] {
            let dir = std::path::PathBuf::from(format!("/work/tmp/stages/simjeb_{a}"));
            let skeleton = support::read_skeleton(&dir.join("skeleton.ply"));
            let body = thicken(&skeleton, &ThickenOptions { scale, ..Default::default() }, &Monitor::default()).unwrap();
            let (m, owner) = limit_mesh(&body.mesh, 2).unwrap();
            let t = std::time::Instant::now();
            let p = self_intersections(&m);
            let mut q: Vec<u32> = p.iter().flatten().map(|&t| owner[t as usize]).collect();
            q.sort(); q.dedup();
            println!("{a} scale {scale}: pairs {} quads {} {:.3}s", p.len(), q.len(), t.elapsed().as_secs_f64());
            if scale == 0.15 { for &i in &q { let c = body.mesh.quads[i as usize].map(|v| body.mesh.points[v as usize].map(|x| x.round())); println!("   {:?} {:?}", c[0].as_slice(), body.mesh.quads[i as usize].map(|v| body.source[v as usize])); } }
        }
    }
}
