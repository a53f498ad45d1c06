//! Mesh readers and writers on small files made here: what must load, and what each fault is told as.

use std::io::Write;

use grassfire::Vec3;
use grassfire::io::*;
use grassfire::mesh::TriMesh;
use grassfire::monitor::Monitor;

fn read(name: &str, bytes: &[u8]) -> Result<Input, IoError> {
    read_bytes(name, bytes, &ReadOptions::default(), &Monitor::default())
}

fn mesh(name: &str, bytes: &[u8]) -> TriMesh {
    match read(name, bytes) {
        Ok(Input::Mesh { mesh, .. }) => mesh,
        other => panic!("{name}: {other:?}"),
    }
}

fn refusal(name: &str, bytes: &[u8]) -> String {
    let error = read(name, bytes)
        .expect_err("this must be refused")
        .to_string();
    assert!(
        !error.contains('\n') && error.starts_with(name),
        "{error:?}"
    );
    error
}

/// A box of 1 x 2 x 3 mm in quads, outward.
const CORNERS: [[f64; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 2.0, 0.0],
    [0.0, 2.0, 0.0],
    [0.0, 0.0, 3.0],
    [1.0, 0.0, 3.0],
    [1.0, 2.0, 3.0],
    [0.0, 2.0, 3.0],
];
const QUADS: [[u32; 4]; 6] = [
    [0, 3, 2, 1],
    [4, 5, 6, 7],
    [0, 1, 5, 4],
    [1, 2, 6, 5],
    [2, 3, 7, 6],
    [3, 0, 4, 7],
];

fn block() -> TriMesh {
    let triangles = QUADS
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    TriMesh {
        points: CORNERS.map(Vec3::from).to_vec(),
        triangles,
        tags: vec![],
    }
}

fn is_block(mesh: &TriMesh) {
    assert_eq!(mesh.triangles.len(), 12);
    assert!(
        (mesh.volume() - 6.0).abs() < 1e-6,
        "volume {}",
        mesh.volume()
    );
}

fn obj_points() -> String {
    CORNERS
        .iter()
        .map(|[x, y, z]| format!("v {x} {y} {z}\n"))
        .collect()
}

#[test]
fn stl_binary_reads_back() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.stl");
    write_stl(&path, &block()).unwrap();
    match read_input(
        &path,
        &ReadOptions {
            scale: 10.0,
            ..ReadOptions::default()
        },
        &Monitor::default(),
    ) {
        Ok(Input::Mesh { mesh, notes }) => {
            assert!(notes.is_empty());
            assert!((mesh.volume() - 6000.0).abs() < 1e-6);
        }
        other => panic!("{other:?}"),
    }
    // The content counts, not the extension.
    is_block(&mesh("a.obj", &std::fs::read(&path).unwrap()));
}

#[test]
fn stl_text_in_all_its_dialects() {
    let mesh_of = |text: &str| mesh("a.stl", text.as_bytes());
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e0 0\nendloop\nendfacet\n";
    assert_eq!(
        mesh_of(&format!("solid facet of a cube\n{facet}endsolid\n"))
            .triangles
            .len(),
        1
    );
    assert_eq!(
        mesh_of(&format!(
            "\u{feff}  SOLID\r\n{}ENDSOLID",
            facet.to_uppercase().replace('\n', "\r\n")
        ))
        .triangles
        .len(),
        1
    );
    let nan = facet.replace("0 0 1\nouter", "-nan(ind) -1.#IND nan\nouter");
    assert_eq!(
        mesh_of(&format!("solid\n{nan}endsolid\n")).triangles.len(),
        1
    );
    let two = mesh_of(&format!(
        "solid a\n{facet}endsolid a\nsolid b\n{facet}endsolid b\n"
    ));
    assert_eq!(two.tags, [0, 1]);
    let comma = refusal(
        "a.stl",
        format!("solid\n{}", facet.replace("1e0", "1,5")).as_bytes(),
    );
    assert!(
        comma.contains("line 6") && comma.contains("decimal comma"),
        "{comma}"
    );
    let cut = refusal("a.stl", format!("solid\n{}", &facet[..60]).as_bytes());
    assert!(cut.contains("cut short"), "{cut}");
}

