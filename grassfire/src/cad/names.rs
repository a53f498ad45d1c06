//! Names and colours of solids and faces in the files: where each comes from.

use grassfire_occt::{Face, OcctError, Surface};

use super::build::{CadSolid, FaceSource};

/// Colour of the fitted body.
const ORGANIC: [u8; 3] = [176, 184, 193];

/// Name and colour of every face: `organic`, `flat 2`, `fillet`, `boss 3: wall`, `boss 3: bore`.
pub(super) fn faces(solid: &CadSolid) -> Result<(Vec<String>, Vec<[u8; 3]>), OcctError> {
    let faces = solid.shape.faces()?;
    let name = |(face, source): (&Face, &FaceSource)| face_name(solid, face, *source);
    let names = faces.iter().zip(&solid.sources).map(name).collect();
    Ok((names, solid.sources.iter().map(color).collect()))
}

/// Names of the solids: one is the product, several are what their faces come from.
pub(super) fn solids(solid: &CadSolid, product: &str) -> Result<Vec<String>, OcctError> {
    let solids = solid.shape.solids()?;
    if solids.len() < 2 {
        return Ok(vec![product.to_owned()]);
    }
    // The solids share no faces, so that those of the whole follow each other solid by solid.
    let mut first = 0;
    let mut names = Vec::with_capacity(solids.len());
    for part in &solids {
        let end = first + part.counts()?.faces as usize;
        let own = solid.sources.get(first..end).unwrap_or_default();
        names.push(solid_name(solid, own));
        first = end;
    }
    let mut numbered = Vec::with_capacity(names.len());
    for (i, name) in names.iter().enumerate() {
        let same = |list: &[String]| list.iter().filter(|other| *other == name).count();
        numbered.push(match same(&names) {
            1 => name.clone(),
            _ => format!("{name} {}", 1 + same(&names[..i])),
        });
    }
    Ok(numbered)
}

/// A solid without organic faces is the body that most of its faces come from.
fn solid_name(solid: &CadSolid, sources: &[FaceSource]) -> String {
    if sources.contains(&FaceSource::Organic) {
        return "organic body".into();
    }
    let mut count = vec![0; solid.non_design.len()];
    for source in sources {
        if let FaceSource::Body(i) | FaceSource::Bore(i, _) = source
            && let Some(n) = count.get_mut(*i as usize)
        {
            *n += 1;
        }
    }
    let most = (0..count.len()).max_by_key(|&i| (count[i], std::cmp::Reverse(i)));
    most.map_or_else(|| "body".into(), |i| solid.non_design[i].name.clone())
}

fn face_name(solid: &CadSolid, face: &Face, source: FaceSource) -> String {
    let (body, what) = match source {
        FaceSource::Organic => return "organic".into(),
        FaceSource::Flat(i) => return format!("flat {}", i + 1),
        FaceSource::Fillet => return "fillet".into(),
        FaceSource::Body(i) => (i, kind(&face.surface).to_owned()),
        FaceSource::Bore(i, k) => {
            let bores = solid
                .non_design
                .get(i as usize)
                .map_or(0, |b| b.bores.len());
            let number = if bores > 1 {
                format!("bore {}", k + 1)
            } else {
                "bore".into()
            };
            (i, number)
        }
    };
    let name = solid
        .non_design
        .get(body as usize)
        .map_or("non-design", |b| b.name.as_str());
    format!("{name}: {what}")
}

fn kind(surface: &Surface) -> &'static str {
    match surface {
        Surface::Plane => "plane",
        Surface::Cylinder { concave: false, .. } => "wall",
        Surface::Cylinder { concave: true, .. } => "hollow",
        Surface::Cone { .. } => "cone",
        Surface::Sphere { .. } => "sphere",
        Surface::Torus { .. } => "torus",
        Surface::Free => "freeform",
    }
}

/// Grey for the fitted body, one colour for each other body; they come again after nine.
fn color(source: &FaceSource) -> [u8; 3] {
    // The last colour of the table is a grey.
    let table = &colorous::TABLEAU10[..9];
    match source {
        FaceSource::Organic | FaceSource::Flat(_) | FaceSource::Fillet => ORGANIC,
        FaceSource::Body(i) | FaceSource::Bore(i, _) => {
            let c = table[*i as usize % table.len()];
            [c.r, c.g, c.b]
        }
    }
}
