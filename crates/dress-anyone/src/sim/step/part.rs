//! A cloth in halves of halves, so that several threads can step it and each works in few bytes.
//!
//! Vertices are numbered anew by places: every part of the cloth has a range of them, its two halves
//! have the two halves of the range. A constraint belongs to the smallest part that has all of its
//! vertices. A sweep goes over both halves of a part, which share nothing and may run at the same time,
//! and then over what lies across them. That order is one of Gauss–Seidel, and is the same whatever the
//! number of threads; threads meet once per part and sweep.
//!
//! A part is halved where its vertices, in the order in which a walk from one end of it comes to them,
//! are halved. Of 10,000 vertices some 7 % of the constraints lie across.

use super::contact::{Contacts, Look};
use super::crease::Creases;
use super::hold::Holds;
use super::lanes::Four;
use super::pull_back::RestHat;
use super::stretch::Stretch;
use super::turn::Turn;
use crate::geometry::graph::walk_from_end;
use crate::sim::cloth::{Cloth, Rest};
use crate::sim::energy::contact::{ContactParams, Surface};
use rayon::join;
use std::slice;

/// Most vertices of a part that is not halved: their rows lie in the innermost cache.
pub(super) const MOST: usize = 1200;

/// Some of a cloth's vertices, and the constraints between them.
#[derive(Default)]
pub(super) struct Part {
    /// How many vertices.
    len: usize,
    stretch: Stretch,
    turn: Turn,
    creases: Creases,
    holds: Holds,
    pub(super) contacts: Contacts,
    halves: Option<Box<[Part; 2]>>,
}

/// A visit to all constraints.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sweep {
    /// Whether it is the first of its step, or the last where the walk goes back.
    pub(super) first: bool,
    /// Whether to record it.
    pub(super) record: bool,
}

/// Which constraints lie in a part.
#[derive(Default)]
struct Within {
    triangles: Vec<u32>,
    hinges: Vec<u32>,
    folds: Vec<u32>,
    holds: Vec<u32>,
    contacts: Vec<u32>,
}

/// How a cloth is cut into parts, and what a step needs to know of it.
struct Plan<'a> {
    cloth: &'a Cloth,
    /// `[cloth vertex]`.
    place: Vec<u32>,
    /// Cloth vertices of each contact point.
    corners: Vec<Vec<u32>>,
    contact: ContactParams,
    dt: f64,
    most: usize,
}

impl Part {
    /// The whole of `cloth` in parts of up to `most` vertices; the cloth vertex at each place, and the
    /// place of each cloth vertex.
    pub(super) fn whole(
        cloth: &Cloth,
        contact: ContactParams,
        dt: f64,
        most: usize,
    ) -> (Self, Vec<u32>, Vec<u32>) {
        let order = order(cloth, most);
        let mut place = vec![0; order.len()];
        for (at, v) in order.iter().enumerate() {
            place[*v as usize] = at as u32;
        }
        let plan = Plan {
            cloth,
            place,
            corners: (cloth.contacts.iter())
                .map(|point| point.parts().map(|(v, _)| v as u32).collect())
                .collect(),
            contact,
            dt,
            most,
        };
        let all = Within {
            triangles: plan.sorted(cloth.triangles.iter().map(<[u32; 3]>::as_slice)),
            hinges: plan.sorted(cloth.hinges.iter().map(|h| &h.vertices[..])),
            folds: plan.sorted(cloth.folds.iter().map(|f| &f.hinge.vertices[..])),
            holds: plan.sorted(cloth.holds.iter().map(|h| slice::from_ref(&h.vertex))),
            contacts: plan.sorted(plan.corners.iter().map(Vec::as_slice)),
        };
        let whole = Self::new(&plan, 0, order.len(), all);
        (whole, order, plan.place)
    }

