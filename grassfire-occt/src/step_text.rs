//! Text of STEP files: a look at it before OpenCASCADE sees it, whose reader crashes on references that lead nowhere, and
//! the alphabet of names.

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

/// A file in the alphabet of STEP (ISO 10303-21, 6.4.3): other characters as `\X2\` and their UTF-16 codes. The kernel
/// writes them as they are.
pub(crate) fn encode(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 64);
    let mut units = [0; 2];
    let mut foreign = false;
    for c in text.chars() {
        if foreign == c.is_ascii() {
            out += if foreign { "\\X0\\" } else { "\\X2\\" };
            foreign = !foreign;
        }
        if !foreign {
            out.push(c);
            continue;
        }
        for unit in c.encode_utf16(&mut units) {
            out += &format!("{unit:04X}");
        }
    }
    out
}

/// A name on one line.
pub(crate) fn line(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).collect()
}

/// A name in plain ASCII, for IGES.
pub(crate) fn ascii(text: &str) -> String {
    text.chars()
        .filter(|c| !c.is_control())
        .map(|c| if c.is_ascii() { c } else { '?' })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{ascii, check, encode, line};

    #[test]
    fn names_in_the_alphabet_of_step() {
        assert_eq!(encode("'boss 3: bore';\n"), "'boss 3: bore';\n");
        assert_eq!(
            encode("'J\u{f6}rg \u{3a9}\u{1f600}';"),
            "'J\\X2\\00F6\\X0\\rg \\X2\\03A9D83DDE00\\X0\\';"
        );
        assert_eq!(line("a\r\nb"), "ab");
        assert_eq!(ascii("J\u{f6}rg\t"), "J?rg");
    }

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
