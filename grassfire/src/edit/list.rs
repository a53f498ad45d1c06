//! Edits of the proposal's skeleton as an ordered list that is replayed on every run.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::bridge::Between;
use super::draft::EditedSkeleton;
use super::error::{EditListError, Refusal};
use super::places::{Plane, Rotation, Stretch};
use super::region::{Region, Selection, select};
use super::{bridge, copy, delete, fill, members, places, split, subdivide, weld};
use crate::Vec3;
use crate::radii;
use crate::skeleton::{self, Skeleton};
use crate::topology::Betti;

/// Each makes four quads of one.
const MOST_HALVINGS: usize = 4;

/// One edit of the proposal's skeleton: where, and one kind of change. It names a place, not points: so it can be replayed on
/// another proposal. Radii stay with their points when these move.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Edit {
    /// Where; everywhere when left out.
    pub within: Option<Region>,
    /// New radius, mm: half of the wall.
    pub set: Option<f64>,
    /// Factor on the radius.
    pub scale: Option<f64>,
    /// Added to the radius, mm.
    pub add: Option<f64>,
    /// Passes of smoothing over the radii there, after the change.
    pub smooth: usize,
    /// Moves points by this, mm.
    pub r#move: Option<[f64; 3]>,
    /// Turns points about an axis.
    pub rotate: Option<Rotation>,
    /// Scales places, not radii, about a centre.
    pub stretch: Option<Stretch>,
    /// Moves points straight onto a plane.
    pub snap: Option<Plane>,
    /// Takes quads and beams away, with their material.
    pub delete: bool,
    /// Copies quads and beams, this much away, mm.
    pub duplicate: Option<[f64; 3]>,
    /// Halves quads and beam edges, and the strips they are in, so many times.
    pub subdivide: usize,
    /// Joins points that are no farther apart than this, mm.
    pub weld: Option<f64>,
    /// Joins all points to one in their middle.
    pub merge: bool,
    /// Takes quads and beams loose from the others; nothing moves.
    pub split: bool,
    /// Spans quads between two rims, each from corner to corner.
    pub bridge: Option<Between>,
    /// A beam between two points of the skeleton.
    pub strut: Option<Between>,
    /// Makes the room between two sheets solid, over the points of the first that `within` holds.
    pub fill: Option<Between>,
    /// `delete` may leave pieces that hang on nothing.
    pub cut: bool,
}

/// What an edit did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Edited {
    /// Its kind, as its key in the list.
    pub kind: &'static str,
    /// Points of the skeleton that it held.
    pub points: usize,
    /// Mean radius there before, mm.
    pub mean_before: f64,
    /// The same after; that before where the edit changes no radii.
    pub mean_after: f64,
    /// Largest change of a radius, mm.
    pub largest_change: f64,
    /// Farthest way of a point, mm.
    pub moved: f64,
    /// The whole skeleton before.
    pub before: Counts,
    /// And after.
    pub after: Counts,
}

/// How many parts a skeleton has.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Points.
    pub points: usize,
    /// Quads.
    pub quads: usize,
    /// Sheets: quads joined over edges with two quads.
    pub sheets: usize,
    /// Beams, from junction to junction.
    pub beams: usize,
    /// Pieces, loops, cavities.
    pub topology: Betti,
}

impl Edit {
    /// The keys of the kinds of edits that are given, but smooth.
    fn kinds(&self) -> Vec<&'static str> {
        let all = [
            ("set", self.set.is_some()),
            ("scale", self.scale.is_some()),
            ("add", self.add.is_some()),
            ("move", self.r#move.is_some()),
            ("rotate", self.rotate.is_some()),
            ("stretch", self.stretch.is_some()),
            ("snap", self.snap.is_some()),
            ("delete", self.delete),
            ("duplicate", self.duplicate.is_some()),
            ("subdivide", self.subdivide > 0),
            ("weld", self.weld.is_some()),
            ("merge", self.merge),
            ("split", self.split),
            ("bridge", self.bridge.is_some()),
            ("strut", self.strut.is_some()),
            ("fill", self.fill.is_some()),
        ];
        let given = all.into_iter().filter(|kind| kind.1);
        given.map(|kind| kind.0).collect()
    }

