//! The bad files of the corpus and what each must give; shared by the tests of the readers and of the program.
//! `INDEX.md` beside the files says what is wrong with each. The corpus is looked for in `../shared/data` beside the
//! workspace or in the folder that `GRASSFIRE_CORPUS` names.

use std::path::PathBuf;

/// Clean volume of the bracket, mm3.
pub const BRACKET: f64 = 7.831e4;
/// Clean volume of the plate, mm3.
pub const PLATE: f64 = 11.63;
/// Clean volume of the strap, mm3.
pub const STRAP: f64 = 7586.0;

/// What a file must give.
#[derive(Clone, Copy)]
pub enum Want {
    /// A mesh of this volume within 2 %, and each of these words in the texts of its repairs.
    Mesh(f64, &'static [&'static str]),
    /// Densities, and each of these words in the notes.
    Density(&'static [&'static str]),
    /// One line with each of these words.
    Refused(&'static [&'static str]),
}
pub use Want::{Density, Mesh, Refused};

/// Every bad file.
pub const TABLE: &[(&str, Want)] = &[
    (
        "01_open_hole.stl",
        Mesh(BRACKET, &["1 holes filled", "mm2"]),
    ),
    ("02_open_1pct_missing.stl", Mesh(BRACKET, &["holes filled"])),
    (
        "03_duplicate_faces.stl",
        Mesh(BRACKET, &["2000 double faces dropped"]),
    ),
    (
        "04_inverted_all.stl",
        Mesh(BRACKET, &["1 of 1 shells were inside out"]),
    ),
    (
        "05_inverted_patch.stl",
        Mesh(BRACKET, &["faces turned to agree"]),
    ),
    (
        "06_inverted_random20pct.stl",
        Mesh(BRACKET, &["faces turned to agree"]),
    ),
    (
        "07_nonmanifold_fins.stl",
        Mesh(
            PLATE,
            &["152 faces of fins dropped", "48 faces without area"],
        ),
    ),
    (
        "08_nonmanifold_vertex.stl",
        Mesh(2000.0, &["2 separate bodies"]),
    ),
    (
        "09_nonmanifold_edge.stl",
        Mesh(2000.0, &["1 edges with more than two faces"]),
    ),
    (
        "10_self_intersect_overlap.stl",
        Mesh(2.0 * BRACKET, &["overlap", "unites"]),
    ),
    (
        "11_self_intersect_noise.stl",
        Mesh(BRACKET, &["faces run through others"]),
    ),
    ("12_tiny_islands.stl", Mesh(BRACKET, &["60 pieces"])),
    (
        "13_cavity_outward_normals.stl",
        Mesh(
            64_000.0 - 7171.0,
            &["taken as voids (1 of them had outward"],
        ),
    ),
    (
        "14_nan_coords.stl",
        Mesh(BRACKET, &["25 faces with coordinates NaN", "holes filled"]),
    ),
    (
        "15_inf_coords.stl",
        Mesh(
            BRACKET,
            &["3 faces with coordinates NaN or infinite", "holes filled"],
        ),
    ),
    (
        "16_huge_offset_1e7.stl",
        Mesh(BRACKET, &["numbers step by 1.000 mm"]),
    ),
    ("17_huge_scale_1e30.stl", Refused(&["mm long", "limit"])),
    (
        "18_tiny_scale_1e-7.stl",
        Mesh(BRACKET * 1e-21, &["check the unit"]),
    ),
    (
        "19_degenerate_faces.stl",
        Mesh(
            BRACKET,
            &["32 double faces", "768 faces without area dropped"],
        ),
    ),
    (
        "20_unwelded_cracks.stl",
        Mesh(BRACKET, &["points united", "71496 open edges"]),
    ),
    ("21_ascii_broken_lines.stl", Refused(&["line "])),
    ("22_ascii_truncated.stl", Refused(&["line ", "cut short"])),
    ("23_ascii_crlf_upper_locale.stl", Mesh(PLATE, &[])),
    ("24_binary_starts_with_solid.stl", Mesh(PLATE, &[])),
    (
        "25_binary_count_too_big.stl",
        Mesh(PLATE, &["claims 3476000 facets", "holds 3476"]),
    ),
    ("26_binary_truncated.stl", Refused(&["byte ", "cut short"])),
    ("27_binary_count_4e9.stl", Refused(&["not a solid"])),
    ("28_empty_0byte.stl", Refused(&["empty", "0 bytes"])),
    (
        "29_empty_solid_ascii.stl",
        Refused(&["empty", "no triangles"]),
    ),
    (
        "30_binary_zero_triangles.stl",
        Refused(&["empty", "no triangles"]),
    ),
    (
        "31_obj_bad_indices.obj",
        Refused(&["line ", "index 99999999", "points"]),
    ),
    ("32_zero_thickness_sheet.stl", Refused(&["not a solid"])),
    ("33_single_triangle.stl", Refused(&["not a solid"])),
    (
        "34_two_bodies.stl",
        Mesh(2.0 * STRAP, &["2 separate bodies"]),
    ),
    ("35_png_named.stl", Refused(&["not an STL", "PNG"])),
    ("36_step_truncated.step", Refused(&["cut short"])),
    (
        "37_step_dangling_ref.step",
        Refused(&["#99999", "not defined"]),
    ),
    (
        "38_density_nan_out_of_range.npy",
        Density(&["3 values NaN", "1 below 0 and 1 above 1"]),
    ),
    (
        "39_density_all_zero.npy",
        Refused(&["empty at threshold 0.5"]),
    ),
    (
        "40_density_checkerboard.npy",
        Density(&["checkerboard", "13500"]),
    ),
    ("41_density_2d.npy", Refused(&["shape [30, 30]"])),
];

/// The folder of the corpus, if there is one.
pub fn corpus() -> Option<PathBuf> {
    let named = std::env::var_os("GRASSFIRE_CORPUS").map(PathBuf::from);
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let found = named
        .into_iter()
        .chain([beside])
        .find(|folder| folder.join("bad").is_dir());
    if found.is_none() {
        println!("skipped: no corpus");
    }
    found
}
