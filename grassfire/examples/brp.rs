//! throw-away
use grassfire::{Vec3, monitor::Monitor, spline::*};
use std::fmt::Write;
fn main() {
    for p in std::env::args().skip(1) {
        let dir = format!("/work/tmp/stages/simjeb_{p}");
        let mut m = ControlMesh::default();
        for l in std::fs::read_to_string(format!("{dir}/fit.obj")).unwrap().lines() {
            let w: Vec<&str> = l.split_whitespace().collect();
            match w.first() {
                Some(&"v") => m.points.push(Vec3::new(w[1].parse().unwrap(), w[2].parse().unwrap(), w[3].parse().unwrap())),
                Some(&"f") => m.quads.push([1, 2, 3, 4].map(|k| w[k].split('/').next().unwrap().parse::<u32>().unwrap() - 1)),
                _ => {}
            }
        }
        let mon = Monitor::default();
        let t = std::time::Instant::now();
        let pt = patches(&m, &PatchOptions::default(), &mon).unwrap();
        let t1 = t.elapsed();
        let b = build_brep(&m, &pt, &BrepOptions::default(), &mon).unwrap();
        let t2 = t.elapsed();
        let g = g1_max(&m, &pt).unwrap();
        let t3 = t.elapsed();
        let te = tessellate(&m, &pt, &TessellateOptions::default()).unwrap();
        let t4 = t.elapsed();
        println!("{p} quads {} faces {} edges {} vertices {} shells {} volume {} area {} patches {t1:?} brep {:?} g1 {:?} {:?} tess {} tris {:?} tess volume {} {:?}", m.quads.len(), b.faces.len(), b.edges.len(), b.vertices.len(), b.shells.len(), b.volume, area(&pt), t2 - t1, t3 - t2, g, te.mesh.triangles.len(), t4 - t3, te.mesh.volume(), mon.warnings());
        println!("   spans max {:?} faces>4 edges {}", b.faces.iter().map(|f| f.spans).max_by_key(|s| s[0] * s[1]), b.faces.iter().filter(|f| f.uses.len() > 4).count());
        println!("   solid {:?}", grassfire::mesh::Solid::try_from(te.mesh.clone()).map(|s| s.euler()));
        let mut o = String::new();
        writeln!(o, "{} {} {} {}", b.vertices.len(), b.edges.len(), b.faces.len(), b.volume).unwrap();
        for v in &b.vertices { writeln!(o, "{} {} {}", v.x, v.y, v.z).unwrap(); }
        let pts = |o: &mut String, c: &[Vec3]| { for p in c { write!(o, "{} {} {} ", p.x, p.y, p.z).unwrap(); } o.push('\n'); };
        for e in &b.edges { writeln!(o, "{} {} {}", e.vertices[0], e.vertices[1], e.spans).unwrap(); pts(&mut o, &e.control); }
        for f in &b.faces {
            writeln!(o, "{} {} {}", f.spans[0], f.spans[1], f.uses.len()).unwrap(); pts(&mut o, &f.control);
            for u in &f.uses { writeln!(o, "{} {} {} {} {} {}", u.edge, u.reversed as u8, u.start[0], u.start[1], u.end[0], u.end[1]).unwrap(); }
        }
        std::fs::write(format!("{dir}/brep.brp"), o).unwrap();
    }
}
