//! Non-design bodies: exact solids that end up in the part unchanged, from STEP or from meshes.

use std::path::Path;

use grassfire_occt::{OcctError, Operation, Shape, Surface};

use super::bores::{self, Bore};
use super::{CadError, NonDesignOptions, array, primitives, prism, rebuild};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::monitor::Monitor;
use crate::non_design::{Boss, Notch};

/// How exact the solid of a body is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rebuilt {
    /// The CAD file's own geometry.
    Exact,
    /// Planes, cylinders and cones about one axis, fitted to a mesh.
    Revolution {
        /// Largest distance of a mesh vertex to them, mm.
        residual: f64,
    },
    /// Planes and bores fitted to a mesh.
    Prismatic {
        /// Largest distance of a mesh vertex to them, mm.
        residual: f64,
    },
    /// The mesh's own triangles, coplanar ones merged.
    Faceted,
}

/// A solid that must be in the part as it is.
#[derive(Debug)]
pub struct NonDesignBody {
    /// Name for reports and STEP faces.
    pub name: String,
    /// File it came from.
    pub source: String,
    /// How the solid was made.
    pub rebuilt: Rebuilt,
    /// The exact solid.
    pub solid: Shape,
    /// The solid with its bores filled: this is what gets fused.
    pub boss: Shape,
    /// Its bores: these are cut after the union.
    pub bores: Vec<Bore>,
    /// Volume of the solid, mm3.
    pub volume: f64,
}

const STAGE: &str = "cad";
const VOLUME_EPS: f64 = 1e-9;

/// The solids of a STEP file, at least one.
fn read_solids(path: &Path) -> Result<Vec<Shape>, CadError> {
    let source = path.display().to_string();
    let shape = Shape::read_step(path).map_err(|e| CadError::Unreadable {
        path: source.clone(),
        text: e.0,
    })?;
    let solids = shape.solids()?;
    if solids.is_empty() {
        return Err(CadError::NoSolid {
            path: source,
            faces: shape.counts()?.faces,
        });
    }
    Ok(solids)
}

/// Reads the non-design bodies of a STEP file: each solid is one.
///
/// # Errors
/// [`CadError::Unreadable`], [`CadError::NoSolid`], [`CadError::InvalidSolid`].
pub fn read(
    path: &Path,
    options: &NonDesignOptions,
    monitor: &Monitor,
) -> Result<Vec<NonDesignBody>, CadError> {
    let source = path.display().to_string();
    monitor.step(STAGE, "reading non-design bodies", 0.0)?;
    let solids = read_solids(path)?;
    let stem = path
        .file_stem()
        .map_or_else(|| "body".into(), |s| s.to_string_lossy().into_owned());
    let many = solids.len() > 1;
    let mut out = Vec::with_capacity(solids.len());
    for (i, solid) in solids.into_iter().enumerate() {
        monitor.check()?;
        let name = if many {
            format!("{stem} {}", i + 1)
        } else {
            stem.clone()
        };
        out.push(body(
            name,
            &source,
            Rebuilt::Exact,
            solid,
            options,
            monitor,
        )?);
    }
    Ok(out)
}

/// Makes non-design bodies from a mesh: each connected part is one.
///
/// 1. Weld, split into connected parts, orient.
/// 2. Cut each part into smooth regions at sharp edges and fit planes, cylinders and cones.
/// 3. All about one axis: turn the exact profile. Planes and bores only: plane polyhedron with cut bores. Else: the
///    triangles themselves, with a warning.
///
/// A part whose surface points inward is turned; cavities inside a part are read as bodies of their own.
///
/// # Errors
/// [`CadError::OpenMesh`], [`CadError::BadMesh`], [`CadError::InvalidSolid`].
pub fn from_mesh(
    name: &str,
    source: &str,
    mesh: &TriMesh,
    options: &NonDesignOptions,
    monitor: &Monitor,
) -> Result<Vec<NonDesignBody>, CadError> {
    let parts = primitives::parts(name, mesh)?;
    let many = parts.len() > 1;
    let mut out = Vec::with_capacity(parts.len());
    for (i, part) in parts.iter().enumerate() {
        monitor.step(
            STAGE,
            "rebuilding non-design bodies",
            i as f64 / parts.len() as f64,
        )?;
        let name = if many {
            format!("{name} {}", i + 1)
        } else {
            name.to_owned()
        };
        let (solid, rebuilt) = rebuild::solid(&name, part, options, monitor)?;
        out.push(body(name, source, rebuilt, solid, options, monitor)?);
    }
    Ok(out)
}

