//! Density readers on small files made here and on a real one of the corpus.

use std::io::Write;
use std::path::PathBuf;

use base64::Engine;
use grassfire::Vec3;
use grassfire::io::*;
use grassfire::mesh::RepairKind;
use grassfire::monitor::Monitor;
use grassfire::voxel::VoxelGrid;

fn read_with(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<Input, IoError> {
    read_bytes(name, bytes, options, &Monitor::default())
}

fn grid_with(name: &str, bytes: &[u8], options: &ReadOptions) -> VoxelGrid<f32> {
    match read_with(name, bytes, options) {
        Ok(Input::Density { grid, .. }) => grid,
        other => panic!("{name}: {other:?}"),
    }
}

fn grid(name: &str, bytes: &[u8]) -> VoxelGrid<f32> {
    grid_with(name, bytes, &ReadOptions::default())
}

fn refusal(name: &str, bytes: &[u8]) -> String {
    let error = read_with(name, bytes, &ReadOptions::default())
        .expect_err("this must be refused")
        .to_string();
    assert!(
        !error.contains('\n') && error.starts_with(name),
        "{error:?}"
    );
    error
}

/// 4 x 3 x 2 voxels of different densities, x fastest.
fn densities() -> Vec<f64> {
    (0..24).map(|i| f64::from(i) / 32.0).collect()
}

fn npy(descr: &str, fortran: &str, shape: &str, body: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}");
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out.extend(body);
    out
}

#[test]
fn npy_types_and_orders() {
    let values = densities();
    let want: Vec<f32> = values.iter().map(|&v| v as f32).collect();
    let le8: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let be4: Vec<u8> = values
        .iter()
        .flat_map(|v| (*v as f32).to_be_bytes())
        .collect();
    let options = ReadOptions {
        spacing: Some(2.5),
        origin: Some([1.0, 2.0, 3.0]),
        ..ReadOptions::default()
    };
    let read = grid_with("a.npy", &npy("<f8", "False", "(2, 3, 4)", &le8), &options);
    assert_eq!(
        (read.dims, read.spacing, read.origin),
        ([4, 3, 2], 2.5, Vec3::new(1.0, 2.0, 3.0))
    );
    assert_eq!(read.values, want);
    assert_eq!(
        grid("a.npy", &npy(">f4", "False", "(2, 3, 4)", &be4)).values,
        want
    );
    assert_eq!(
        grid("a.npy", &npy("<f8", "False", "(1, 2, 3, 4)", &le8)).values,
        want
    );
    // Fortran order: z runs fastest.
    let mut fortran = Vec::new();
    for i in 0..4 {
        for j in 0..3 {
            for k in 0..2 {
                fortran.extend(values[(k * 3 + j) * 4 + i].to_le_bytes());
            }
        }
    }
    assert_eq!(
        grid("a.npy", &npy("<f8", "True", "(2, 3, 4)", &fortran)).values,
        want
    );
    let bits: Vec<u8> = (0..24).map(|i| i % 2).collect();
    for descr in ["|b1", "|u1", "|i1"] {
        assert_eq!(
            grid("a.npy", &npy(descr, "False", "(2, 3, 4)", &bits)).values[1],
            1.0
        );
    }
    let percent: Vec<u8> = (0..24i16).flat_map(|i| (i * 4).to_le_bytes()).collect();
    let scaled = ReadOptions {
        density_scale: 0.01,
        ..ReadOptions::default()
    };
    assert!(
        (grid_with(
            "a.npy",
            &npy("<i2", "False", "(2, 3, 4)", &percent),
            &scaled
        )
        .values[23]
            - 0.92)
            .abs()
            < 1e-6
    );
}

#[test]
fn npy_faults_are_named() {
    let body: Vec<u8> = densities().iter().flat_map(|v| v.to_le_bytes()).collect();
    for (descr, shape, words) in [
        ("<f8", "(2, 3, 5)", "needs 240 bytes, the file holds 192"),
        (
            "<f8",
            "(99999999, 99999999, 99999999)",
            "the number of voxels",
        ),
        ("<f8", "(24,)", "shape [24]"),
        ("<f8", "(2, 0, 4)", "no voxels"),
        ("<c16", "(2, 3, 4)", "cannot be read"),
        ("é8", "(2, 3, 4)", "cannot be read"),
        ("<f8", "(2, x, 4)", "`shape`"),
    ] {
        let error = refusal("a.npy", &npy(descr, "False", shape, &body));
        assert!(error.contains(words), "{error}");
    }
    assert!(refusal("a.npy", b"\x93NUMPY\x01\x00\xff\xff{").contains("inside the header"));
    let labels: Vec<u8> = (0..24).map(|i| i % 3).collect();
    let error = refusal("a.npy", &npy("|u1", "False", "(2, 3, 4)", &labels));
    assert!(error.contains("8 of 24 values lie outside 0..1"), "{error}");
}

