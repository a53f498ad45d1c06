//! `--set key=value` on any options struct, by way of its JSON form.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// Why a setting was refused.
#[derive(Debug, PartialEq, Eq)]
pub enum SettingError {
    /// No `=`.
    NoValue(String),
    /// No option has this key; the nearest one is given.
    UnknownKey {
        key: String,
        nearest: Option<String>,
    },
    /// The option does not take this value.
    BadValue {
        key: String,
        value: String,
        reason: String,
    },
}

impl std::fmt::Display for SettingError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoValue(text) => write!(f, "--set {text}: expected KEY=VALUE"),
            Self::UnknownKey { key, .. } => write!(f, "--set {key}: there is no such option"),
            Self::BadValue { key, value, reason } => write!(f, "--set {key}={value}: {reason}"),
        }
    }
}

impl SettingError {
    /// What the user can do about it.
    pub fn hint(&self) -> String {
        match self {
            Self::NoValue(_) => "for example --set remesh.min_tunnel=0".to_owned(),
            Self::UnknownKey {
                nearest: Some(nearest),
                ..
            } => format!("did you mean {nearest}?"),
            Self::UnknownKey { .. } | Self::BadValue { .. } => {
                "`grassfire schema` lists all options".to_owned()
            }
        }
    }
}

/// Splits `key=value`.
pub fn split(text: &str) -> Result<(&str, &str), SettingError> {
    match text.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => Ok((key.trim(), value.trim())),
        _ => Err(SettingError::NoValue(text.to_owned())),
    }
}

/// `options` with the dotted `key` set to `value`: JSON where it parses (numbers, true, lists, "quoted"), else text.
///
/// One key at a time, so that an error names the setting that caused it.
pub fn set<T: Serialize + DeserializeOwned>(
    options: &T,
    key: &str,
    value: &str,
) -> Result<T, SettingError> {
    let bad = |reason: String| SettingError::BadValue {
        key: key.to_owned(),
        value: value.to_owned(),
        reason,
    };
    let mut tree = serde_json::to_value(options).map_err(|e| bad(e.to_string()))?;
    let Some(place) = find(&mut tree, key) else {
        return Err(SettingError::UnknownKey {
            key: key.to_owned(),
            nearest: nearest(&tree, key),
        });
    };
    *place = serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.to_owned()));
    serde_json::from_value(tree).map_err(|e| bad(e.to_string()))
}

fn find<'a>(tree: &'a mut Value, key: &str) -> Option<&'a mut Value> {
    let mut at = tree;
    for (depth, part) in key.split('.').enumerate() {
        // An absent optional table is null: it begins empty and its own keys are checked when it is read.
        if at.is_null() && depth > 0 {
            *at = Value::Object(Map::from_iter([(part.to_owned(), Value::Null)]));
        }
        at = at.as_object_mut()?.get_mut(part)?;
    }
    Some(at)
}

fn nearest(tree: &Value, key: &str) -> Option<String> {
    let mut keys = Vec::new();
    collect("", tree, &mut keys);
    let last = |key: &str| key.rsplit('.').next().unwrap_or(key).to_owned();
    // A right name in the wrong table is nearer than any misspelling.
    let distance = |known: &String| {
        let whole = strsim::damerau_levenshtein(known, key);
        let own = strsim::damerau_levenshtein(&last(known), &last(key));
        (whole.min(2 * own + 1), whole)
    };
    keys.into_iter()
        .min_by_key(distance)
        .filter(|known| distance(known).0 <= 2 + known.len() / 3)
}

fn collect(prefix: &str, tree: &Value, keys: &mut Vec<String>) {
    match tree {
        Value::Object(map) => {
            for (key, value) in map {
                let path = if prefix.is_empty() {
                    key.clone()
                } else {
                    format!("{prefix}.{key}")
                };
                collect(&path, value, keys);
            }
        }
        _ => keys.push(prefix.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use grassfire::pipeline::ReconstructOptions;

    use super::*;

    fn defaults() -> ReconstructOptions {
        ReconstructOptions::default()
    }

    #[test]
    fn sets_nested_and_optional_values() {
        assert_eq!(
            set(&defaults(), "remesh.voxel", "0.75").map(|o| o.remesh.voxel),
            Ok(Some(0.75))
        );
        assert_eq!(
            set(&defaults(), "repair.strict", "true").map(|o| o.repair.strict),
            Ok(true)
        );
        assert_eq!(
            set(&defaults(), "report.limits.volume", "0.05").map(|o| o.report.limits.volume),
            Ok(0.05)
        );
        assert_eq!(set(&defaults(), "threads", "2").map(|o| o.threads), Ok(2));
    }

    #[test]
    fn names_the_nearest_key() {
        let near = |key: &str| match set(&defaults(), key, "1") {
            Err(SettingError::UnknownKey { nearest, .. }) => nearest,
            other => panic!("{key} gave {other:?}"),
        };
        assert_eq!(near("remesh.voxle").as_deref(), Some("remesh.voxel"));
        assert_eq!(near("voxel").as_deref(), Some("remesh.voxel"));
        assert_eq!(near("skeleton.voxel").as_deref(), Some("remesh.voxel"));
        assert_eq!(near("qqqqqqqqqqqqqqqqqqqqqqqqqq"), None);
    }

    #[test]
    fn refuses_bad_values() {
        assert!(matches!(
            set(&defaults(), "remesh.voxel", "thick"),
            Err(SettingError::BadValue { .. })
        ));
        assert!(matches!(
            set(&defaults(), "remesh", "1"),
            Err(SettingError::BadValue { .. })
        ));
        assert_eq!(split("a.b"), Err(SettingError::NoValue("a.b".to_owned())));
        assert_eq!(split(" a.b = 3 "), Ok(("a.b", "3")));
    }
}