    /// The key of its kind.
    fn kind(&self) -> &'static str {
        self.kinds().first().copied().unwrap_or("smooth")
    }

    fn of_radii(&self) -> bool {
        ["set", "scale", "add", "smooth"].contains(&self.kind())
    }

    /// Whether it means something.
    fn check(&self) -> Result<(), Refusal> {
        let found = self.kinds().len();
        if found > 1 || found == 0 && self.smooth == 0 || self.smooth > 0 && !self.of_radii() {
            return Err(Refusal::Kind { found });
        }
        if let Some(key) = ["bridge", "strut"].into_iter().find(|k| *k == self.kind())
            && self.within.is_some()
        {
            return Err(Refusal::Within { key });
        }
        let bad = |key, value, wanted| Err(Refusal::Value { key, value, wanted });
        if self.subdivide > MOST_HALVINGS {
            return bad("subdivide", self.subdivide as f64, "at most 4");
        }
        for (key, value) in [
            ("set", self.set),
            ("scale", self.scale),
            ("weld", self.weld),
        ] {
            if let Some(value) = value.filter(|v| !v.is_finite() || *v <= 0.0) {
                return bad(key, value, "a positive number");
            }
        }
        let lengths = [
            ("add", self.add.map(|v| [v; 3])),
            ("move", self.r#move),
            ("duplicate", self.duplicate),
        ];
        for (key, value) in lengths {
            let numbers = value.into_iter().flatten();
            if let Some(value) = numbers.into_iter().find(|v| !v.is_finite()) {
                return bad(key, value, "a length");
            }
        }
        places::check(self)
    }
}

/// The entry of a list that says the same, as JSON.
impl fmt::Display for Edit {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let mut value = json!(self);
        if let Some(keys) = value.as_object_mut() {
            keys.retain(|_, v| !(v.is_null() || *v == json!(false) || *v == json!(0)));
        }
        value.fmt(f)
    }
}

/// Refuses edits that mean nothing.
///
/// # Errors
/// [`Refusal::Kind`], [`Refusal::Value`].
pub fn check_edits(edits: &[Edit]) -> Result<(), EditListError> {
    let refuse =
        |(edit, one): (usize, &Edit)| one.check().map_err(|why| EditListError { edit, why });
    edits.iter().enumerate().try_for_each(refuse)
}

/// Applies a list of edits in its order to a skeleton, mm; points that are `kept` do not change.
///
/// After every edit the skeleton is checked ([`skeleton::check`]) and its parts and topology are counted. Radii below `least`
/// are refused: such walls would vanish on the voxels. So are edits that hold nothing, flatten quads, or leave a piece that
/// hangs on nothing where the list does not say `cut`.
///
/// # Errors
/// [`EditListError`] names the edit, what is wrong and where.
pub fn edit(
    skeleton: &Skeleton,
    kept: &[bool],
    edits: &[Edit],
    least: f64,
) -> Result<EditedSkeleton, EditListError> {
    check_edits(edits)?;
    let mut draft = EditedSkeleton::new(skeleton, kept);
    for (number, edit) in edits.iter().enumerate() {
        let done = apply(&mut draft, edit, least);
        let done = done.map_err(|why| EditListError { edit: number, why })?;
        draft.done.push(done);
    }
    Ok(draft)
}

impl EditedSkeleton {
    /// One more edit at the end of the list; nothing changes when it is refused.
    ///
    /// # Errors
    /// [`Refusal`].
    pub fn add(&mut self, edit: &Edit, least: f64) -> Result<(), Refusal> {
        edit.check()?;
        let mut draft = self.clone();
        let done = apply(&mut draft, edit, least)?;
        draft.done.push(done);
        *self = draft;
        Ok(())
    }
}

fn apply(draft: &mut EditedSkeleton, edit: &Edit, least: f64) -> Result<Edited, Refusal> {
    let selection = select(edit.within.as_ref(), draft)?;
    let mean = |radii: &[f64], held: &[usize]| {
        held.iter().map(|&v| radii[v]).sum::<f64>() / held.len().max(1) as f64
    };
    let held = selection.held();
    let mut out = Edited {
        kind: edit.kind(),
        points: held.len(),
        mean_before: mean(&draft.skeleton.radii, &held),
        before: counts(&draft.skeleton),
        ..Edited::default()
    };
    out.mean_after = out.mean_before;
    if edit.of_radii() {
        out.largest_change = change_radii(&mut draft.skeleton, &held, edit, least)?;
        out.mean_after = mean(&draft.skeleton.radii, &held);
    } else if !change_cells(draft, &selection, edit)? {
        out.moved = places::change(draft, &selection, edit)?;
    }
    skeleton::check(&draft.skeleton)?;
    out.after = counts(&draft.skeleton);
    Ok(out)
}

