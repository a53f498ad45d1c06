//! A look at a STEP file's text before OpenCASCADE sees it: its reader crashes on references that lead nowhere.

use std::collections::HashSet;

/// Checks the frame of the file and that every referenced instance is defined.
pub(crate) fn check(bytes: &[u8]) -> Result<(), String> {
    if !bytes.trim_ascii_start().starts_with(b"ISO-10303-21") {
        return Err("not a STEP file: it does not begin with ISO-10303-21".into());
    }
    let mut defined = HashSet::new();
    let mut wanted = Vec::new();
    let mut at = 0;
    let mut ended = false;
    while at < bytes.len() {
        match bytes[at] {
            b'\'' => at = end_of_string(bytes, at)?,
            b'/' if bytes.get(at + 1) == Some(&b'*') => at = end_of_comment(bytes, at)?,
            b'#' => {
                let digits = bytes[at + 1..]
                    .iter()
                    .take_while(|b| b.is_ascii_digit())
                    .count();
                let number = std::str::from_utf8(&bytes[at + 1..at + 1 + digits])
                    .ok()
                    .and_then(|s| s.parse::<u64>().ok());
                let Some(number) = number else {
                    return Err(format!("byte {at}: # without a number"));
                };
                at += digits;
                let next = bytes[at + 1..].iter().find(|b| !b.is_ascii_whitespace());
                if next == Some(&b'=') {
                    defined.insert(number);
                } else {
                    wanted.push(number);
                }
            }
            b'E' if bytes[at..].starts_with(b"END-ISO-10303-21") => ended = true,
            _ => {}
        }
        at += 1;
    }
    if !ended {
        return Err("the file is cut off: END-ISO-10303-21 is missing".into());
    }
    match wanted.iter().find(|n| !defined.contains(n)) {
        Some(n) => Err(format!("instance #{n} is referenced but not defined")),
        None => Ok(()),
    }
}

/// Index of the closing quote; a doubled quote inside is read as two strings side by side, which is the same here.
fn end_of_string(bytes: &[u8], at: usize) -> Result<usize, String> {
    let length = bytes[at + 1..].iter().position(|b| *b == b'\'');
    length
        .map(|n| at + 1 + n)
        .ok_or_else(|| format!("byte {at}: the text has no end"))
}

fn end_of_comment(bytes: &[u8], at: usize) -> Result<usize, String> {
    let length = bytes[at + 2..].windows(2).position(|w| w == b"*/");
    length
        .map(|n| at + 3 + n)
        .ok_or_else(|| format!("byte {at}: the comment has no end"))
}

#[cfg(test)]
mod tests {
    use super::check;

    #[test]
    fn frame_and_references() {
        let file =
            |data: &str| format!("ISO-10303-21;HEADER;ENDSEC;DATA;{data}ENDSEC;END-ISO-10303-21;");
        assert_eq!(
            check(file("#1 = A('#9 it''s',#2);/* #8 */#2=B();").as_bytes()),
            Ok(())
        );
        assert!(check(file("#1=A(#3);").as_bytes()).is_err_and(|e| e.contains("#3")));
        assert!(check(file("#1=A('open);").as_bytes()).is_err());
        assert!(check(b"ISO-10303-21;DATA;#1=A();").is_err());
        assert!(check(b"\x89PNG").is_err());
        assert!(check(b"").is_err());
    }
}
