//! Named sets of Abaqus and CalculiX decks: the element faces that a node set, an element set or a surface stands for.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

use super::source::{Source, parse, quote};
use super::{IoError, ReadOptions, read_file};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::monitor::Monitor;

/// Reads the faces that a named set of a deck stands for, as triangles of corner nodes, mm.
///
/// 1. `*NODE`, `*ELEMENT`, `*NSET`, `*ELSET` (both also with `GENERATE`) and `*SURFACE` are read, also sets that nodes and
///    elements are put into where they are defined. Other keywords are skipped. Names are the same in capitals.
/// 2. A surface gives its faces, an element set all faces of its elements, a node set the faces whose corners it holds; where a
///    node set holds no face, its nodes stand alone, as triangles without area.
///
/// Of solid elements those with 4, 5, 6 and 8 corners are known, of shells and membranes those with 3 and 4; middle nodes are left
/// out.
///
/// # Errors
/// [`IoError::Open`], [`IoError::Line`] for what is no number or names nothing, [`IoError::Format`] when there is no such set.
pub fn read_deck_set(path: &Path, set: &str, monitor: &Monitor) -> Result<TriMesh, IoError> {
    let options = ReadOptions::default();
    let bytes = read_file(path, options.max_file_bytes)?;
    let name = path.display().to_string();
    let src = Source {
        name: &name,
        bytes: &bytes,
        options: &options,
        monitor,
    };
    let deck = Deck::read(&src)?;
    deck.faces_of(&src, &set.to_ascii_uppercase())
}

/// A member of a set.
#[derive(Debug, Clone)]
enum Member {
    Number(u32),
    Set(String),
}

/// Corners of an element, and its faces as numbers of them.
struct Element {
    corners: Vec<u32>,
    faces: &'static [&'static [usize]],
}

/// Members of a surface, with the number of a face, from 0.
type FaceOf = (Member, usize);

#[derive(Default)]
struct Deck {
    nodes: HashMap<u32, Vec3>,
    elements: BTreeMap<u32, Element>,
    node_sets: BTreeMap<String, Vec<Member>>,
    element_sets: BTreeMap<String, Vec<Member>>,
    surfaces: BTreeMap<String, Vec<FaceOf>>,
}

/// What the lines after a keyword hold.
enum Block {
    Skipped,
    Nodes(Option<String>),
    /// Element type and set.
    Elements(String, Option<String>),
    /// Name; numbers are first, last and step.
    NodeSet(String, bool),
    ElementSet(String, bool),
    /// Name; its lines are nodes or node sets.
    Surface(String, bool),
}

impl Deck {
    fn read(src: &Source) -> Result<Self, IoError> {
        let mut out = Self::default();
        let mut block = Block::Skipped;
        // Words of an element that goes on in the next line.
        let mut words: Vec<&[u8]> = Vec::new();
        let lines = src.lines().map(|(n, line)| (n, line.trim_ascii()));
        for (n, line) in lines.filter(|(_, line)| !line.is_empty() && !line.starts_with(b"**")) {
            if n % 100_000 == 0 {
                src.monitor.check()?;
            }
            if line.starts_with(b"*") {
                block = keyword(src, n, line)?;
                words.clear();
                continue;
            }
            words.extend(line.split(|&b| b == b',').map(<[u8]>::trim_ascii));
            if words.last().is_some_and(|w| w.is_empty()) {
                words.pop();
            }
            if matches!(&block, Block::Elements(kind, _) if words.len() < 1 + nodes_of(kind)) {
                continue;
            }
            out.take(src, n, &block, &words)?;
            words.clear();
        }
        Ok(out)
    }