/// Edits of quads and beams; false when the edit is none of them.
fn change_cells(
    draft: &mut EditedSkeleton,
    selection: &Selection,
    edit: &Edit,
) -> Result<bool, Refusal> {
    if let Some(by) = edit.duplicate {
        copy::duplicate(draft, selection.with_cells(draft)?, &Vec3::from(by));
    } else if let Some(tolerance) = edit.weld {
        weld::weld(draft, selection, tolerance)?;
    } else if let Some(between) = edit.bridge {
        bridge::bridge(draft, &between)?;
    } else if let Some(between) = edit.strut {
        bridge::strut(draft, &between)?;
    } else if let Some(between) = edit.fill {
        fill::fill(draft, selection, &between)?;
    } else if edit.delete {
        delete::delete(draft, selection.with_cells(draft)?, edit.cut)?;
    } else if edit.merge {
        weld::merge(draft, selection)?;
    } else if edit.split {
        split::split(draft, selection.with_cells(draft)?)?;
    } else if edit.subdivide > 0 {
        subdivide::subdivide(draft, selection.with_cells(draft)?);
        // The finer net has other points there.
        for _ in 1..edit.subdivide {
            subdivide::subdivide(draft, &select(edit.within.as_ref(), draft)?);
        }
    } else {
        return Ok(false);
    }
    Ok(true)
}

fn counts(skeleton: &Skeleton) -> Counts {
    Counts {
        points: skeleton.points.len(),
        quads: skeleton.quads.len(),
        sheets: members::count(&members::sheets(skeleton)),
        beams: members::count(&members::beams(skeleton)),
        topology: skeleton::topology(skeleton),
    }
}