/// A non-design body from a solid of the kernel.
///
/// # Errors
/// [`CadError::Kernel`], [`CadError::InvalidSolid`].
pub fn from_shape(
    name: String,
    source: &str,
    solid: Shape,
    options: &NonDesignOptions,
    monitor: &Monitor,
) -> Result<NonDesignBody, CadError> {
    body(name, source, Rebuilt::Exact, solid, options, monitor)
}

/// Makes the sleeve of a recognised boss: a hollow cylinder, notched where the material ends before its outer wall, its bore
/// kept free beyond the ends as far as the proposal is.
///
/// # Errors
/// [`CadError::Kernel`], [`CadError::InvalidSolid`].
pub fn from_boss(
    name: &str,
    source: &str,
    boss: &Boss,
    options: &NonDesignOptions,
    monitor: &Monitor,
) -> Result<NonDesignBody, CadError> {
    let ([from, to], [inner, outer]) = (boss.extent, [boss.radius, boss.outer_radius]);
    let profile = [[inner, from], [outer, from], [outer, to], [inner, to]];
    let mut solid = Shape::revolve(array(boss.origin), array(boss.direction), &profile)?;
    for notch in &boss.notches {
        let tool = notch_tool(boss, notch)?;
        solid = solid
            .boolean(Operation::Cut, &tool, 1e-6, false, &|| false)?
            .shape;
    }
    let options = NonDesignOptions {
        bore_extension: options.bore_extension.min(boss.free / boss.radius),
        ..options.clone()
    };
    let rebuilt = Rebuilt::Revolution {
        residual: boss.residual,
    };
    body(name.to_owned(), source, rebuilt, solid, &options, monitor)
}

/// What a notch takes away: a prism along the axis, as wide as the notch at every distance from the axis.
fn notch_tool(boss: &Boss, notch: &Notch) -> Result<Shape, CadError> {
    let [x, y] = primitives::across(&boss.direction);
    let away = x * notch.turn.cos() + y * notch.turn.sin();
    let aside = boss.direction.cross(&away);
    let length = boss.extent[1] - boss.extent[0];
    let far = 2.0 * boss.outer_radius;
    let foot = boss.origin + boss.direction * (boss.extent[0] - length);
    let corner = |(distance, sign): (f64, f64)| {
        foot + away * distance + aside * (sign * distance * notch.half_angle.tan())
    };
    let near = notch.distance;
    let corners = [(near, -1.0), (far, -1.0), (far, 1.0), (near, 1.0)].map(corner);
    Ok(prism(&corners, boss.direction * (3.0 * length))?)
}

/// A design space: its faces as triangles, its solids, its bores.
#[derive(Debug)]
pub struct DesignSpace {
    /// Tags are faces in the order of the file.
    pub faces: TriMesh,
    /// Faces of each solid.
    pub solids: Vec<Vec<u32>>,
    /// Holes.
    pub bores: Vec<SpaceBore>,
    /// Kind of each face: `plane`, `cylinder` ...
    pub kinds: Vec<&'static str>,
}

/// A cylindrical hole of a design space.
#[derive(Debug, Clone, PartialEq)]
pub struct SpaceBore {
    /// Point of the axis, mm.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Radius, mm.
    pub radius: f64,
    /// Faces of its wall.
    pub faces: Vec<u32>,
}

/// The surface of all solids of a STEP file that [`read`] takes: triangles within `chord` mm, facets that turn by up to `angle`.
///
/// # Errors
/// As [`read`], and [`CadError::Kernel`].
pub fn read_surface(
    path: &Path,
    (chord, angle): (f64, f64),
    options: &NonDesignOptions,
    monitor: &Monitor,
) -> Result<TriMesh, CadError> {
    let mut out = TriMesh::default();
    for body in read(path, options, monitor)? {
        let mesh = body.solid.tessellate(chord, angle)?;
        let points = mesh.points.iter().map(|p| Vec3::from(*p));
        out.append(points, mesh.triangles);
    }
    Ok(out)
}

/// Reads the faces of a design space from STEP, triangles within `chord` mm of them.
///
/// # Errors
/// [`CadError::Unreadable`], [`CadError::NoSolid`], [`CadError::Kernel`].
pub fn read_design_space(path: &Path, chord: f64) -> Result<DesignSpace, CadError> {
    let solids = read_solids(path)?;
    let mut out = DesignSpace {
        faces: TriMesh::default(),
        solids: Vec::new(),
        bores: Vec::new(),
        kinds: Vec::new(),
    };
    for solid in &solids {
        let mesh = solid.tessellate(chord, 0.2)?;
        let face = out.kinds.len() as u32;
        let points = mesh.points.iter().map(|p| Vec3::from(*p));
        out.faces.append(points, mesh.triangles);
        out.faces.tags.extend(mesh.faces.iter().map(|f| f + face));
        let own = solid.faces()?;
        out.kinds.extend(own.iter().map(|f| kind(&f.surface)));
        out.solids.push((face..out.kinds.len() as u32).collect());
        for bore in bores::find(solid)? {
            let on = |f: &usize| bore.is_wall(&own[*f]);
            let walls = (0..own.len()).filter(on).map(|f| f as u32 + face).collect();
            out.bores.push(SpaceBore {
                origin: bore.origin,
                direction: bore.direction,
                radius: bore.radius,
                faces: walls,
            });
        }
    }
    Ok(out)
}