    fn take(
        &mut self,
        src: &Source,
        n: usize,
        block: &Block,
        words: &[&[u8]],
    ) -> Result<(), IoError> {
        match block {
            Block::Skipped => {}
            Block::Nodes(set) => {
                let mut words = words.iter().copied();
                let number = index(src, n, words.next().unwrap_or_default())?;
                self.nodes.insert(number, src.next_point(n, &mut words)?);
                join(&mut self.node_sets, set, number);
            }
            Block::Elements(kind, set) => {
                let numbers = words.iter().map(|w| index(src, n, w));
                let numbers: Vec<u32> = numbers.collect::<Result<_, _>>()?;
                let (corners, faces) = shape(kind);
                let element = Element {
                    corners: numbers[1..1 + corners].to_vec(),
                    faces,
                };
                self.elements.insert(numbers[0], element);
                join(&mut self.element_sets, set, numbers[0]);
            }
            Block::NodeSet(name, generate) => {
                let set = self.node_sets.entry(name.clone()).or_default();
                set.extend(members(src, n, words, *generate)?);
            }
            Block::ElementSet(name, generate) => {
                let set = self.element_sets.entry(name.clone()).or_default();
                set.extend(members(src, n, words, *generate)?);
            }
            Block::Surface(name, true) => {
                let set = self.node_sets.entry(name.clone()).or_default();
                set.extend(members(src, n, &words[..1], false)?);
            }
            Block::Surface(name, false) => {
                let side = words.get(1).copied().unwrap_or_default();
                let of = member(words[0]);
                let face = match side {
                    b"SPOS" | b"SNEG" => 1,
                    _ => index(src, n, side.strip_prefix(b"S").unwrap_or_default())? as usize,
                };
                let Some(face) = face.checked_sub(1) else {
                    return Err(src.line(n, "faces are counted from 1"));
                };
                self.surfaces
                    .entry(name.clone())
                    .or_default()
                    .push((of, face));
            }
        }
        Ok(())
    }

    fn faces_of(&self, src: &Source, set: &str) -> Result<TriMesh, IoError> {
        let mut mesh = TriMesh::default();
        let mut add = |corners: &mut dyn Iterator<Item = u32>| -> Result<(), IoError> {
            let first = mesh.points.len() as u32;
            for node in corners {
                let place = self.nodes.get(&node);
                mesh.points.push(*place.ok_or_else(|| {
                    src.format(format!("an element has node {node}, which is not there"))
                })?);
            }
            let count = mesh.points.len() as u32 - first;
            // A node alone becomes a triangle of its own.
            let last = (first + count).saturating_sub(1);
            for k in 1..count.max(2) - 1 {
                mesh.triangles.push([first, first + k, first + k + 1]);
            }
            if count == 1 {
                mesh.triangles.push([last; 3]);
            }
            src.check_triangles(mesh.triangles.len())
        };
        let corners = |e: &Element, face: usize| -> Vec<u32> {
            let face = e.faces.get(face).copied().unwrap_or_default();
            face.iter().map(|&c| e.corners[c]).collect()
        };
        if let Some(surface) = self.surfaces.get(set) {
            for (member, face) in surface {
                for number in numbers(&self.element_sets, member) {
                    if let Some(e) = self.elements.get(&number) {
                        add(&mut corners(e, *face).into_iter())?;
                    }
                }
            }
        } else if self.node_sets.contains_key(set) {
            let held = numbers(&self.node_sets, &Member::Set(set.to_owned()));
            let mut any = false;
            for e in self.elements.values() {
                for face in (0..e.faces.len()).map(|f| corners(e, f)) {
                    if face.iter().all(|n| held.contains(n)) {
                        add(&mut face.into_iter())?;
                        any = true;
                    }
                }
            }
            for &node in held.iter().filter(|_| !any) {
                add(&mut std::iter::once(node))?;
            }
        } else if self.element_sets.contains_key(set) {
            for number in numbers(&self.element_sets, &Member::Set(set.to_owned())) {
                let Some(e) = self.elements.get(&number) else {
                    continue;
                };
                for face in 0..e.faces.len() {
                    add(&mut corners(e, face).into_iter())?;
                }
            }
        } else {
            let sets = [self.node_sets.keys(), self.element_sets.keys()];
            let names: Vec<&str> = sets
                .into_iter()
                .flatten()
                .chain(self.surfaces.keys())
                .map(String::as_str)
                .collect();
            let names = names.join(", ");
            return Err(src.format(format!("there is no set {set:?}; there are: {names}")));
        }
        if mesh.triangles.is_empty() {
            return Err(src.format(format!(
                "the set {set:?} holds no node and no face of an element that is known"
            )));
        }
        Ok(mesh)
    }
}

/// The numbers that a member of a set stands for. Each set counts once, however often sets name it.
fn numbers(sets: &BTreeMap<String, Vec<Member>>, member: &Member) -> BTreeSet<u32> {
    let (mut out, mut seen) = (BTreeSet::new(), BTreeSet::new());
    let mut open = vec![member];
    while let Some(member) = open.pop() {
        match member {
            Member::Number(number) => {
                out.insert(*number);
            }
            Member::Set(name) if seen.insert(name) => {
                open.extend(sets.get(name).into_iter().flatten())
            }
            Member::Set(_) => {}
        }
    }
    out
}