/// Gives the largest change.
fn change_radii(
    skeleton: &mut Skeleton,
    held: &[usize],
    edit: &Edit,
    least: f64,
) -> Result<f64, Refusal> {
    let before = skeleton.radii.clone();
    for &i in held {
        let r = &mut skeleton.radii[i];
        *r = edit
            .set
            .unwrap_or(*r * edit.scale.unwrap_or(1.0) + edit.add.unwrap_or(0.0));
    }
    if edit.smooth > 0 {
        let mut smooth = skeleton.clone();
        radii::smooth(&mut smooth, edit.smooth);
        held.iter()
            .for_each(|&i| skeleton.radii[i] = smooth.radii[i]);
    }
    let after = &skeleton.radii;
    if let Some(&thin) = held.iter().find(|&&i| after[i] < least.min(before[i])) {
        return Err(Refusal::TooThin {
            radius: after[thin],
            least,
            place: skeleton.points[thin],
        });
    }
    let changes = held.iter().map(|&i| (after[i] - before[i]).abs());
    Ok(changes.fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::fixtures::{run, tee};
    use super::*;

    fn row() -> Skeleton {
        Skeleton {
            points: (0..5).map(|i| Vec3::new(f64::from(i), 0.0, 0.0)).collect(),
            radii: vec![2.0; 5],
            beams: (0..4).map(|i| [i, i + 1]).collect(),
            ..Skeleton::default()
        }
    }

    fn scale(factor: f64) -> Edit {
        Edit {
            scale: Some(factor),
            ..Edit::default()
        }
    }

    #[test]
    fn edits_act_in_their_order_and_only_where_they_are_to() {
        let ball = Region::Sphere {
            centre: [4.0, 0.0, 0.0],
            radius: 1.0,
        };
        let set = Edit {
            within: Some(ball),
            set: Some(3.0),
            ..Edit::default()
        };
        let kept = [true, false, false, false, false];
        let edited = edit(&row(), &kept, &[set, scale(1.5)], 0.5).expect("good edits");
        assert_eq!(edited.skeleton.radii, [2.0, 3.0, 3.0, 4.5, 4.5]);
        let done = edited.done;
        assert_eq!(done[0].points, 2);
        assert_eq!((done[1].points, done[1].largest_change), (4, 1.5));
    }

    #[test]
    fn smoothing_stays_in_its_region() {
        let mut skeleton = row();
        skeleton.radii[4] = 6.0;
        let smooth = Edit {
            within: Some(Region::Box {
                min: [3.5, -1.0, -1.0],
                max: [9.0, 1.0, 1.0],
            }),
            smooth: 1,
            ..Edit::default()
        };
        let edited = edit(&skeleton, &[false; 5], &[smooth], 0.5).expect("a good edit");
        assert_eq!(edited.skeleton.radii, [2.0, 2.0, 2.0, 2.0, 4.0]);
    }

    #[test]
    fn an_edit_shows_as_its_entry() {
        let edit = Edit {
            within: Some(Region::Panel([1.0, 2.0, 3.5])),
            delete: true,
            ..Edit::default()
        };
        // The order of the keys depends on a feature of serde_json that other crates may turn on.
        let short = json!({"within": {"panel": [1.0, 2.0, 3.5]}, "delete": true});
        let text = edit.to_string();
        assert_eq!(
            serde_json::from_str::<serde_json::Value>(&text).ok(),
            Some(short)
        );
        assert_eq!(serde_json::from_str::<Edit>(&text).ok(), Some(edit));
    }

    #[test]
    fn edits_that_mean_nothing_are_refused() {
        let refused = |one: Edit| edit(&row(), &[false; 5], &[one], 0.5).expect_err("refused");
        let run = |one: Edit| refused(one).why;
        assert!(matches!(
            run(Edit::default()),
            Refusal::Kind { found: 0, .. }
        ));
        let both = Edit {
            set: Some(1.0),
            ..scale(2.0)
        };
        assert!(matches!(run(both), Refusal::Kind { found: 2, .. }));
        assert!(matches!(run(scale(f64::NAN)), Refusal::Value { .. }));
        assert!(matches!(run(scale(0.1)), Refusal::TooThin { .. }));
        let far = Edit {
            within: Some(Region::Sphere {
                centre: [9.0, 0.0, 0.0],
                radius: 1.0,
            }),
            ..scale(2.0)
        };
        let error = refused(far);
        assert!(
            matches!(error.why, Refusal::Nothing { distance, .. } if (distance - 4.0).abs() < 1e-12),
            "{error}"
        );
        assert!(error.hint().is_some());
    }

    /// Quads and beams as sorted corners, places and radii in millionths of a millimetre.
    fn cells(skeleton: &Skeleton) -> Vec<Vec<[i64; 4]>> {
        let corner = |v: u32| {
            let (p, r) = (skeleton.points[v as usize], skeleton.radii[v as usize]);
            [p.x, p.y, p.z, r].map(|x| (1e6 * x).round() as i64)
        };
        let quads = skeleton.quads.iter().map(|q| &q[..]);
        let cells = quads.chain(skeleton.beams.iter().map(|b| &b[..]));
        let sorted = |cell: &[u32]| {
            let mut corners: Vec<_> = cell.iter().map(|&v| corner(v)).collect();
            corners.sort_unstable();
            corners
        };
        let mut out: Vec<_> = cells.map(sorted).collect();
        out.sort_unstable();
        out
    }

    proptest! {
        #[test]
        fn a_list_finds_the_same_places_whatever_the_numbers(order in Just((0..28_u32).collect::<Vec<_>>()).prop_shuffle(), turn in 0..18_usize) {
            let before = tee();
            let mut other = Skeleton {
                points: vec![Vec3::zeros(); 28],
                radii: before.radii.clone(),
                quads: before.quads.iter().map(|q| q.map(|v| order[v as usize])).collect(),
                beams: Vec::new(),
            };
            (0..28).for_each(|v| other.points[order[v] as usize] = before.points[v]);
            other.quads.rotate_left(turn);
            other.quads.iter_mut().for_each(|q| q.rotate_left(turn % 4));
            // The web turned and halved, a copy of it welded on, its top joined with the base, a corner of the base cut off.
            let list: Vec<Edit> = serde_json::from_str(r#"[
                {"within": {"sheet": [20, 15, 9]}, "stretch": {"centre": [20, 0, 0], "factors": [1, 1, 0.8]}},
                {"within": {"sheet": [20, 15, 9]}, "subdivide": 1},
                {"within": {"sheet": [20, 14, 9]}, "duplicate": [10, 0, 0]},
                {"weld": 0.1},
                {"bridge": {"from": [30, 14, 16], "to": [40, 14, 0]}},
                {"within": {"box": {"min": [-1, -1, -1], "max": [11, 6, 1]}}, "delete": true},
                {"within": {"sphere": {"centre": [20, 15, 16], "radius": 9}}, "scale": 1.5, "smooth": 1}
            ]"#).expect("good edits");
            let [one, two] = [&before, &other].map(|skeleton| run(skeleton, &list));
            prop_assert_eq!(cells(&one.skeleton), cells(&two.skeleton));
            let counts = |edited: &EditedSkeleton| -> Vec<Counts> { edited.done.iter().map(|d| d.after).collect() };
            prop_assert_eq!(counts(&one), counts(&two));
            prop_assert_eq!((one.gone.len(), one.done[4].after.quads > one.done[3].after.quads), (two.gone.len(), true));
        }
    }
}
