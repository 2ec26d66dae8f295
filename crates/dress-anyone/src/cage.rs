//! The control cage of each panel (paper §4.3, §4.5): control points ζ carry the rest shape x̄.
//!
//! `x̄ = x̄₀ + W (ζ − ζ₀)` with one constant real matrix W: Green coordinates are linear in the control
//! points. They are conformal, so they cannot widen a panel without lengthening it; by default each
//! panel gets one more complex unknown β that adds `β·conj(z − z_c)`, a uniform stretch and shear.
//! Symmetry is in the unknowns: of a mirror pair only the first panel has any, the
//! second moves as its mirror image, so that no step can break it.

mod control;
pub mod enclose;
pub mod green;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

use crate::geometry::{Vec2, complex, point};
use crate::pattern::symmetry::{Mirror, Reflection, Symmetry};
use crate::pattern::{Pattern, PatternMesh};
use crate::problem::Problem;
use control::{Cage, Fault, sum};
use num_complex::Complex64;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The constant linear map from the unknowns ζ to the rest shape x̄ of a whole pattern.
#[derive(Clone, Debug)]
pub struct Cages {
    x_bar: Vec<Vec2>,
    /// One for each panel or mirror pair.
    each: Vec<Cage>,
    /// Unknowns before each cage, and all of them.
    offsets: Vec<usize>,
    /// `[panel]`.
    wearers: Vec<Wearer>,
    least_stretch: f64,
}

/// A panel inside a cage, or inside the mirror image of one.
#[derive(Clone, Debug)]
struct Wearer {
    cage: usize,
    reflection: Option<Reflection>,
    vertices: Range<usize>,
    /// `[vertex][handle]`, of the vertex as seen from the cage.
    weights: Vec<Vec<Complex64>>,
}

/// A residual of the unknowns alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// \[–\].
    pub value: f64,
    /// Its derivatives, by unknown \[1/m\].
    pub by: Vec<(usize, f64)>,
}

impl Prior {
    fn new(weight: f64, value: f64, first: usize, by: impl Iterator<Item = f64>) -> Self {
        let by = by.enumerate().filter(|(_, d)| *d != 0.0);
        Self {
            value: weight * value,
            by: by.map(|(j, d)| (first + j, weight * d)).collect(),
        }
    }

    /// Writes the derivatives into `row`, which is zero, and returns the residual.
    pub fn fill(&self, row: &mut [f64]) -> f64 {
        for (j, slope) in &self.by {
            row[*j] = *slope;
        }
        self.value
    }
}

/// What a cage can do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CageKind {
    /// Conformal: angles are kept exactly, widths and lengths change together. The paper's.
    Green,
    /// Conformal, and one uniform stretch and shear per panel.
    #[default]
    GreenAffine,
}

/// How cages are drawn and how far they may go.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CageParams {
    /// What a cage can do: `green` or `green-affine`. Paper: `green`.
    pub kind: CageKind,
    /// Control points of a cage \[–\]; intricate panels may take up to three times as many, plain
    /// ones take fewer. More follow the target closer and cost more per iteration. 8 to 24; the
    /// paper gives none.
    pub max_control_points: usize,
    /// Distance from the cage to the panel, as part of the distance between control points \[–\].
    /// Larger deforms smoother but less locally, and bridges wider notches. 0.1 to 0.8.
    pub margin: f64,
    /// Least stretch anywhere on a panel, as part of its mean scale \[–\], below which a step is
    /// rejected. 0 allows all but folding; 0.1 to 0.5.
    pub least_stretch: f64,
}

impl Default for CageParams {
    fn default() -> Self {
        Self {
            kind: CageKind::default(),
            max_control_points: 16,
            margin: 0.3,
            least_stretch: 0.2,
        }
    }
}

/// Why a rest shape cannot be cut from cloth.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Rejection {
    /// Two sides of the cage cross.
    #[error("the cage of panel {panel} crosses itself")]
    CageCrosses {
        /// Index of the panel.
        panel: usize,
    },
    /// The outline crosses itself.
    #[error("the outline of panel {panel} crosses itself")]
    OutlineCrosses {
        /// Index of the panel.
        panel: usize,
    },
    /// Somewhere the panel is squeezed below the allowed stretch, or folded.
    #[error("panel {panel} is squeezed or folded")]
    Squeezed {
        /// Index of the panel.
        panel: usize,
    },
    /// An unknown is not a finite number.
    #[error("unknown {unknown} is not a finite number")]
    NotFinite {
        /// Index of the unknown.
        unknown: usize,
    },
}

