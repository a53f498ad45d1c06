//! Numbers for people.

/// Separates groups of three digits without letting lines break.
const GROUP: char = '\u{202f}';

/// `value` with about `digits` significant digits and grouped thousands; a dash when it is not finite.
pub(super) fn number(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "\u{2013}".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-5..12).contains(&exponent) {
        return format!("{value:.*e}", digits.saturating_sub(1)).replace('-', "\u{2212}");
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    let text = format!("{:.decimals$}", value.abs());
    let (whole, fraction) = text.split_once('.').unwrap_or((&text, ""));
    let fraction = fraction.trim_end_matches('0');
    let sign = if value < 0.0 { "\u{2212}" } else { "" };
    let point = if fraction.is_empty() { "" } else { "." };
    format!("{sign}{}{point}{fraction}", grouped(whole))
}

/// A count with grouped thousands.
pub(super) fn count(value: impl TryInto<i64>) -> String {
    let value = value.try_into().unwrap_or(i64::MAX);
    let sign = if value < 0 { "\u{2212}" } else { "" };
    format!("{sign}{}", grouped(&value.unsigned_abs().to_string()))
}

/// A number with its unit.
pub(super) fn with_unit(value: f64, digits: usize, unit: &str) -> String {
    match unit {
        "" => number(value, digits),
        "°" => format!("{}°", number(value, digits)),
        _ => format!("{}\u{a0}{unit}", number(value, digits)),
    }
}

/// Bytes as kB or MB.
pub(super) fn bytes(value: u64) -> String {
    match value {
        0..1000 => format!("{value}\u{a0}B"),
        1000..1_000_000 => with_unit(value as f64 / 1e3, 3, "kB"),
        _ => with_unit(value as f64 / 1e6, 3, "MB"),
    }
}

fn grouped(digits: &str) -> String {
    let mut text = String::with_capacity(digits.len() * 4 / 3);
    for (n, digit) in digits.chars().enumerate() {
        // Four digits read well without a gap.
        if n > 0 && (digits.len() - n).is_multiple_of(3) && digits.len() > 4 {
            text.push(GROUP);
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_like_print() {
        assert_eq!(number(62_028.7, 5), "62\u{202f}029");
        assert_eq!(number(-0.012_345, 3), "\u{2212}0.0123");
        assert_eq!(number(1.5, 3), "1.5");
        assert_eq!(number(f64::NAN, 3), "\u{2013}");
        assert_eq!(number(1.2e-9, 3), "1.20e\u{2212}9");
        assert_eq!(number(9999.6, 4), "10\u{202f}000");
        assert_eq!(count(1234usize), "1234");
        assert_eq!(count(-3i64), "\u{2212}3");
        assert_eq!(with_unit(0.5, 3, "mm"), "0.5\u{a0}mm");
        assert_eq!(bytes(12_345_678), "12.3\u{a0}MB");
    }
}
