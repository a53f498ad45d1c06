//! `grassfire about`.

use std::fmt::Write;

use grassfire::report::papers;

/// Version and licence; with `cite` the papers whose methods are used.
pub fn text(cite: bool) -> String {
    let kernel = if cfg!(feature = "occt") {
        "with OpenCASCADE"
    } else {
        "without a CAD kernel"
    };
    let mut text = format!(
        "grassfire {} ({kernel}), MIT OR Apache-2.0\n",
        env!("CARGO_PKG_VERSION")
    );
    if !cite {
        return text;
    }
    text.push_str("\nPapers whose methods are used; report.html lists those of a run:\n");
    for paper in papers::ALL {
        // Writing to a String cannot fail.
        let _ = write!(text, "\n[{}] {}", paper.key, paper.citation);
        if !paper.doi.is_empty() {
            let _ = write!(text, " https://doi.org/{}", paper.doi);
        }
        let _ = writeln!(
            text,
            "\n    {}: {}",
            paper.stages.join(", "),
            paper.used_for
        );
    }
    text
}