impl Cages {
    /// Draws a cage around every panel of `pattern` and binds the mesh's rest vertices to it; mirror
    /// pairs share one. Problems are panels without a cage and parameters out of range.
    pub fn enclose(
        pattern: &Pattern,
        mesh: &PatternMesh,
        symmetry: Option<&Symmetry>,
        params: &CageParams,
    ) -> Result<Self, Vec<Problem>> {
        let mut problems = params.problems();
        if !problems.is_empty() {
            return Err(problems);
        }
        let mut cages = Vec::new();
        let mut wearers = vec![None; pattern.panels.len()];
        for p in 0..pattern.panels.len() {
            let mirror = symmetry.and_then(|s| s.mirrors.iter().find(|m| m.panels.contains(&p)));
            if mirror.is_some_and(|mirror| mirror.panels[0] != p) {
                continue;
            }
            let place = |p: usize| format!("panel `{}`", pattern.panels[p].name);
            let Some(cage) = draw(pattern, p, mirror, params) else {
                let text = "no cage can be drawn around it: its outline encloses no area; check its corners";
                problems.push(Problem::at(place(p), text));
                continue;
            };
            let partner = mirror.filter(|mirror| !mirror.is_of_one_panel());
            let partner = partner.map(|mirror| (mirror.panels[1], Some(mirror.reflection)));
            for (q, reflection) in [(p, None)].into_iter().chain(partner) {
                let vertices = mesh.panel_vertices[q].clone();
                let wearer = Wearer::bind(mesh, vertices, (cages.len(), &cage), reflection);
                if wearer.is_none() {
                    let text = "its mesh reaches beyond its outline; mesh the pattern again";
                    problems.push(Problem::at(place(q), text));
                }
                wearers[q] = wearer;
            }
            cages.push(cage);
        }
        if !problems.is_empty() {
            return Err(problems);
        }
        let mut offsets = vec![0];
        offsets.extend(cages.iter().scan(0, |count, cage| {
            *count += cage.unknowns.len();
            Some(*count)
        }));
        Ok(Self {
            x_bar: mesh.x_bar.clone(),
            each: cages,
            offsets,
            wearers: wearers.into_iter().flatten().collect(),
            least_stretch: params.least_stretch,
        })
    }

    /// Number of real unknowns.
    pub fn unknown_count(&self) -> usize {
        self.offsets[self.each.len()]
    }

    /// ζ₀, the unknowns of the input pattern \[m\]: coordinates of control points, and β times the
    /// panel's size. All are lengths by which some of the cloth moves, so they are scaled alike.
    pub fn rest_unknowns(&self) -> Vec<f64> {
        self.unknowns(Cage::rest_handles)
    }

    /// The unknowns that scale every panel about its centroid by `scale` \[–\].
    pub fn scaled(&self, scale: f64) -> Vec<f64> {
        self.unknowns(|cage| {
            let mut handles = cage.rest_handles();
            for z in &mut handles[..cage.control.len()] {
                *z = cage.centre + scale * (*z - cage.centre);
            }
            handles
        })
    }

    /// x̄ = x̄₀ + W (ζ − ζ₀) \[m\], `[pattern vertex]`.
    pub fn deform(&self, zeta: &[f64]) -> Vec<Vec2> {
        let handles = self.handles(zeta);
        let mut x_bar = self.x_bar.clone();
        for wearer in &self.wearers {
            for (v, weights) in wearer.vertices.clone().zip(&wearer.weights) {
                x_bar[v] += point(wearer.turn(sum(weights, &handles[wearer.cage])));
            }
        }
        x_bar
    }

    /// ζ̂ = Wᵀ x̄̂: the gradient by the unknowns, given the gradient by the rest shape.
    pub fn pull_back(&self, x_bar_hat: &[Vec2]) -> Vec<f64> {
        let none = |cage: &Cage| vec![Complex64::ZERO; cage.handle_count()];
        let mut hats: Vec<_> = self.each.iter().map(none).collect();
        for wearer in &self.wearers {
            for (v, weights) in wearer.vertices.clone().zip(&wearer.weights) {
                let hat = wearer.turn(complex(x_bar_hat[v]));
                for (sum, weight) in hats[wearer.cage].iter_mut().zip(weights) {
                    *sum += weight.conj() * hat;
                }
            }
        }
        let pulled = self.each.iter().zip(&hats);
        pulled.flat_map(|(cage, hat)| cage.pull_back(hat)).collect()
    }