/// A keyword line; the values of its parameters in capitals.
fn keyword(src: &Source, n: usize, line: &[u8]) -> Result<Block, IoError> {
    let upper = line.to_ascii_uppercase();
    let mut words = upper.split(|&b| b == b',').map(<[u8]>::trim_ascii);
    let word = words.next().unwrap_or_default();
    let parameters: Vec<&[u8]> = words.collect();
    let value = |name: &str| {
        let pairs = parameters.iter().filter_map(|p| {
            let at = p.iter().position(|&b| b == b'=')?;
            Some((p[..at].trim_ascii(), p[at + 1..].trim_ascii()))
        });
        let mut found = pairs.filter(|(key, _)| *key == name.as_bytes());
        found
            .next()
            .map(|(_, v)| String::from_utf8_lossy(v).into_owned())
    };
    let needed = |name: &str| {
        value(name).ok_or_else(|| src.line(n, format!("{} without {name}", quote(word))))
    };
    let generate = parameters.contains(&&b"GENERATE"[..]);
    Ok(match word {
        b"*NODE" => Block::Nodes(value("NSET")),
        b"*ELEMENT" => Block::Elements(needed("TYPE")?, value("ELSET")),
        b"*NSET" => Block::NodeSet(needed("NSET")?, generate),
        b"*ELSET" => Block::ElementSet(needed("ELSET")?, generate),
        b"*SURFACE" => {
            let of_nodes = value("TYPE").is_some_and(|kind| kind == "NODE");
            Block::Surface(needed("NAME")?, of_nodes)
        }
        _ => Block::Skipped,
    })
}

fn index(src: &Source, n: usize, word: &[u8]) -> Result<u32, IoError> {
    parse(word).ok_or_else(|| src.line(n, format!("{} is not a whole number", quote(word))))
}

fn member(word: &[u8]) -> Member {
    match parse(word) {
        Some(number) => Member::Number(number),
        None => Member::Set(String::from_utf8_lossy(word).to_ascii_uppercase()),
    }
}

fn members(
    src: &Source,
    n: usize,
    words: &[&[u8]],
    generate: bool,
) -> Result<Vec<Member>, IoError> {
    if !generate {
        return Ok(words.iter().map(|w| member(w)).collect());
    }
    let numbers = words.iter().map(|w| index(src, n, w));
    let numbers: Vec<u32> = numbers.collect::<Result<_, _>>()?;
    let (first, last, step) = match numbers[..] {
        [first, last] => (first, last, 1),
        [first, last, step] if step > 0 => (first, last, step),
        _ => return Err(src.line(n, "first, last and a step above 0 are wanted")),
    };
    let count = (last.saturating_sub(first) / step) as usize;
    src.check_triangles(count)?;
    Ok((first..=last)
        .step_by(step as usize)
        .map(Member::Number)
        .collect())
}

fn join(sets: &mut BTreeMap<String, Vec<Member>>, set: &Option<String>, number: u32) {
    if let Some(name) = set {
        let members = sets.entry(name.clone()).or_default();
        members.push(Member::Number(number));
    }
}

/// Nodes of an element type: the number that its name ends with, as in C3D10, C3D20RI or S4R.
fn nodes_of(kind: &str) -> usize {
    let end = kind.trim_end_matches(|c: char| !c.is_ascii_digit());
    let digits = end.len() - end.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    end[end.len() - digits..].parse().unwrap_or(1)
}

