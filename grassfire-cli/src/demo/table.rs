//! The table of the wishbone's variants, beside that of the paper.

use std::fmt::Write;

use grassfire::report::Report;
use serde::Serialize;

/// The variant whose stiffness the others are compared with.
pub(super) const DRAWN_IN_OPTIMIZATION: &str = "II";
/// The variant that the paper says is better than it, before and after its sections grow.
const EDITED: [&str; 2] = ["III-filled", "III"];

/// Figures of one variant; none where it has no such figure.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(super) struct Column {
    pub(super) name: String,
    /// mm3.
    pub(super) volume: Option<f64>,
    /// Volume over that of the design space.
    pub(super) fraction: Option<f64>,
    pub(super) elements: Option<f64>,
    /// mm.
    pub(super) u_max: Option<f64>,
    /// J.
    pub(super) energy: Option<f64>,
    /// Energy times volume, kJ mm3.
    pub(super) cv: Option<f64>,
    /// The same of II, its surface moved evenly until it has the volume of this variant.
    pub(super) cv_drawn: Option<f64>,
    /// MPa.
    pub(super) stress: Option<f64>,
    /// mm3.
    pub(super) undercut: Option<f64>,
    /// Hot spots that no feeder reaches, in steel, and their volume in cm3.
    pub(super) hot_spots: Option<f64>,
    pub(super) hot_volume: Option<f64>,
    /// Metal of the part over metal poured, %.
    pub(super) casting_yield: Option<f64>,
    /// Rules of feeding that are broken.
    pub(super) broken: Option<f64>,
    /// Share of the ways to the feeder where inscribed balls shrink, %.
    pub(super) falling: Option<f64>,
    /// Root mean square to the proposal, as edited, voxels.
    pub(super) distance: Option<f64>,
    pub(super) faces: Option<f64>,
    pub(super) checks_met: Option<f64>,
    pub(super) checks: Option<f64>,
    pub(super) seconds: Option<f64>,
    /// Why figures are missing: what failed, and how.
    pub(super) errors: Vec<String>,
}