#[test]
fn obj_corner_forms_polygons_and_groups() {
    let faces = "g a\nf 1/1/1 4//2 3/1 2\nf -4 -3 -2 -1\no b\nf 1 2 6 \\\n5\nf 2 3 7 6 # side\nf 3 4 8 7\nf 4 1 5 8\n";
    let read = mesh(
        "a.obj",
        format!("# made by hand\n{}{faces}", obj_points()).as_bytes(),
    );
    is_block(&read);
    assert_eq!(read.tags, [1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2]);
    is_block(&mesh(
        "no_extension",
        format!("g a\n{faces}{}", obj_points())
            .replace("-4 -3 -2 -1", "5 6 7 8")
            .as_bytes(),
    ));
}

#[test]
fn obj_faults_name_their_line() {
    for (face, words) in [
        ("f 1 2 9", "index 9 but there are only 8 points"),
        ("f 1 2 4000000000", "index 4000000000"),
        ("f 0 1 2", "index 0"),
        ("f 1 2 -9", "index -9"),
        ("f 1 2", "needs 3 corners"),
        ("f 1 2 3/x", "not of the form"),
        ("v 1 2", "coordinate z is missing"),
        ("v 1 2 z", "not a number"),
    ] {
        let error = refusal(
            "a.obj",
            format!("{}{face}\nf 1 2 3\n", obj_points()).as_bytes(),
        );
        assert!(error.contains("line 9") && error.contains(words), "{error}");
    }
}

fn ply(format: &str) -> Vec<u8> {
    let mut out = format!(
        "ply\nformat {format} 1.0\ncomment made by hand\nelement vertex 8\nproperty uchar red\nproperty float x\nproperty double y\n\
         property float z\nelement face 6\nproperty list uchar int vertex_indices\nproperty short mark\nend_header\n"
    )
    .into_bytes();
    for [x, y, z] in CORNERS {
        match format {
            "ascii" => writeln!(out, "255 {x} {y} {z}").unwrap(),
            "binary_little_endian" => {
                out.push(255);
                out.extend((x as f32).to_le_bytes());
                out.extend(y.to_le_bytes());
                out.extend((z as f32).to_le_bytes());
            }
            _ => {
                out.push(255);
                out.extend((x as f32).to_be_bytes());
                out.extend(y.to_be_bytes());
                out.extend((z as f32).to_be_bytes());
            }
        }
    }
    for q in QUADS {
        match format {
            "ascii" => writeln!(out, "4 {} {} {} {} -1", q[0], q[1], q[2], q[3]).unwrap(),
            "binary_little_endian" => {
                out.push(4);
                q.iter().for_each(|v| out.extend(v.to_le_bytes()));
                out.extend((-1i16).to_le_bytes());
            }
            _ => {
                out.push(4);
                q.iter().for_each(|v| out.extend(v.to_be_bytes()));
                out.extend((-1i16).to_be_bytes());
            }
        }
    }
    out
}

#[test]
fn ply_in_all_three_encodings() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        is_block(&mesh("a.ply", &ply(format)));
        let whole = ply(format);
        let cut = refusal("a.ply", &whole[..whole.len() - 5]);
        assert!(
            cut.contains("too few") || cut.contains("ends inside"),
            "{cut}"
        );
    }
}

#[test]
fn ply_faults_are_named() {
    let text = String::from_utf8(ply("ascii")).unwrap();
    for (from, to, words) in [
        ("vertex 8", "vertex 4000000000", "do not fit"),
        ("vertex 8", "vertex eight", "not a whole number"),
        ("float x", "quad x", "not a PLY type"),
        ("double y", "double w", "no property `y`"),
        ("ascii", "ebcdic", "not known"),
        ("4 0 3 2 1 -1", "4 0 3 2 8 -1", "face 0: names point 8"),
        ("4 0 3 2 1 -1", "4 0 3 2 1.5 -1", "face 0: names point 1.5"),
        ("4 0 3 2 1 -1", "4 0 3 2 1 -1 7", "too many"),
        ("255 1 0 0", "255 1 0 O", "not a number"),
    ] {
        let error = refusal("a.ply", text.replacen(from, to, 1).as_bytes());
        assert!(error.contains(words), "{from} -> {to}: {error}");
    }
}