    /// The `len` vertices from place `first` on.
    fn new(plan: &Plan<'_>, first: usize, len: usize, within: Within) -> Self {
        let (mut own, mut halves) = (within, None);
        if len > plan.most {
            let middle = first + len / 2;
            let [low, high] = own.split(plan, middle as u32);
            halves = Some(Box::new([
                Self::new(plan, first, middle - first, low),
                Self::new(plan, middle, first + len - middle, high),
            ]));
        }
        let (cloth, dt) = (plan.cloth, plan.dt);
        let place = |v: u32| plan.place[v as usize] - first as u32;
        Self {
            len,
            stretch: Stretch::new(cloth, &own.triangles, place, len, dt),
            turn: Turn::new(cloth, &own.hinges, place, len, dt),
            creases: Creases::new(cloth, &own.folds, place, dt),
            holds: Holds::new(cloth, &own.holds, place, dt),
            contacts: Contacts::new(cloth, &own.contacts, place, len, &plan.contact, dt),
            halves,
        }
    }

    /// Takes on a rest shape; `w` are inverse masses \[1/kg\], `[place]`.
    pub(super) fn grow(&mut self, rest: &Rest, w: &[f64]) {
        if let Some([low, high]) = self.halves.as_deref_mut() {
            let (w_low, w_high) = w.split_at(low.len);
            low.grow(rest, w_low);
            high.grow(rest, w_high);
        }
        self.stretch.grow(rest);
        self.turn.grow(rest, |place| w[place as usize]);
        self.creases.grow(rest);
    }

    /// Looks for contacts of the positions before the step, and forgets what was recorded.
    pub(super) fn look(&mut self, look: Look<'_, impl Surface>) {
        if let Some([low, high]) = self.halves.as_deref_mut() {
            let [first, second] = look.split_at(low.len);
            join(|| low.look(first), || high.look(second));
        }
        self.stretch.taped.clear();
        self.turn.taped.clear();
        self.creases.clear();
        self.holds.clear();
        self.contacts.look(look);
    }

    /// Visits membrane, bending, folds and holds.
    pub(super) fn sweep(&mut self, rows: &mut [Four], sweep: Sweep) {
        if let Some([low, high]) = self.halves.as_deref_mut() {
            let (r_low, r_high) = rows.split_at_mut(low.len);
            join(|| low.sweep(r_low, sweep), || high.sweep(r_high, sweep));
        }
        let Sweep { first, record } = sweep;
        self.stretch.taped.sweep(rows, first, record);
        self.turn.taped.sweep(rows, first, record);
        self.creases.sweep(rows, first, record);
        self.holds.sweep(rows, first, record);
    }

    /// Walks back through the last recorded [`Self::sweep`], undoing it on `rows`, and hands the
    /// gradients `hats` by what it wrote on to what it read.
    pub(super) fn pull_back(&mut self, rows: &mut [Four], hats: &mut [Four], last: bool) {
        self.holds.pull_back(rows, hats, last);
        self.creases.pull_back(rows, hats, last);
        self.turn.taped.pull_back(rows, hats, last);
        self.stretch.taped.pull_back(rows, hats, last);
        if let Some([low, high]) = self.halves.as_deref_mut() {
            let (r_low, r_high) = rows.split_at_mut(low.len);
            let (h_low, h_high) = hats.split_at_mut(low.len);
            join(
                || low.pull_back(r_low, h_low, last),
                || high.pull_back(r_high, h_high, last),
            );
        }
    }

    /// Visits contacts with the body.
    pub(super) fn sweep_contacts(&mut self, rows: &mut [Four], record: bool) {
        if let Some([low, high]) = self.halves.as_deref_mut() {
            let (r_low, r_high) = rows.split_at_mut(low.len);
            join(
                || low.sweep_contacts(r_low, record),
                || high.sweep_contacts(r_high, record),
            );
        }
        self.contacts.sweep(rows, record);
    }

