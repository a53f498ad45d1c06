use super::*;
use crate::monitor::Warning;
use crate::remesh::ChangeKind;
use crate::topology::{Betti, SurfaceTopology};

fn report() -> Report {
    let betti = Betti::from_chi(1, 0, -2);
    let mut report = Report {
        version: "0.1.0".to_owned(),
        command: "grassfire reconstruct <part>.stl".to_owned(),
        inputs: vec![InputFile {
            path: "in/part & <b>.stl".to_owned(),
            sha256: "00ff".to_owned(),
        }],
        input: Some(InputBlock {
            triangles: 12,
            volume: 8.0,
            ..InputBlock::default()
        }),
        remesh: Some(RemeshBlock {
            voxel: 1.25,
            changes: vec![TopologyChangeEntry {
                kind: ChangeKind::TunnelClosed,
                place: [1.0, 2.0, 3.0],
                size: 0.5,
            }],
            ..RemeshBlock::default()
        }),
        topology: Some(TopologyBlock {
            solid: betti,
            complex: betti,
            skeleton: betti,
            body: vec![SurfaceTopology {
                chi: -4,
                genus: 3,
                closed: true,
                manifold: true,
            }],
            united: None,
        }),
        skeleton: Some(SkeletonBlock::default()),
        body: Some(BodyBlock::default()),
        solid: Some(SolidBlock {
            valid: true,
            bodies: 1,
            faces: 6,
            volume: 8.0,
            ..SolidBlock::default()
        }),
        distance: Some(DistanceBlock {
            rms: 0.4,
            p95: 1.0,
            max: 2.0,
            voxel: 1.25,
            non_design_max: Some(1e-9),
        }),
        volume: Some(VolumeBlock {
            proposal: 8.0,
            solid: 8.1,
            relative_difference: 0.0125,
        }),
        non_design: vec![NonDesignBlock {
            name: "eye".to_owned(),
            kept: true,
            ..NonDesignBlock::default()
        }],
        stages: vec![StageEntry {
            name: "remesh".to_owned(),
            seconds: 1.0,
            peak_memory: 100.0,
            cached: false,
        }],
        warnings: vec![Warning {
            stage: "medial".to_owned(),
            text: "<script>alert(1)</script>".to_owned(),
        }],
        papers: vec!["yan2018".to_owned()],
        ..Report::default()
    };
    report.checks = judge(&report, &Limits::default());
    report
}

fn verdict(report: &Report, name: &str) -> Option<bool> {
    judge(report, &Limits::default())
        .iter()
        .find(|check| check.name == name)
        .map(|check| check.met)
}

#[test]
fn good_report_meets_all_checks() {
    let report = report();
    let missed: Vec<&Check> = report.checks.iter().filter(|check| !check.met).collect();
    assert!(missed.is_empty(), "{missed:?}");
    assert!(report.checks.len() >= 12);
}

#[test]
fn a_file_that_was_refused_misses_a_check() {
    let mut report = report();
    assert_eq!(verdict(&report, "files"), None);
    report.refused.push(RefusedFile::default());
    assert_eq!(verdict(&report, "files"), Some(false));
}

#[test]
fn each_defect_misses_its_check() {
    type Damage = fn(&mut Report);
    let cases: [(&str, Damage); 9] = [
        ("topology.skeleton", |r| {
            r.topology.iter_mut().for_each(|t| t.skeleton.b1 += 1)
        }),
        ("topology.body", |r| {
            r.topology.iter_mut().for_each(|t| t.body[0].chi = 2)
        }),
        ("topology.body.closed", |r| {
            r.topology
                .iter_mut()
                .for_each(|t| t.body[0].manifold = false)
        }),
        ("body.self_intersections", |r| {
            r.body.iter_mut().for_each(|b| b.self_intersections = 2)
        }),
        ("solid.valid", |r| {
            r.solid.iter_mut().for_each(|s| s.valid = false)
        }),
        ("solid.bodies", |r| {
            r.solid.iter_mut().for_each(|s| s.bodies = 2)
        }),
        ("solid.g1_max", |r| {
            r.solid.iter_mut().for_each(|s| s.g1_max = f64::NAN)
        }),
        ("distance.rms", |r| {
            r.distance.iter_mut().for_each(|d| d.rms = 0.7)
        }),
        ("volume.relative_difference", |r| {
            r.volume
                .iter_mut()
                .for_each(|v| v.relative_difference = -0.03)
        }),
    ];
    for (name, damage) in cases {
        let mut report = report();
        assert_eq!(verdict(&report, name), Some(true), "{name}");
        damage(&mut report);
        assert_eq!(verdict(&report, name), Some(false), "{name}");
    }
}

#[test]
fn json_has_the_agreed_keys_and_no_null() {
    let mut report = report();
    report
        .solid
        .iter_mut()
        .for_each(|s| s.g1_max = f64::INFINITY);
    report
        .remesh
        .iter_mut()
        .for_each(|r| r.changes[0].place[1] = f64::NAN);
    let text = to_json(&report).expect("writes");
    assert!(!text.contains("null") && !text.contains("NaN"));
    let json: Value = serde_json::from_str(&text).expect("parses");
    let keys = [
        "/version",
        "/command",
        "/inputs/0/sha256",
        "/input/non_manifold_edges",
        "/input/repairs",
        "/remesh/genus_after",
        "/remesh/changes/0/size",
        "/topology/solid/b1",
        "/topology/complex/chi",
        "/topology/body/0/manifold",
        "/skeleton/regular_fraction",
        "/skeleton/corner_deviation/p95",
        "/skeleton/radius/median",
        "/body/self_intersections",
        "/solid/volume_check",
        "/distance/non_design_max",
        "/volume/relative_difference",
        "/non_design/0/kept",
        "/stages/0/peak_memory",
        "/warnings/0/text",
    ];
    for key in keys {
        assert!(json.pointer(key).is_some(), "{key} is missing");
    }
    assert_eq!(json["remesh"]["changes"][0]["kind"], "tunnel_closed");
    assert!(
        json.pointer("/solid/g1_max").is_none()
            && json.pointer("/remesh/changes/0/place").is_none()
    );
}

#[test]
fn blocks_of_stages_that_did_not_run_are_absent() {
    let text = to_json(&Report::default()).expect("writes");
    for key in ["input", "remesh", "topology", "solid", "non_design"] {
        assert!(!text.contains(&format!("\"{key}\"")), "{key}");
    }
}

#[test]
fn html_is_one_escaped_file() {
    let picture = Picture {
        title: "a\"b".to_owned(),
        caption: "<i>".to_owned(),
        png: vec![1, 2, 3],
    };
    let page = to_html(&report(), &[picture]);
    assert!(!page.contains("<script") && !page.contains("<i>"));
    assert!(
        page.contains("part &amp; &lt;b&gt;.stl") && page.contains("data:image/png;base64,AQID")
    );
    assert!(
        page.contains("checks met")
            && page.contains("tunnel closed")
            && page.contains("Voxel cores")
    );
    for resource in ["src=\"http", "<link", "@import", "url("] {
        assert!(!page.contains(resource), "{resource}");
    }
    assert!(to_html(&Report::default(), &[]).contains("nothing was checked"));
}

#[test]
fn options_are_one_table() {
    let options: ReportOptions =
        serde_json::from_str(r#"{"limits":{"volume":0.05}}"#).expect("reads");
    assert_eq!(options.limits.volume, 0.05);
    assert_eq!(options.picture_size().height, 750);
    assert!(serde_json::from_str::<ReportOptions>(r#"{"picture":1}"#).is_err());
}