#[test]
fn ply_written_for_viewers_reads_back() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("thickness.ply");
    write_ply(&path, &block(), Some(("thickness", &[1.5; 8]))).unwrap();
    is_block(&mesh("a.ply", &std::fs::read(&path).unwrap()));
    assert!(write_ply(&path, &block(), Some(("thickness", &[1.5; 7]))).is_err());
    assert!(write_ply(&path, &block(), Some(("two words", &[1.5; 8]))).is_err());
}

#[test]
fn off_with_comments_colours_and_counts_on_the_first_line() {
    let points: String = CORNERS
        .iter()
        .map(|[x, y, z]| format!("{x} {y} {z}\n"))
        .collect();
    let faces: String = QUADS
        .iter()
        .map(|[a, b, c, d]| format!("4 {a} {b} {c} {d} 0.5 0.5 0.5\n"))
        .collect();
    is_block(&mesh(
        "a.off",
        format!("OFF # a box\n\n8 6 0\n{points}# faces\n{faces}").as_bytes(),
    ));
    is_block(&mesh(
        "a.off",
        format!("COFF 8 6 12\n{}{faces}", points.replace('\n', " 1 1 1 1\n")).as_bytes(),
    ));
    let error = refusal(
        "a.off",
        format!("OFF\n8 6 0\n{points}{}", faces.replace("4 0 3", "4 0 8")).as_bytes(),
    );
    assert!(
        error.contains("line 11") && error.contains("corner 8"),
        "{error}"
    );
    let error = refusal("a.off", format!("OFF\n8 4000000000 0\n{points}").as_bytes());
    assert!(error.contains("do not fit"), "{error}");
    let error = refusal("a.off", format!("OFF\n8 6 0\n{points}").as_bytes());
    assert!(error.contains("ends at face 0 of 6"), "{error}");
}

fn three_mf(unit: &str, resources: &str, build: &str) -> Vec<u8> {
    let model = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?><model unit=\"{unit}\" xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\">\
         <resources>{resources}</resources><build>{build}</build></model>"
    );
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default()
        .compression_method(zip::CompressionMethod::Deflated);
    zip.start_file("3D/3dmodel.model", options).unwrap();
    zip.write_all(model.as_bytes()).unwrap();
    zip.finish().unwrap().into_inner()
}

fn object(id: u32) -> String {
    let block = block();
    let points: String = block
        .points
        .iter()
        .map(|p| format!("<vertex x=\"{}\" y=\"{}\" z=\"{}\"/>", p.x, p.y, p.z))
        .collect();
    let triangles: String = block
        .triangles
        .iter()
        .map(|[a, b, c]| format!("<triangle v1=\"{a}\" v2=\"{b}\" v3=\"{c}\"/>"))
        .collect();
    format!(
        "<object id=\"{id}\" type=\"model\"><mesh><vertices>{points}</vertices><triangles>{triangles}</triangles></mesh></object>"
    )
}

#[test]
fn three_mf_units_transforms_and_components() {
    let inches = mesh(
        "a.3mf",
        &three_mf("inch", &object(1), "<item objectid=\"1\"/>"),
    );
    assert!((inches.volume() - 6.0 * 25.4f64.powi(3)).abs() < 1e-6);
    let moved = mesh(
        "a.3mf",
        &three_mf(
            "millimeter",
            &object(1),
            "<item objectid=\"1\" transform=\"0 1 0 -1 0 0 0 0 1 10 0 0\"/>",
        ),
    );
    is_block(&moved);
    let (lower, upper) = moved.bounds().unwrap();
    assert!(
        (lower - Vec3::new(8.0, 0.0, 0.0)).norm() < 1e-9
            && (upper - Vec3::new(10.0, 1.0, 3.0)).norm() < 1e-9
    );
    // A mirrored copy keeps its outside.
    let mirrored = three_mf(
        "millimeter",
        &object(1),
        "<item objectid=\"1\" transform=\"-1 0 0 0 1 0 0 0 1 0 0 0\"/>",
    );
    is_block(&mesh("a.3mf", &mirrored));
    let nested = format!(
        "{}<object id=\"2\"><components><component objectid=\"1\"/><component objectid=\"1\" transform=\"1 0 0 0 1 0 0 0 1 5 0 0\"/></components></object>",
        object(1)
    );
    let two = mesh(
        "a.3mf",
        &three_mf(
            "millimeter",
            &nested,
            "<item objectid=\"2\"/><item objectid=\"1\"/>",
        ),
    );
    assert_eq!(two.triangles.len(), 36);
    assert_eq!((two.tags[0], two.tags[35]), (0, 1));
}