    /// The same for [`Self::sweep_contacts`].
    pub(super) fn pull_back_contacts(&mut self, rows: &mut [Four], hats: &mut [Four]) {
        self.contacts.pull_back(rows, hats);
        if let Some([low, high]) = self.halves.as_deref_mut() {
            let (r_low, r_high) = rows.split_at_mut(low.len);
            let (h_low, h_high) = hats.split_at_mut(low.len);
            join(
                || low.pull_back_contacts(r_low, h_low),
                || high.pull_back_contacts(r_high, h_high),
            );
        }
    }

    /// Draws back what the body carries.
    pub(super) fn rub(&mut self, before: &[Four], rows: &mut [Four]) {
        if let Some([low, high]) = self.halves.as_deref_mut() {
            let (r_low, r_high) = rows.split_at_mut(low.len);
            let (b_low, b_high) = before.split_at(low.len);
            join(|| low.rub(b_low, r_low), || high.rub(b_high, r_high));
        }
        self.contacts.rub(before, rows);
    }

    /// The same for [`Self::rub`].
    pub(super) fn pull_back_rub(
        &mut self,
        before: &[Four],
        rows: &mut [Four],
        hats: &mut [Four],
        before_hat: &mut [Four],
    ) {
        (self.contacts).pull_back_rub(before, rows, hats, before_hat);
        if let Some([low, high]) = self.halves.as_deref_mut() {
            let (b_low, b_high) = before.split_at(low.len);
            let (r_low, r_high) = rows.split_at_mut(low.len);
            let (h_low, h_high) = hats.split_at_mut(low.len);
            let (bh_low, bh_high) = before_hat.split_at_mut(low.len);
            join(
                || low.pull_back_rub(b_low, r_low, h_low, bh_low),
                || high.pull_back_rub(b_high, r_high, h_high, bh_high),
            );
        }
    }

    /// Through the planes of the contacts, to the positions before the step.
    pub(super) fn pull_back_look<S: Surface>(
        &mut self,
        surface: &S,
        before: &[Four],
        before_hat: &mut [Four],
    ) {
        self.contacts.pull_back_look(surface, before, before_hat);
        if let Some([low, high]) = self.halves.as_deref_mut() {
            let (b_low, b_high) = before.split_at(low.len);
            let (h_low, h_high) = before_hat.split_at_mut(low.len);
            join(
                || low.pull_back_look(surface, b_low, h_low),
                || high.pull_back_look(surface, b_high, h_high),
            );
        }
    }

    /// Adds the gradients by the rest shape to `all`, and forgets them.
    pub(super) fn hand_over(&mut self, rest: &Rest, all: &mut RestHat) {
        if let Some([low, high]) = self.halves.as_deref_mut() {
            low.hand_over(rest, all);
            high.hand_over(rest, all);
        }
        self.stretch.hand_over(all);
        self.turn.hand_over(rest, all);
        self.creases.hand_over(rest, all);
    }
}

impl Plan<'_> {
    /// Elements by the first of their places, so that neighbours lie together.
    fn sorted<'v>(&self, elements: impl Iterator<Item = &'v [u32]>) -> Vec<u32> {
        let first = |vertices: &[u32]| vertices.iter().map(|v| self.place[*v as usize]).min();
        let firsts: Vec<Option<u32>> = elements.map(first).collect();
        let mut order: Vec<u32> = (0..firsts.len() as u32).collect();
        order.sort_by_key(|e| firsts[*e as usize]);
        order
    }

    /// Takes from `elements` those with all vertices before place `middle`, and those with all from there
    /// on.
    fn split<'v>(
        &self,
        elements: &mut Vec<u32>,
        middle: u32,
        vertices: impl Fn(usize) -> &'v [u32],
    ) -> [Vec<u32>; 2] {
        let mut halves = [Vec::new(), Vec::new()];
        elements.retain(|&e| {
            let vertices = vertices(e as usize);
            let high = |v: &u32| self.place[*v as usize] >= middle;
            let highs = vertices.iter().filter(|v| high(v)).count();
            let across = highs > 0 && highs < vertices.len();
            if !across {
                halves[usize::from(highs > 0)].push(e);
            }
            across
        });
        halves
    }
}

