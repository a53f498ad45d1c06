//! The library of elastic materials: a TOML file with a table a material.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::{CaseError, Material, error, value};

/// The library that comes with the program, as a TOML file.
pub const LIBRARY: &str = include_str!("materials.toml");

/// What a library knows of a material.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    young: f64,
    nu: f64,
    density: Option<f64>,
    yield_strength: Option<f64>,
    source: String,
}

/// Fills in a material that has a name only from a library: that which it names, a path relative to `folder`, or the program's.
///
/// # Errors
/// [`CaseError::Name`] when the library has no such material, [`CaseError::Io`] and [`CaseError::Syntax`] for its file.
pub(super) fn complete(material: &mut Material, folder: &Path) -> Result<(), CaseError> {
    let named_only = material.young == 0.0 && material.nu == 0.0 && !material.name.is_empty();
    let (file, text) = match &material.library {
        Some(_) if !named_only => {
            let wanted = "no library beside young and nu, or a name of the library alone";
            return Err(value("material.library", "given", wanted));
        }
        _ if !named_only => return Ok(()),
        None => ("the library of materials".to_owned(), LIBRARY.to_owned()),
        Some(path) => {
            let path = folder.join(path);
            let bytes = crate::io::read_file(&path, 1 << 24)?;
            let text = String::from_utf8_lossy(&bytes).into_owned();
            (path.display().to_string(), text)
        }
    };
    let library: BTreeMap<String, Entry> =
        toml::from_str(&text).map_err(|e| error::syntax(&file, &text, &e))?;
    let Some(entry) = library.get(&material.name) else {
        return Err(CaseError::Name {
            key: "material.name".into(),
            name: material.name.clone(),
            known: library.into_keys().collect(),
        });
    };
    *material = Material {
        name: material.name.clone(),
        library: material.library.clone(),
        young: entry.young,
        nu: entry.nu,
        density: material.density.or(entry.density),
        yield_strength: material.yield_strength.or(entry.yield_strength),
        source: entry.source.clone(),
    };
    Ok(())
}
