//! The cxx bridge: declarations only. `lib.rs` wraps them in a safe interface.

/// Lets OpenCASCADE ask during a long operation whether to stop.
pub struct Interrupt<'a>(pub(crate) &'a (dyn Fn() -> bool + Sync));

impl Interrupt<'_> {
    fn interrupted(&self) -> bool {
        (self.0)()
    }
}

#[cxx::bridge(namespace = "grassfire")]
#[allow(
    clippy::missing_safety_doc,
    missing_docs,
    reason = "Shape and its types say what each of these does"
)]
pub(crate) mod bridge {
    /// See [`crate::Counts`].
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    struct Counts {
        solids: u32,
        shells: u32,
        faces: u32,
        wires: u32,
        edges: u32,
        vertices: u32,
        bad_edges: u32,
    }

    #[derive(Debug, Clone, Copy)]
    struct FaceInfo {
        kind: i32,
        origin: [f64; 3],
        axis: [f64; 3],
        radius: f64,
        minor: f64,
        u0: f64,
        u1: f64,
        v0: f64,
        v1: f64,
        middle: [f64; 3],
        normal: [f64; 3],
        area: f64,
        concave: bool,
    }

    #[derive(Debug, Clone, Copy)]
    struct EdgeInfo {
        length: f64,
        faces: [i32; 2],
        angle: f64,
        concave: bool,
        middle: [f64; 3],
    }

    #[derive(Debug, Clone, Copy)]
    struct LineHit {
        line: u32,
        parameter: f64,
    }

    struct Triangulation {
        points: Vec<f64>,
        triangles: Vec<u32>,
        faces: Vec<u32>,
    }

    struct StepNames {
        product: String,
        author: String,
        organization: String,
        system: String,
        description: String,
        time_stamp: String,
        uncertainty: f64,
        solids: Vec<String>,
        faces: Vec<String>,
        colors: Vec<u32>,
    }

    struct StepContents {
        products: Vec<String>,
        solids: Vec<String>,
        faces: Vec<String>,
        colors: Vec<i64>,
    }

    /// Flat arrays of a boundary representation; see [`crate::BrepDescription`].
    struct BrepData<'a> {
        vertices: &'a [f64],
        edges: &'a [u32],
        edge_control: &'a [f64],
        faces: &'a [u32],
        face_control: &'a [f64],
        uses: &'a [u32],
        use_uv: &'a [f64],
        solids: &'a [u32],
        shells: &'a [u32],
        shell_faces: &'a [u32],
    }

    extern "Rust" {
        type Interrupt<'a>;
        fn interrupted(&self) -> bool;
    }

    unsafe extern "C++" {
        include!("grassfire-occt/cpp/bridge.h");

        type Shape;
        type Boolean;
        type Filleted;

        fn occt_version() -> String;
        fn silence();

        fn build_brep(data: &BrepData) -> Result<UniquePtr<Shape>>;
        fn build_faceted(points: &[f64], triangles: &[u32]) -> Result<UniquePtr<Shape>>;
        fn make_cylinder(
            start: &[f64],
            axis: &[f64],
            radius: f64,
            height: f64,
        ) -> Result<UniquePtr<Shape>>;
        fn make_box(low: &[f64], high: &[f64]) -> Result<UniquePtr<Shape>>;
        fn make_revolve(origin: &[f64], axis: &[f64], profile: &[f64]) -> Result<UniquePtr<Shape>>;
        fn make_compound() -> Result<UniquePtr<Shape>>;
        fn add_to_compound(compound: Pin<&mut Shape>, part: &Shape) -> Result<()>;
        fn share(shape: &Shape) -> Result<UniquePtr<Shape>>;
        fn translated(shape: &Shape, by: &[f64]) -> Result<UniquePtr<Shape>>;
        fn unified(shape: &Shape) -> Result<UniquePtr<Shape>>;

        fn boolean(
            operation: i32,
            objects: &Shape,
            tools: &Shape,
            fuzzy: f64,
            with_common: bool,
            interrupt: &Interrupt,
        ) -> Result<UniquePtr<Boolean>>;
        fn boolean_result(boolean: &Boolean) -> Result<UniquePtr<Shape>>;
        fn boolean_common(boolean: &Boolean) -> Result<UniquePtr<Shape>>;
        fn boolean_warnings(boolean: &Boolean) -> String;
        fn boolean_origins(boolean: &Boolean) -> Vec<i32>;

        fn fillet_contour(shape: &Shape, edge: u32) -> Result<Vec<u32>>;
        fn fillet(
            shape: &Shape,
            starts: &[u32],
            radii: &[f64],
            seconds: f64,
            interrupt: &Interrupt,
        ) -> Result<UniquePtr<Filleted>>;
        fn fillet_result(filleted: &Filleted) -> Result<UniquePtr<Shape>>;
        fn fillet_origins(filleted: &Filleted) -> Vec<i32>;

        fn faults(shape: &Shape) -> Result<String>;
        fn counts(shape: &Shape) -> Result<Counts>;
        fn solid(shape: &Shape, index: usize) -> Result<UniquePtr<Shape>>;
        fn volume(shape: &Shape, eps: f64) -> Result<f64>;
        fn face_volumes(
            shape: &Shape,
            eps: f64,
            known: &Shape,
            known_volumes: &[f64],
        ) -> Result<Vec<f64>>;
        fn area(shape: &Shape, eps: f64) -> Result<f64>;
        fn max_tolerance(shape: &Shape) -> Result<f64>;
        fn faces(shape: &Shape) -> Result<Vec<FaceInfo>>;
        fn edges(shape: &Shape) -> Result<Vec<EdgeInfo>>;
        fn bounds(shape: &Shape) -> Result<Vec<f64>>;
        fn line_hits(shape: &Shape, lines: &[f64]) -> Result<Vec<LineHit>>;
        fn contains(shape: &Shape, points: &[f64]) -> Result<Vec<u8>>;
        fn distances(shape: &Shape, points: &[f64]) -> Result<Vec<f64>>;
        fn face_samples(shape: &Shape, faces: &[u32], per_face: usize) -> Result<Vec<f64>>;

        fn read_step(path: &str) -> Result<UniquePtr<Shape>>;
        fn write_step(shape: &Shape, path: &str, names: &StepNames) -> Result<()>;
        fn step_contents(path: &str) -> Result<StepContents>;
        fn read_brep(path: &str) -> Result<UniquePtr<Shape>>;
        fn write_brep(shape: &Shape, path: &str) -> Result<()>;
        fn read_iges(path: &str) -> Result<UniquePtr<Shape>>;
        fn write_iges(shape: &Shape, path: &str, names: &StepNames) -> Result<()>;
        fn tessellate(
            shape: &Shape,
            chord: f64,
            angle: f64,
            fine: &[u32],
            fine_chord: f64,
            fine_angle: f64,
        ) -> Result<Triangulation>;
    }
}