    /// Column `j` of W: ∂x̄/∂ζ_j \[–\] by pattern vertex, of the panels that unknown moves.
    pub fn column(&self, j: usize) -> Vec<(u32, Vec2)> {
        let c = self.offsets.partition_point(|first| *first <= j) - 1;
        let moved = &self.each[c].unknowns[j - self.offsets[c]];
        let by = |weights: &Vec<Complex64>| moved.iter().map(|(h, d)| weights[*h] * d).sum();
        let wearers = self.wearers.iter().filter(|wearer| wearer.cage == c);
        wearers
            .flat_map(|wearer| {
                let vertices = wearer.vertices.clone().zip(&wearer.weights);
                vertices.map(move |(v, weights)| (v as u32, point(wearer.turn(by(weights)))))
            })
            .collect()
    }

    /// What a cage had better not do, as residuals of the unknowns with their derivatives: stretch
    /// unevenly in two directions (|β| of each panel, to weigh `affine`), and change neighbouring
    /// sides by different similarities (to weigh `unevenness`), which keeps control points that
    /// hardly move the cloth from wandering until the cage crosses itself.
    pub fn priors(&self, zeta: &[f64], affine: f64, unevenness: f64) -> Vec<Prior> {
        let (affine, unevenness) = (affine.sqrt(), unevenness.sqrt());
        let mut priors = Vec::new();
        for ((cage, first), handles) in self.each.iter().zip(&self.offsets).zip(self.handles(zeta))
        {
            let mut add = |stencil: &[(usize, Complex64)], weight: f64| {
                let value: Complex64 = stencil.iter().map(|(h, a)| a * handles[*h]).sum();
                let by = cage.along_unknowns(stencil);
                priors.push(Prior::new(
                    weight,
                    value.re,
                    *first,
                    by.iter().map(|d| d.re),
                ));
                priors.push(Prior::new(
                    weight,
                    value.im,
                    *first,
                    by.iter().map(|d| d.im),
                ));
            };
            if cage.affine {
                let one = Complex64::new(1.0 / cage.size, 0.0);
                add(&[(cage.control.len(), one)], affine);
            }
            for stencil in cage.side_differences() {
                add(&stencil, unevenness);
            }
        }
        priors
    }

    /// Directions in ζ, orthonormal, that move panels as rigid bodies and so do nothing to the drape:
    /// two translations and, at `zeta`, one rotation of each panel or mirror pair; one translation
    /// along the axis of a panel that mirrors itself. The rotation turns the panel against its grain.
    pub fn rigid_modes(&self, zeta: &[f64]) -> Vec<Vec<f64>> {
        let handles = self.handles(zeta);
        let mut modes = Vec::new();
        for (c, cage) in self.each.iter().enumerate() {
            for motion in cage.rigid_motions(&handles[c]) {
                let own: Vec<f64> = cage.unknowns_of(&motion).collect();
                let length = own.iter().map(|x| x * x).sum::<f64>().sqrt();
                let mut mode = vec![0.0; self.unknown_count()];
                for (x, y) in mode[self.offsets[c]..].iter_mut().zip(own) {
                    *x = y / length;
                }
                modes.push(mode);
            }
        }
        modes
    }

    /// Whether the rest shape at `zeta` can be cut: nothing squeezed beyond the parameters' limit or
    /// folded, no outline and no cage that crosses itself. Looks at outlines only.
    pub fn check(&self, zeta: &[f64]) -> Result<(), Rejection> {
        if let Some(unknown) = zeta.iter().position(|x| !x.is_finite()) {
            return Err(Rejection::NotFinite { unknown });
        }
        let handles = self.handles(zeta);
        for (panel, wearer) in self.wearers.iter().enumerate() {
            let cage = &self.each[wearer.cage];
            let fault = cage.fault(&handles[wearer.cage], self.least_stretch);
            match fault {
                Some(Fault::CageCrosses) => return Err(Rejection::CageCrosses { panel }),
                Some(Fault::OutlineCrosses) => return Err(Rejection::OutlineCrosses { panel }),
                Some(Fault::Squeezed) => return Err(Rejection::Squeezed { panel }),
                None => {}
            }
        }
        Ok(())
    }

    /// The cage of each panel at `zeta`, for drawing \[m\], `[panel][control point]`.
    pub fn control_points(&self, zeta: &[f64]) -> Vec<Vec<Vec2>> {
        let handles = self.handles(zeta);
        let polygon = |wearer: &Wearer| {
            let own = self.each[wearer.cage].polygon(&handles[wearer.cage]);
            match wearer.reflection {
                Some(reflection) => own.iter().map(|p| reflection.apply(*p)).collect(),
                None => own,
            }
        };
        self.wearers.iter().map(polygon).collect()
    }