/// Corners and faces of an element type, in the order of Abaqus; none of one that is not known.
fn shape(kind: &str) -> (usize, &'static [&'static [usize]]) {
    const TETRAHEDRON: &[&[usize]] = &[&[0, 1, 2], &[0, 3, 1], &[1, 3, 2], &[2, 3, 0]];
    const PYRAMID: &[&[usize]] = &[
        &[0, 1, 2, 3],
        &[0, 4, 1],
        &[1, 4, 2],
        &[2, 4, 3],
        &[3, 4, 0],
    ];
    const WEDGE: &[&[usize]] = &[
        &[0, 1, 2],
        &[3, 5, 4],
        &[0, 3, 4, 1],
        &[1, 4, 5, 2],
        &[2, 5, 3, 0],
    ];
    const HEXAHEDRON: &[&[usize]] = &[
        &[0, 1, 2, 3],
        &[4, 7, 6, 5],
        &[0, 4, 5, 1],
        &[1, 5, 6, 2],
        &[2, 6, 7, 3],
        &[3, 7, 4, 0],
    ];
    let solid = kind.starts_with("C3D");
    match nodes_of(kind) {
        4 | 10 if solid => (4, TETRAHEDRON),
        5 | 13 if solid => (5, PYRAMID),
        6 | 15 if solid => (6, WEDGE),
        8 | 20 if solid => (8, HEXAHEDRON),
        3 | 6 if !solid => (3, &[&[0, 1, 2]]),
        4 | 8 if !solid => (4, &[&[0, 1, 2, 3]]),
        _ => (0, &[]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two cubes of 2 mm side by side; a shell on the far side of the second.
    const DECK: &str = "** made by hand
*Node, nset=All
1, 0, 0, 0
2, 2, 0, 0
3, 2, 2, 0
4, 0, 2, 0
5, 0, 0, 2
6, 2, 0, 2
7, 2, 2, 2
8, 0, 2, 2
9, 4., 0, 0
10, 4, 2, 0
11, 4, 0, 2
12, 4, 2, 2e0
*ELEMENT, TYPE=C3D8R, ELSET=Solid
1, 1, 2, 3, 4,
5, 6, 7, 8
2, 2, 9, 10, 3, 6, 11, 12, 7
*ELEMENT, TYPE=S4, ELSET=Skin
3, 9, 10, 12, 11
*NSET, NSET=Left
1, 4, 5, 8
*NSET, NSET=Both, GENERATE
1, 4, 1
*NSET, NSET=Both
Left
*NSET, NSET=Ends
1, 12
*ELSET, ELSET=Second
2
*SURFACE, NAME=Top
1, S2
Second, S2
*SURFACE, NAME=Outer, TYPE=ELEMENT
Skin, SPOS
*BOUNDARY
Left, 1, 3
";

    fn read(text: &str, set: &str) -> Result<TriMesh, IoError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("part.inp");
        std::fs::write(&path, text).unwrap();
        read_deck_set(&path, set, &Monitor::default())
    }

    #[test]
    fn sets_and_surfaces_become_their_faces() {
        let area = |set: &str| read(DECK, set).unwrap().area();
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(area("left"), 4.0));
        assert!(near(area("BOTH"), 8.0));
        assert!(near(area("Top"), 8.0));
        assert!(near(area("outer"), 4.0));
        assert!(near(area("second"), 24.0));
        assert!(near(area("solid"), 48.0));
        let top = read(DECK, "top").unwrap();
        assert!(top.points.iter().all(|p| near(p.z, 2.0)));
        // Two nodes of no face stand for themselves.
        let ends = read(DECK, "ends").unwrap();
        assert_eq!(ends.points, [Vec3::zeros(), Vec3::new(4.0, 2.0, 2.0)]);
    }

    #[test]
    fn sets_that_name_each_other_a_thousand_times_are_read_at_once() {
        // Read anew wherever they are named, these are 1000 to the power of seven sets.
        let level = |k: usize| {
            format!(
                "*NSET, NSET=L{k}\n{}\n",
                format!("L{},", k + 1).repeat(1000)
            )
        };
        let levels: String = (0..7).map(level).collect();
        let found = read(&format!("{DECK}{levels}*NSET, NSET=L7\nLeft\n"), "l0").unwrap();
        assert!((found.area() - 4.0).abs() < 1e-12);
    }

    #[test]
    fn bad_decks_are_refused_by_line_or_set() {
        let told = |text: &str, set: &str| read(text, set).unwrap_err().to_string();
        let e = told(DECK, "right");
        assert!(e.contains("\"RIGHT\"") && e.contains("SKIN"), "{e}");
        let e = told(&DECK.replace("2, 2, 0, 0", "2, 2, x, 0"), "left");
        assert!(e.contains("line 4") && e.contains("\"x\""), "{e}");
        let e = told(&DECK.replace("12, 4, 2, 2e0", ""), "outer");
        assert!(e.contains("node 12"), "{e}");
        let e = told(&DECK.replace("1, S2", "1, P2"), "top");
        assert!(e.contains("whole number"), "{e}");
        let e = told(&DECK.replace("1, 4, 1\n", "1, 4, 0\n"), "both");
        assert!(e.contains("step"), "{e}");
        let e = told(&DECK.replace(", NAME=Top", ""), "left");
        assert!(e.contains("NAME"), "{e}");
        // Sets that hold each other end.
        let e = told("*NSET, NSET=A\nB\n*NSET, NSET=B\nA\n", "a");
        assert!(e.contains("holds no node"), "{e}");
    }
}
