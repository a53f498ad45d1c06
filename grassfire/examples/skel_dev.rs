use grassfire::{Vec3, medial::MedialMesh, monitor::Monitor, skeleton::*};
use std::fmt::Write;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let text = std::fs::read_to_string(&a[1]).unwrap();
    let mut m = MedialMesh::default();
    for l in text.lines() {
        let w: Vec<&str> = l.split_whitespace().collect();
        match w[0] {
            "v" => { let x: Vec<f64> = w[1..].iter().map(|s| s.parse().unwrap()).collect(); m.points.push(Vec3::new(x[0],x[1],x[2])); m.radii.push(x[3]); }
            "e" => m.edges.push([w[1].parse().unwrap(), w[2].parse().unwrap()]),
            "f" => m.triangles.push([w[1].parse().unwrap(), w[2].parse().unwrap(), w[3].parse().unwrap()]),
            _ => {}
        }
    }
    let mut o = serde_json::to_value(SkeletonOptions::default()).unwrap();
    for s in &a[4..] { let (k, v) = s.split_once('=').unwrap(); o[k] = serde_json::from_str(v).unwrap(); }
    let o: SkeletonOptions = serde_json::from_value(o).unwrap();
    let mon = Monitor::default();
    let t = std::time::Instant::now();
    let q = quad_skeleton(&m, a[3].parse().unwrap(), &o, &mon);
    eprintln!("time {:.2}", t.elapsed().as_secs_f64());
    let q = match q { Ok(q) => q, Err(e) => { eprintln!("ERROR {e}"); std::process::exit(1) } };
    eprintln!("{:?}\n{:?} {:?}", q.topology, q.stats, mon.warnings());
    let s = q.skeleton;
    let mut out = String::new();
    write!(out, "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nproperty double radius\nelement face {}\nproperty list uchar int vertex_indices\nelement edge {}\nproperty int vertex1\nproperty int vertex2\nend_header\n", s.points.len(), s.quads.len(), s.beams.len()).unwrap();
    for (p, r) in s.points.iter().zip(&s.radii) { writeln!(out, "{} {} {} {}", p.x, p.y, p.z, r).unwrap(); }
    for q in &s.quads { writeln!(out, "4 {} {} {} {}", q[0], q[1], q[2], q[3]).unwrap(); }
    for b in &s.beams { writeln!(out, "{} {}", b[0], b[1]).unwrap(); }
    std::fs::write(&a[2], out).unwrap();
}
