#[path = "../tests/thicken_support/mod.rs"]
mod support;
use grassfire::fit::{FitOptions, fit};
use grassfire::monitor::Monitor;
use grassfire::spline::ControlMesh;
use grassfire::thicken::{ThickenOptions, thicken};
use std::fmt::Write;
fn obj(m: &ControlMesh, path: &str) {
    let mut s = String::new();
    for p in &m.points { writeln!(s, "v {} {} {}", p.x, p.y, p.z).unwrap(); }
    for q in &m.quads { writeln!(s, "f {} {} {} {}", q[0] + 1, q[1] + 1, q[2] + 1, q[3] + 1).unwrap(); }
    std::fs::write(path, s).unwrap();
}
fn main() {
    let out = std::env::var("OUT").unwrap_or("/work/tmp/thicken_out".into());
    std::fs::create_dir_all(&out).unwrap();
    let mut o = FitOptions::default();
    let mut scale = 0.5;
    for a in std::env::args().skip(1) {
        if let Some((k, v)) = a.split_once('=') {
            match k { "lambda" => o.fairness = v.parse().unwrap(), "rounds" => o.rounds = v.parse().unwrap(), "un" => o.untangle_rounds = v.parse().unwrap(), "scale" => scale = v.parse().unwrap(), _ => panic!() }
            continue;
        }
        let dir = std::path::PathBuf::from(format!("/work/tmp/stages/simjeb_{a}"));
        let skeleton = support::read_skeleton(&dir.join("skeleton.ply"));
        let field = support::read_field(&dir);
        let monitor = Monitor::default();
        let body = thicken(&skeleton, &ThickenOptions { scale, ..Default::default() }, &monitor).unwrap();
        let t = std::time::Instant::now();
        let f = fit(&body, &skeleton, &field, &o, &monitor).unwrap();
        let h = field.spacing;
        println!("{a}: {:.1}s quads {} rms {:.3}/{:.3} p95 {:.2}/{:.2} max {:.2}/{:.2} vol {:.2}% pairs before {} left places {} {:?}", t.elapsed().as_secs_f64(), f.mesh.quads.len(), f.body_to_iso.rms / h, f.iso_to_body.rms / h, f.body_to_iso.p95 / h, f.iso_to_body.p95 / h, f.body_to_iso.max / h, f.iso_to_body.max / h, 100.0 * (f.volume / f.iso_volume - 1.0), f.pairs_before_untangling, f.self_intersections.len(), f.self_intersections.iter().map(|p| (p.place.map(|x| x.round()).as_slice().to_vec(), p.quads.len())).collect::<Vec<_>>());
        for u in &f.untangle_rounds { println!("   untangle pairs {} rms {:.3} vol {:.2}% {}", u.pairs, u.rms / h, 100.0 * (u.volume / f.iso_volume - 1.0), u.accepted); }
        if std::env::var("V").is_ok() { for r in &f.rounds { println!("   d {:.3} step {:.3}", r.mean_distance / h, r.step / h); } }
        obj(&body.mesh, &format!("{out}/{a}_body.obj"));
        obj(&f.mesh, &format!("{out}/{a}_fit.obj"));
    }
}