    /// How far the handles of each cage are from rest.
    fn handles(&self, zeta: &[f64]) -> Vec<Vec<Complex64>> {
        let rest = self.rest_unknowns();
        let change: Vec<_> = zeta
            .iter()
            .zip(rest)
            .map(|(now, then)| now - then)
            .collect();
        let of =
            |(c, cage): (usize, &Cage)| cage.handles(&change[self.offsets[c]..self.offsets[c + 1]]);
        self.each.iter().enumerate().map(of).collect()
    }

    /// All unknowns, given the handles of each cage.
    fn unknowns(&self, handles: impl Fn(&Cage) -> Vec<Complex64>) -> Vec<f64> {
        let of = |cage: &Cage| cage.unknowns_of(&handles(cage)).collect::<Vec<_>>();
        self.each.iter().flat_map(of).collect()
    }
}

impl Wearer {
    /// Binds the vertices of a panel to a cage, or to its mirror image; `None` if one lies outside.
    fn bind(
        mesh: &PatternMesh,
        vertices: Range<usize>,
        (index, cage): (usize, &Cage),
        reflection: Option<Reflection>,
    ) -> Option<Self> {
        let back = reflection.map(|r| r.inverse());
        let seen = |v: usize| back.map_or(mesh.x_bar[v], |back| back.apply(mesh.x_bar[v]));
        let weights: Vec<_> = vertices
            .clone()
            .map(|v| cage.weights(complex(seen(v))))
            .collect();
        // The coordinates sum to one inside and to zero outside.
        let inside = |row: &Vec<Complex64>| {
            let sum: Complex64 = row[..cage.control.len()].iter().sum();
            (sum - 1.0).norm() < 1e-9
        };
        weights.iter().all(inside).then_some(Self {
            cage: index,
            reflection,
            vertices,
            weights,
        })
    }

    /// From the cage's frame to the panel's, and back: for displacements and gradients.
    fn turn(&self, d: Complex64) -> Complex64 {
        self.reflection.map_or(d, |reflection| reflection.turn(d))
    }
}

impl CageParams {
    fn problems(&self) -> Vec<Problem> {
        let mut problems = Vec::new();
        let mut require = |holds: bool, field: &str, text: &str| {
            if !holds {
                problems.push(Problem::at(format!("cage parameter `{field}`"), text));
            }
        };
        let fewest = enclose::FEWEST_POINTS;
        require(
            (fewest..=100).contains(&self.max_control_points),
            "max_control_points",
            "must be from 8 to 100",
        );
        require(
            self.margin >= 0.02 && self.margin <= 2.0,
            "margin",
            "must be from 0.02 to 2",
        );
        require(
            (0.0..1.0).contains(&self.least_stretch),
            "least_stretch",
            "must be at least 0 and below 1",
        );
        problems
    }
}

/// A cage around panel `p`, and around the mirror image of its partner; symmetric if the panel is.
fn draw(pattern: &Pattern, p: usize, mirror: Option<&Mirror>, params: &CageParams) -> Option<Cage> {
    let outline = outline(pattern, p);
    let encloses = |outlines: &[Vec<Vec2>], mirrored: bool| {
        enclose::enclose(outlines, params.max_control_points, params.margin, mirrored)
    };
    let own = mirror
        .filter(|mirror| mirror.is_of_one_panel())
        .map(|m| m.reflection);
    let control = match (mirror, own) {
        (_, Some(reflection)) => {
            let upright: Vec<_> = outline.iter().map(|p| reflection.upright(*p)).collect();
            let flipped = upright.iter().map(|p| Vec2::new(-p.x, p.y)).collect();
            let cage = encloses(&[upright, flipped], true)?;
            cage.iter().map(|p| reflection.from_upright(*p)).collect()
        }
        (Some(mirror), None) => {
            let back = mirror.reflection.inverse();
            let partner = self::outline(pattern, mirror.panels[1]);
            let partner = partner.iter().map(|p| back.apply(*p)).collect();
            encloses(&[outline.clone(), partner], false)?
        }
        (None, None) => encloses(std::slice::from_ref(&outline), false)?,
    };
    let affine = params.kind == CageKind::GreenAffine;
    Some(Cage::new(&control, &outline, own, affine))
}

/// A panel's outline, fine enough to draw a cage around and to watch the map on.
fn outline(pattern: &Pattern, p: usize) -> Vec<Vec2> {
    let panel = &pattern.panels[p];
    let length: f64 = (0..panel.edges.len()).map(|e| panel.edge_length(e)).sum();
    panel.outline((length / 128.0).max(f64::MIN_POSITIVE))
}