#[test]
fn npy_of_two_axes_is_extruded_on_request() {
    let body: Vec<u8> = densities().iter().flat_map(|v| v.to_le_bytes()).collect();
    let options = ReadOptions {
        extrude_layers: 3,
        ..ReadOptions::default()
    };
    let read = grid_with("a.npy", &npy("<f8", "False", "(6, 4)", &body), &options);
    assert_eq!(read.dims, [4, 6, 3]);
    assert_eq!(read.values[..24], read.values[48..]);
}

/// An image of 4 x 3 x 2 cells whose one array is `array` and whose appended data are `appended`.
fn vti(attributes: &str, array: &str, spacing: &str, appended: &[u8]) -> Vec<u8> {
    let mut out = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" {attributes}>\n\
         <ImageData WholeExtent=\"0 4 0 3 0 2\" Origin=\"10 0 0\" Spacing=\"{spacing}\">\n<Piece Extent=\"0 4 0 3 0 2\">\n\
         <CellData Scalars=\"density\">\n{array}\n</CellData>\n</Piece>\n</ImageData>\n"
    )
    .into_bytes();
    out.extend(appended);
    out.extend(b"</VTKFile>\n");
    out
}

const DOUBLES: &str = "<DataArray type=\"Float64\" Name=\"density\" format=";