/// A line of the table: text, decimals, figure.
type Line = (&'static str, usize, fn(&Column) -> Option<f64>);

const LINES: [Line; 19] = [
    ("volume V, mm3", 0, |c| c.volume),
    ("V over design space", 3, |c| c.fraction),
    ("elements", 0, |c| c.elements),
    ("largest displacement, mm", 3, |c| c.u_max),
    ("strain energy c, J", 3, |c| c.energy),
    ("c V, kJ mm3", 0, |c| c.cv),
    ("c V of II at this volume", 0, |c| c.cv_drawn),
    ("largest stress, MPa", 0, |c| c.stress),
    ("undercut along z, mm3", 0, |c| c.undercut),
    ("isolated hot spots, steel", 0, |c| c.hot_spots),
    ("their volume, cm3", 2, |c| c.hot_volume),
    ("casting yield, %", 0, |c| c.casting_yield),
    ("feeding rules broken", 0, |c| c.broken),
    ("sections falling, % of ways", 0, |c| c.falling),
    ("distance rms, voxels", 2, |c| c.distance),
    ("CAD faces", 0, |c| c.faces),
    ("checks met", 0, |c| c.checks_met),
    ("checks", 0, |c| c.checks),
    ("seconds", 0, |c| c.seconds),
];

/// The figures of a variant: its report, and that of how its part freezes.
pub(super) fn column(name: &str, report: &Report, frozen: &Report) -> Column {
    let proof = report.verify.as_ref();
    let feed = report.feed.as_ref();
    let solidify = frozen.solidify.as_ref();
    let distance = report.distance.as_ref();
    let stages = report.stages.iter().chain(&frozen.stages);
    Column {
        name: name.to_owned(),
        volume: proof.map(|p| p.volume),
        fraction: proof.map(|p| p.volume_fraction),
        elements: proof.map(|p| p.elements as f64),
        u_max: proof.map(|p| p.u_max),
        energy: proof.map(|p| p.strain_energy / 1e3),
        cv: proof.map(|p| p.cv / 1e6),
        stress: proof.and_then(|p| p.stress_max),
        undercut: report.mould.as_ref().map(|m| m.undercut_volume),
        hot_spots: solidify.map(|s| s.hot_spots.iter().filter(|h| !h.fed).count() as f64),
        hot_volume: solidify.map(|s| s.isolated_volume / 1e3),
        casting_yield: feed.map(|f| 100.0 * f.casting_yield),
        broken: feed.map(|f| f.violations as f64),
        falling: feed.map(|f| 100.0 * f.falling.falling),
        distance: distance.map(|d| d.rms / d.voxel),
        faces: report.solid.as_ref().map(|s| s.faces as f64),
        checks_met: proof.map(|_| report.checks.iter().filter(|c| c.met).count() as f64),
        checks: proof.map(|_| report.checks.len() as f64),
        seconds: proof.map(|_| stages.map(|s| s.seconds).sum()),
        ..Column::default()
    }
}

/// Table 1 of the paper, as far as it goes.
fn paper() -> Vec<Column> {
    let column =
        |(name, [volume, u_max, energy, cv]): (&str, [f64; 4]), fraction, elements| Column {
            name: name.to_owned(),
            volume: Some(volume),
            fraction: Some(fraction),
            elements: Some(elements),
            u_max: Some(u_max),
            energy: Some(energy),
            cv: Some(cv),
            ..Column::default()
        };
    let [second, third] = super::PAPER;
    vec![
        column(second, 0.23, 21_794.0),
        column(third, 0.39, 36_956.0),
    ]
}

/// The variants beside the paper's as a table in Markdown, and what comes of the paper's claim.
pub(super) fn table(ours: &[Column]) -> String {
    let columns: Vec<Column> = paper().into_iter().chain(ours.iter().cloned()).collect();
    let mut text = String::from(
        "Mayer et al. 2023, table 1 (their wishbone is not published; ours is rebuilt from their numbers)\n\n",
    );
    let names = columns.iter().map(|c| format!(" {:>10} |", c.name));
    // Writing to a String cannot fail.
    let _ = writeln!(text, "| {:28} |{}", "", names.collect::<String>());
    let _ = writeln!(text, "|{}", "---|".repeat(columns.len() + 1));
    for (name, decimals, figure) in LINES {
        let cell = |column: &Column| match figure(column) {
            Some(value) => format!(" {value:>10.decimals$} |"),
            None => format!(" {:>10} |", ""),
        };
        let cells = columns.iter().map(cell).collect::<String>();
        let _ = writeln!(text, "| {name:28} |{cells}");
    }
    text += &claim(ours);
    for error in ours.iter().flat_map(|c| &c.errors) {
        let _ = writeln!(text, "\n{error}");
    }
    text
}

/// The paper says that c V of III is smaller than that of II: as they are, and at equal volume, a line a column that is III.
fn claim(ours: &[Column]) -> String {
    let of = |name: &str| ours.iter().find(|c| c.name == name);
    let Some(second) = of(DRAWN_IN_OPTIMIZATION) else {
        return String::new();
    };
    let mut text = String::new();
    for third in EDITED.into_iter().filter_map(of) {
        let ratio = |over: Option<f64>| match (third.cv, over) {
            (Some(a), Some(b)) => format!("{:.2}", a / b),
            _ => "unknown".to_owned(),
        };
        let _ = writeln!(
            text,
            "\nc V of {0} over that of II: paper 0.80, here {1}; with II as thick as {0}, since thickness alone makes it better, {2}",
            third.name,
            ratio(second.cv),
            ratio(third.cv_drawn)
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_compares_with_the_paper_also_at_equal_volume() {
        let column = |name: &str, cv: f64, cv_drawn| Column {
            name: name.to_owned(),
            cv: Some(cv),
            cv_drawn,
            ..Column::default()
        };
        let ours = [
            column("II", 2000.0, None),
            column("III", 1500.0, Some(1000.0)),
        ];
        let text = table(&ours);
        let line = text.lines().find(|l| l.starts_with("| c V, kJ mm3"));
        let cells: Vec<&str> = line.unwrap_or("").split('|').map(str::trim).collect();
        assert_eq!(&cells[2..6], ["1859", "1487", "2000", "1500"]);
        assert!(text.contains("paper 0.80, here 0.75;"), "{text}");
        assert!(text.trim_end().ends_with("1.50"), "{text}");
        assert!(claim(&ours[..1]).is_empty());
    }
}
