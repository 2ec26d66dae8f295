//! One cage: its control points, the real unknowns that move them, and the motions that do nothing
//! to the cloth.
//!
//! A point z inside moves by `d(z) = Σ_j C_j(z) δ_j + (conj(z − z_c)/ρ) β'`, complex-linear in the
//! *handles* (δ, β'): the displacements of the control points \[m\] and, with an affine part, one more
//! handle β' = ρβ \[m\], ρ being the panel's size. A mirrored panel moves by `u·conj(d)`.

use super::green;
use crate::geometry::polygon::{centroid, is_simple, perimeter, sides};
use crate::geometry::{Vec2, complex, point};
use crate::pattern::symmetry::Reflection;
use num_complex::Complex64;

/// A cage and its unknowns.
#[derive(Clone, Debug)]
pub(super) struct Cage {
    /// Control points at rest \[m\], counter-clockwise.
    pub(super) control: Vec<Complex64>,
    /// What scaling keeps \[m\]: the panel's centroid, on the axis if it mirrors itself.
    pub(super) centre: Complex64,
    /// ρ: rms distance of the panel's outline from its centre \[m\].
    pub(super) size: f64,
    /// Whether there is a handle β'.
    pub(super) affine: bool,
    /// The handles each real unknown moves, and in which direction (of length one). A handle and
    /// its mirror image move together.
    pub(super) unknowns: Vec<Vec<(usize, Complex64)>>,
    /// The panel's own reflection, if it mirrors itself.
    own: Option<Reflection>,
    watch: Watch,
}

/// Points of the outline where the map is watched.
#[derive(Clone, Debug)]
struct Watch {
    rest: Vec<Complex64>,
    /// `[point][handle]`.
    weights: Vec<Vec<Complex64>>,
    /// `C'_j`, `[point][control point]`.
    slopes: Vec<Vec<Complex64>>,
    /// Whether the outline is simple at rest; if the file has it otherwise, so be it.
    simple: bool,
}

/// Why a cage's map cannot be cut from cloth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum Fault {
    CageCrosses,
    OutlineCrosses,
    Squeezed,
}

impl Cage {
    /// Around `outline`, with the control points of a cage that is symmetric under `own`, if any:
    /// point j the mirror image of point n − j.
    pub(super) fn new(
        control: &[Vec2],
        outline: &[Vec2],
        own: Option<Reflection>,
        affine: bool,
    ) -> Self {
        let mut centre = centroid(outline);
        if let Some(reflection) = own {
            centre = (centre + reflection.apply(centre)) * 0.5;
        }
        let spread = sides(outline).map(|(a, b)| (b - a).norm() * (a - centre).norm_squared());
        let mut cage = Self {
            control: control.iter().map(|p| complex(*p)).collect(),
            centre: complex(centre),
            size: (spread.sum::<f64>() / perimeter(outline)).sqrt(),
            affine,
            unknowns: Vec::new(),
            own,
            watch: Watch {
                rest: outline.iter().map(|p| complex(*p)).collect(),
                weights: Vec::new(),
                slopes: Vec::new(),
                simple: is_simple(outline),
            },
        };
        cage.unknowns = cage.free_directions();
        let rest = &cage.watch.rest;
        cage.watch.weights = rest.iter().map(|z| cage.weights(*z)).collect();
        cage.watch.slopes = rest
            .iter()
            .map(|z| green::slopes(&cage.control, *z))
            .collect();
        cage
    }

    /// How far each handle carries the point z along: `d(z) = Σ_h w_h · handle_h` \[–\].
    pub(super) fn weights(&self, z: Complex64) -> Vec<Complex64> {
        let mut weights = green::coordinates(&self.control, z);
        if self.affine {
            weights.push((z - self.centre).conj() / self.size);
        }
        weights
    }

    pub(super) fn handle_count(&self) -> usize {
        self.control.len() + usize::from(self.affine)
    }

    /// Handles moved by a change of the unknowns.
    pub(super) fn handles(&self, change: &[f64]) -> Vec<Complex64> {
        let mut handles = vec![Complex64::ZERO; self.handle_count()];
        for (moved, by) in self.unknowns.iter().zip(change) {
            for (handle, direction) in moved {
                handles[*handle] += direction * by;
            }
        }
        handles
    }

    /// The transpose of [`Self::handles`]: gradient by the unknowns, given that by the handles.
    pub(super) fn pull_back<'a>(&'a self, hat: &'a [Complex64]) -> impl Iterator<Item = f64> + 'a {
        let along = |(handle, direction): &(usize, Complex64)| (direction.conj() * hat[*handle]).re;
        self.unknowns
            .iter()
            .map(move |moved| moved.iter().map(along).sum())
    }