impl Within {
    /// Takes away what lies before place `middle`, and what lies from there on.
    fn split(&mut self, plan: &Plan<'_>, middle: u32) -> [Self; 2] {
        let cloth = plan.cloth;
        let mut triangles = plan.split(&mut self.triangles, middle, |e| &cloth.triangles[e]);
        let mut hinges = plan.split(&mut self.hinges, middle, |e| &cloth.hinges[e].vertices);
        let mut folds = plan.split(&mut self.folds, middle, |e| &cloth.folds[e].hinge.vertices);
        let mut holds = plan.split(&mut self.holds, middle, |e| {
            slice::from_ref(&cloth.holds[e].vertex)
        });
        let mut contacts = plan.split(&mut self.contacts, middle, |e| &plan.corners[e]);
        let [low, high] = [0, 1].map(|half| Self {
            triangles: std::mem::take(&mut triangles[half]),
            hinges: std::mem::take(&mut hinges[half]),
            folds: std::mem::take(&mut folds[half]),
            holds: std::mem::take(&mut holds[half]),
            contacts: std::mem::take(&mut contacts[half]),
        });
        [low, high]
    }
}

/// The vertices of `cloth` so that halves of halves, down to `most` vertices, have little in common.
fn order(cloth: &Cloth, most: usize) -> Vec<u32> {
    let count = cloth.vertex_count;
    let mut neighbours = vec![Vec::new(); count];
    for t in &cloth.triangles {
        for k in 0..3 {
            neighbours[t[k] as usize].extend([t[(k + 1) % 3], t[(k + 2) % 3]]);
        }
    }
    let mut order: Vec<u32> = (0..count as u32).collect();
    arrange(&mut order, &neighbours, most, &mut vec![false; count]);
    order
}

/// Brings `vertices` into the order of a walk from one end of them, and then each half of them.
/// `inside` is false everywhere, before and after.
fn arrange(vertices: &mut [u32], neighbours: &[Vec<u32>], most: usize, inside: &mut [bool]) {
    walk_from_end(vertices, neighbours, inside);
    if vertices.len() > most {
        let (low, high) = vertices.split_at_mut(vertices.len() / 2);
        arrange(low, neighbours, most, inside);
        arrange(high, neighbours, most, inside);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::cloth::fixtures::{SOFT, tube};
    use crate::sim::step::lanes::Elements;
    use std::collections::BTreeSet;

    impl Part {
        /// Notes the triangles and hinges within.
        fn count(&self, all: &mut [BTreeSet<usize>; 2]) {
            let elements = [&self.stretch.triangles, &self.turn.hinges];
            for (all, elements) in all.iter_mut().zip(elements) {
                for (_, e) in elements.iter().flat_map(Elements::each) {
                    assert!(all.insert(e), "{e} twice");
                }
            }
            if let Some([low, high]) = self.halves.as_deref() {
                assert_eq!(low.len + high.len, self.len);
                low.count(all);
                high.count(all);
            }
        }
    }

    #[test]
    fn every_constraint_is_in_one_part_and_few_lie_across() {
        let mesh = tube(48, 30, 0.02);
        let cloth = Cloth::new(&mesh, &SOFT);
        let contact = ContactParams::default();
        let (whole, order, place) = Part::whole(&cloth, contact, 0.01, 400);
        let mut all = [(); 2].map(|()| BTreeSet::new());
        whole.count(&mut all);
        assert_eq!(all[0].len(), cloth.triangles.len());
        assert_eq!(all[1].len(), cloth.hinges.len());
        for (v, place) in place.iter().enumerate() {
            assert_eq!(order[*place as usize] as usize, v);
        }
        // A ring of 48 vertices has 96 triangles to either side of it.
        let across = whole.stretch.triangles.iter().flat_map(Elements::each);
        let across = across.count();
        assert!((90..=200).contains(&across), "{across}");
    }
}