fn bytes() -> Vec<u8> {
    densities().iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn zlib(data: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

/// Header and blocks of 80 bytes, the last shorter.
fn compressed() -> (Vec<u8>, Vec<u8>) {
    let plain = bytes();
    let blocks: Vec<Vec<u8>> = plain.chunks(80).map(zlib).collect();
    let mut header = Vec::new();
    let last = plain.len() - 80 * (blocks.len() - 1);
    for n in [blocks.len(), 80, last]
        .into_iter()
        .chain(blocks.iter().map(Vec::len))
    {
        header.extend((n as u32).to_le_bytes());
    }
    (header, blocks.concat())
}

#[test]
fn vti_in_all_encodings() {
    let base64 = base64::engine::general_purpose::STANDARD;
    let text: Vec<String> = densities().iter().map(f64::to_string).collect();
    let length = (bytes().len() as u32).to_le_bytes().to_vec();
    let joined = base64.encode([length.clone(), bytes()].concat());
    let apart = format!("{}{}", base64.encode(&length), base64.encode(bytes()));
    let (header, blocks) = compressed();
    let packed = format!("{}\n  {}", base64.encode(&header), base64.encode(&blocks));
    let zip = "compressor=\"vtkZLibDataCompressor\"";
    let raw = [
        &b"<AppendedData encoding=\"raw\">\n_<junk"[..],
        &length,
        &bytes(),
        b"</AppendedData>",
    ]
    .concat();
    let raw_packed = [
        &b"<AppendedData encoding=\"raw\">_"[..],
        &header,
        &blocks,
        b"</AppendedData>",
    ]
    .concat();
    let coded = format!("<AppendedData encoding=\"base64\">\n _{packed}\n</AppendedData>");
    let files = [
        vti(
            "",
            &format!("{DOUBLES}\"ascii\"> {} </DataArray>", text.join("\n")),
            "1 1 1",
            b"",
        ),
        vti(
            "",
            &format!("{DOUBLES}\"binary\">\n  {joined}\n</DataArray>"),
            "1 1 1",
            b"",
        ),
        vti(
            "",
            &format!("{DOUBLES}\"binary\">{apart}</DataArray>"),
            "1 1 1",
            b"",
        ),
        vti(
            zip,
            &format!("{DOUBLES}\"binary\">{packed}</DataArray>"),
            "1 1 1",
            b"",
        ),
        vti(
            "",
            &format!("{DOUBLES}\"appended\" offset=\"5\"/>"),
            "1 1 1",
            &raw,
        ),
        vti(
            zip,
            &format!("{DOUBLES}\"appended\" offset=\"0\"/>"),
            "1 1 1",
            &raw_packed,
        ),
        vti(
            zip,
            &format!("{DOUBLES}\"appended\" offset=\"0\"/>"),
            "1 1 1",
            coded.as_bytes(),
        ),
    ];
    let want: Vec<f32> = densities().iter().map(|&v| v as f32).collect();
    for (index, file) in files.iter().enumerate() {
        let read = grid("a.vti", file);
        assert_eq!(
            (read.dims, read.origin),
            ([4, 3, 2], Vec3::new(10.5, 0.5, 0.5)),
            "file {index}"
        );
        assert_eq!(read.values, want, "file {index}");
    }
}

#[test]
fn vti_faults_are_named() {
    let wide = "header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\"";
    let lie = [u64::MAX, 1 << 40, 1].map(u64::to_le_bytes).concat();
    let lie = [&b"<AppendedData encoding=\"raw\">_"[..], &lie].concat();
    let appended = format!("{DOUBLES}\"appended\" offset=\"0\"/>");
    let beyond = format!("{DOUBLES}\"appended\" offset=\"99999999\"/>");
    for (file, words) in [
        (vti(wide, &appended, "1 1 1", &lie), "ends inside"),
        (vti("", &beyond, "1 1 1", &lie), "ends inside"),
        (
            vti(
                "",
                &format!("{DOUBLES}\"ascii\">1 2</DataArray>"),
                "1 1 1",
                b"",
            ),
            "2 values for [4, 3, 2]",
        ),
        (
            vti(
                "",
                &format!("{DOUBLES}\"ascii\">1 two</DataArray>"),
                "1 1 1",
                b"",
            ),
            "\"two\" is not a number",
        ),
        (vti("", &appended, "1 0 1", b""), "ends inside"),
        (
            vti(
                "compressor=\"vtkLZ4DataCompressor\"",
                &appended,
                "1 1 1",
                b"",
            ),
            "vtkLZ4DataCompressor",
        ),
        (vti("", "", "1 1 1", b""), "no array is called density"),
        (vti("", "<DataArray", "1 1 1", b""), "XML"),
    ] {
        let error = refusal("a.vti", &file);
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn long_voxels_become_cubes() {
    // A ramp along z stays a ramp.
    let text: Vec<String> = (0..24)
        .map(|i| (f64::from(i / 12) * 0.8).to_string())
        .collect();
    let file = vti(
        "",
        &format!("{DOUBLES}\"ascii\"> {} </DataArray>", text.join(" ")),
        "1 1 4",
        b"",
    );
    let read = grid("a.vti", &file);
    assert_eq!((read.dims, read.spacing), ([4, 3, 8], 1.0));
    assert!((read.origin - Vec3::new(10.5, 0.5, 0.5)).norm() < 1e-12);
    let column: Vec<f32> = (0..8).map(|k| read.values[read.index(2, 1, k)]).collect();
    let want = [0.0, 0.0, 0.1, 0.3, 0.5, 0.7, 0.8, 0.8];
    assert!(
        column.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-6),
        "{column:?}"
    );
}

#[test]
fn a_real_unstructured_grid_of_boxes_loads() {
    let named = std::env::var_os("GRASSFIRE_CORPUS").map(PathBuf::from);
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let Some(corpus) = named
        .into_iter()
        .chain([beside])
        .find(|f| f.join("dev").is_dir())
    else {
        println!("skipped: no corpus");
        return;
    };
    let path = corpus.join("dev/beam_vfrac04_density.vtu");
    let Ok(Input::Density { grid, notes }) =
        read_input(&path, &ReadOptions::default(), &Monitor::default())
    else {
        panic!("the beam must load");
    };
    assert_eq!((grid.dims, grid.values.len()), ([60, 20, 4], 4800));
    let mean = grid.values.iter().map(|&v| f64::from(v)).sum::<f64>() / 4800.0;
    assert!((mean - 0.4).abs() < 0.01, "mean {mean}");
    assert!(
        !notes.iter().any(|n| n.kind == RepairKind::Resampled),
        "{notes:?}"
    );
    for step in [
        "dev/featuretype.step",
        "wishbone/design_space.step",
        "wishbone/non_design.step",
    ] {
        let read = read_input(
            &corpus.join(step),
            &ReadOptions::default(),
            &Monitor::default(),
        );
        assert!(matches!(read, Ok(Input::Step(_))), "{step}: {read:?}");
    }
}