#[test]
fn three_mf_bombs_and_loops_are_refused() {
    let endless = "<object id=\"1\"><components><component objectid=\"1\"/></components></object>";
    assert!(
        refusal(
            "a.3mf",
            &three_mf("millimeter", endless, "<item objectid=\"1\"/>")
        )
        .contains("nesting")
    );
    // Each level doubles the one below: 2^16 boxes from sixteen lines.
    let doubling: String = (2..18)
        .map(|id| {
            let below = id - 1;
            format!("<object id=\"{id}\"><components><component objectid=\"{below}\"/><component objectid=\"{below}\"/></components></object>")
        })
        .collect();
    let bomb = three_mf(
        "millimeter",
        &format!("{}{doubling}", object(1)),
        "<item objectid=\"17\"/>",
    );
    assert!(refusal("a.3mf", &bomb).contains("the limit is"));
    let zeros = three_mf(
        "millimeter",
        &format!("{}{}", object(1), " ".repeat(1 << 20)),
        "<item objectid=\"1\"/>",
    );
    let small = ReadOptions {
        max_unpacked_bytes: 1 << 16,
        ..ReadOptions::default()
    };
    let error = read_bytes("a.3mf", &zeros, &small, &Monitor::default())
        .expect_err("unpacks to more than the limit");
    assert!(error.to_string().contains("unpacked"), "{error}");
    assert!(refusal("a.3mf", &three_mf("mile", &object(1), "")).contains("unit"));
    assert!(
        refusal(
            "a.3mf",
            &three_mf("meter", &object(1), "<item objectid=\"7\"/>")
        )
        .contains("object 7")
    );
}

#[test]
fn step_files_are_checked_for_cuts_and_dangling_references() {
    let good = "ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n#1=A('it''s #9 /*',#2);\n/* #8 */\n#2 = B();\nENDSEC;\nEND-ISO-10303-21;\n";
    assert!(matches!(
        read("a.step", good.as_bytes()),
        Ok(Input::Step(_))
    ));
    let error = refusal("a.step", good.replace("#2);", "#3);").as_bytes());
    assert!(error.contains("line 5") && error.contains("#3"), "{error}");
    assert!(refusal("a.step", &good.as_bytes()[..70]).contains("cut short"));
    assert!(
        refusal("a.step", good.replace("it''s #9 /*'", "open").as_bytes()).contains("cut short")
    );
    assert!(
        refusal("a.step", good.replace("#2 = B", "#1 = B").as_bytes())
            .contains("#1 is defined twice")
    );
}

#[test]
fn foreign_files_are_named() {
    for (name, bytes, words) in [
        ("a.stl", &b"\x89PNG\r\n\x1a\n0000"[..], "PNG"),
        ("a.obj", b"%PDF-1.4 x", "PDF"),
        ("a.stl", b"hello world", "hello world"),
        ("a.xyz", b"\x00\x01\x02\x03", "not a readable file"),
        ("a.stl", b"", "0 bytes"),
        ("a.3mf", b"PK\x03\x04garbage", "zip"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n", "points without faces"),
    ] {
        let error = refusal(name, bytes);
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn big_and_missing_files_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let small = ReadOptions {
        max_file_bytes: 10,
        ..ReadOptions::default()
    };
    let path = dir.path().join("a.stl");
    std::fs::write(&path, [0; 11]).unwrap();
    for (path, words) in [
        (path.as_path(), "the limit is 10"),
        (&dir.path().join("none"), "cannot be read"),
        (dir.path(), "cannot be read"),
    ] {
        let error = read_input(path, &small, &Monitor::default())
            .expect_err("must be refused")
            .to_string();
        assert!(
            error.contains(words) && error.contains(&path.display().to_string()),
            "{error}"
        );
    }
}