fn kind(surface: &Surface) -> &'static str {
    match surface {
        Surface::Plane => "plane",
        Surface::Cylinder { .. } => "cylinder",
        Surface::Cone { .. } => "cone",
        Surface::Sphere { .. } => "sphere",
        Surface::Torus { .. } => "torus",
        Surface::Free => "freeform",
    }
}

fn body(
    name: String,
    source: &str,
    rebuilt: Rebuilt,
    solid: Shape,
    options: &NonDesignOptions,
    monitor: &Monitor,
) -> Result<NonDesignBody, CadError> {
    let fail = |text: String| CadError::InvalidSolid {
        name: name.clone(),
        text,
    };
    if let Some(text) = solid.faults()? {
        return Err(fail(text));
    }
    let open = solid.counts()?.bad_edges;
    if open > 0 {
        return Err(fail(format!("{open} edges have not exactly two faces")));
    }
    let volume = solid.volume(VOLUME_EPS)?;
    if volume.is_nan() || volume <= 0.0 {
        return Err(fail(format!("the volume is {volume} mm3")));
    }
    let mut found = bores::find(&solid)?;
    let boss = match fill(&solid, &found, volume) {
        Ok(boss) => boss,
        Err(text) => {
            monitor.warn(STAGE, format!("{name}: its {} bores could not be filled before the union ({text}); it is fused as it is", found.len()));
            solid.share()?
        }
    };
    for bore in &mut found {
        bores::extend(bore, options.bore_extension, &[&solid])?;
    }
    Ok(NonDesignBody {
        name,
        source: source.to_owned(),
        rebuilt,
        solid,
        boss,
        bores: found,
        volume,
    })
}

/// The solid with its bores filled; the volumes must add up.
fn fill(solid: &Shape, bores: &[Bore], volume: f64) -> Result<Shape, String> {
    let text = |e: OcctError| e.0;
    let (mut boss, mut total) = (solid.share().map_err(text)?, volume);
    for bore in bores {
        let plug = bore.plug().map_err(text)?;
        total += plug.volume(VOLUME_EPS).map_err(text)?;
        boss = boss
            .boolean(Operation::Fuse, &plug, 1e-6, false, &|| false)
            .map_err(text)?
            .shape;
    }
    if bores.is_empty() {
        return Ok(boss);
    }
    let boss = boss.unified().map_err(text)?;
    let got = boss.volume(VOLUME_EPS).map_err(text)?;
    let counts = boss.counts().map_err(text)?;
    match boss.faults().map_err(text)? {
        Some(fault) => Err(fault),
        None if counts.solids != 1 || counts.bad_edges != 0 => Err(format!(
            "{} solids, {} open edges",
            counts.solids, counts.bad_edges
        )),
        None if (got - total).abs() > 1e-6 * total => {
            Err(format!("volume {got:.6} instead of {total:.6} mm3"))
        }
        None => Ok(boss),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_notch_takes_its_share_of_the_sleeve() {
        let [inner, outer, floor, half_angle]: [f64; 4] = [5.0, 9.0, 7.0, 0.4];
        let mut boss = Boss {
            bore: 0,
            wall: Some(1),
            ends: [None; 2],
            origin: Vec3::new(1.0, 2.0, 3.0),
            direction: Vec3::new(0.6, 0.0, 0.8),
            radius: inner,
            outer_radius: outer,
            extent: [-2.0, 4.0],
            notches: Vec::new(),
            free: 5.0,
            residual: 0.0,
        };
        let make = |boss: &Boss| {
            let options = NonDesignOptions::default();
            from_boss("boss", "test", boss, &options, &Monitor::default()).expect("a solid")
        };
        let whole = make(&boss).volume;
        boss.notches = [0.3, 2.0]
            .map(|turn| Notch {
                turn,
                half_angle,
                distance: floor,
            })
            .to_vec();
        let notched = make(&boss);
        let area = outer * outer * half_angle - floor * floor * half_angle.tan();
        assert!((whole - notched.volume - 2.0 * area * 6.0).abs() < 1e-9 * whole);
        assert_eq!(notched.bores.len(), 1);
    }
}
