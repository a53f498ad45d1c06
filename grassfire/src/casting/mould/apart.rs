//! Places that stand for their surroundings.

/// The first of a list and each after it that is `near` none taken before, at most `most` of them.
pub(super) fn apart<T>(
    list: impl IntoIterator<Item = T>,
    most: usize,
    near: impl Fn(&T, &T) -> bool,
) -> Vec<T> {
    let mut out: Vec<T> = Vec::new();
    for one in list {
        if out.len() == most {
            break;
        }
        if !out.iter().any(|taken| near(taken, &one)) {
            out.push(one);
        }
    }
    out
}