    /// The unknowns' part of handle values that respect the symmetry: inverse of [`Self::handles`].
    pub(super) fn unknowns_of<'a>(
        &'a self,
        handles: &'a [Complex64],
    ) -> impl Iterator<Item = f64> + 'a {
        let first = |moved: &Vec<(usize, Complex64)>| (moved[0].1.conj() * handles[moved[0].0]).re;
        self.unknowns.iter().map(first)
    }

    /// Derivatives of `Σ a_h handle_h` by the unknowns.
    pub(super) fn along_unknowns(&self, stencil: &[(usize, Complex64)]) -> Vec<Complex64> {
        let mut slopes = vec![Complex64::ZERO; self.handle_count()];
        for (h, a) in stencil {
            slopes[*h] += a;
        }
        let along =
            |moved: &Vec<(usize, Complex64)>| moved.iter().map(|(h, d)| slopes[*h] * d).sum();
        self.unknowns.iter().map(along).collect()
    }

    /// At each control point the difference T_j − T_{j−1} of the factors T = e/ē by which its two
    /// sides change, as a stencil of the handles \[1/m\].
    pub(super) fn side_differences(&self) -> Vec<[(usize, Complex64); 3]> {
        let n = self.control.len();
        let at = |j: usize| {
            let (before, after) = ((j + n - 1) % n, (j + 1) % n);
            let next = (self.control[after] - self.control[j]).inv();
            let previous = (self.control[j] - self.control[before]).inv();
            [(after, next), (j, -next - previous), (before, previous)]
        };
        (0..n).map(at).collect()
    }

    /// Handle values at rest: where the control points are, and no β'.
    pub(super) fn rest_handles(&self) -> Vec<Complex64> {
        let mut handles = self.control.clone();
        handles.resize(self.handle_count(), Complex64::ZERO);
        handles
    }

    /// Handle displacements that move the panel, displaced by `handles`, as a rigid body: along x,
    /// along y and about the middle of the control points, or only along the axis of a panel that
    /// mirrors itself. Orthogonal to each other.
    pub(super) fn rigid_motions(&self, handles: &[Complex64]) -> Vec<Vec<Complex64>> {
        let n = self.control.len();
        let translation = |by: Complex64| {
            let mut motion = vec![by; n];
            motion.resize(self.handle_count(), Complex64::ZERO);
            motion
        };
        if let Some(reflection) = self.own {
            return vec![translation(reflection.u.sqrt())];
        }
        let mut turned: Vec<_> = self
            .rest_handles()
            .iter()
            .zip(handles)
            .map(|(r, d)| r + d)
            .collect();
        let middle = turned[..n].iter().sum::<Complex64>() / n as f64;
        for (h, handle) in turned.iter_mut().enumerate() {
            *handle = Complex64::I * (*handle - if h < n { middle } else { Complex64::ZERO });
        }
        vec![
            translation(Complex64::ONE),
            translation(Complex64::I),
            turned,
        ]
    }

    /// The control points as a polygon, carried along by the whole map \[m\].
    pub(super) fn polygon(&self, handles: &[Complex64]) -> Vec<Vec2> {
        let beta = self.beta(handles);
        let carried =
            |(z, by): (&Complex64, &Complex64)| point(z + by + beta * (z - self.centre).conj());
        self.control.iter().zip(handles).map(carried).collect()
    }

    /// What is wrong with the map, if anything. A map is fit for cutting if its least stretch
    /// `|F'| − |β|` stays above `least` of the panel's mean scale, F' does not wind around zero
    /// along the outline (so it has no zero inside), and the outline does not cross itself.
    pub(super) fn fault(&self, handles: &[Complex64], least: f64) -> Option<Fault> {
        let slopes: Vec<_> = self
            .watch
            .slopes
            .iter()
            .map(|row| Complex64::ONE + sum(row, handles))
            .collect();
        let beta = self.beta(handles).norm();
        let mean = slopes.iter().map(|s| s.norm()).sum::<f64>() / slopes.len() as f64;
        let enough = |s: &Complex64| s.norm() - beta >= least * mean;
        let next = slopes.iter().cycle().skip(1);
        let winding: f64 = slopes.iter().zip(next).map(|(a, b)| (b / a).arg()).sum();
        if !slopes.iter().all(enough) || winding.abs() > 1.0 {
            return Some(Fault::Squeezed);
        }
        let moved = |(z, row): (&Complex64, &Vec<Complex64>)| point(z + sum(row, handles));
        let outline = self.watch.rest.iter().zip(&self.watch.weights).map(moved);
        if self.watch.simple && !is_simple(&outline.collect::<Vec<_>>()) {
            return Some(Fault::OutlineCrosses);
        }
        (!is_simple(&self.polygon(handles))).then_some(Fault::CageCrosses)
    }

    /// β: the map is `F(z) + β·conj(z − z_c)` \[–\].
    fn beta(&self, handles: &[Complex64]) -> Complex64 {
        if self.affine {
            handles[self.control.len()] / self.size
        } else {
            Complex64::ZERO
        }
    }

    /// Two unknowns per handle, x and y; with a mirror image, both sides' handles move together, and
    /// those on the axis only along it (β along u).
    fn free_directions(&self) -> Vec<Vec<(usize, Complex64)>> {
        let n = self.control.len();
        let both = [Complex64::ONE, Complex64::I];
        let Some(reflection) = self.own else {
            let handles = 0..self.handle_count();
            return handles.flat_map(|h| both.map(|d| vec![(h, d)])).collect();
        };
        let mut unknowns = Vec::new();
        for j in 0..=n / 2 {
            let image = (n - j) % n;
            if image == j {
                unknowns.push(vec![(j, reflection.u.sqrt())]);
            } else {
                unknowns.extend(both.map(|d| vec![(j, d), (image, reflection.turn(d))]));
            }
        }
        if self.affine {
            unknowns.push(vec![(n, reflection.u)]);
        }
        unknowns
    }
}

/// `Σ w_h handle_h`.
pub(super) fn sum(weights: &[Complex64], handles: &[Complex64]) -> Complex64 {
    weights.iter().zip(handles).map(|(w, h)| w * h).sum()
}
