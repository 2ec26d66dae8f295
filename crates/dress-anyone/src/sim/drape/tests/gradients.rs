//! Gradients by fabric and by body against two complete drapes.

use super::*;
use crate::body::DistanceField;
use crate::garment::{Cut, Fabric};
use crate::geometry::TriangleMesh;
use crate::sim::Differentiable;
use crate::sim::material::Material;

/// A fixed linear function of positions.
fn weights(count: usize) -> Vec<Vec3> {
    (0..count)
        .map(|i| Vec3::from_fn(|c, _| noise(11 * i + c)))
        .collect()
}

fn value(drape: &Drape) -> f64 {
    let weighted = drape.x.iter().zip(weights(drape.x.len()));
    weighted.map(|(x, w)| x.dot(&w)).sum()
}

/// The drape on from where `at` is, with all that it remembers, in another scene.
fn on<'a, S: Surface>(at: &Differentiable<'_>, scene: &Scene<'a, S>) -> Differentiable<'a> {
    let drape = Drape {
        rest: scene.cloth.at_rest(&at.drape.x_bar),
        ..at.drape.clone()
    };
    drape.differentiable(scene).expect("a minimum")
}

/// One of a fabric's numbers.
type Number = fn(&mut Fabric) -> &mut f64;

/// The fabrics that [`fixtures::patched`] is made of.
fn fabrics() -> [Cut; 2] {
    let patch = Fabric {
        warp: 120.0,
        bending: 3e-4,
        density: 0.3,
        friction: 0.08,
        ..SOFT
    };
    let straight = Cut {
        fabric: SOFT,
        grain: 0.0,
    };
    let bias = Cut {
        fabric: patch,
        grain: 35.0,
    };
    [straight, bias]
}

/// Compares the gradient by every number of both fabrics of `cloth`, which lies on the cone at `x`, with
/// differences of drapes.
fn check_by_fabrics(cloth: &Cloth, params: &SimParams, x_bar: &[Vec2], x: Vec<Vec3>) {
    assert_eq!(cloth.materials, fabrics().map(|cut| Material::from(&cut)));
    let assembly = Assembly::new(cloth);
    let here = scene(cloth, &assembly, &TIGHT, params);
    let at = settle(&here, x_bar, x)
        .differentiable(&here)
        .expect("a minimum");
    assert_eq!(at.shift, 0.0);
    let (_, lambda) = at.pull_back(&weights(cloth.vertex_count));
    let hats = at.by_fabrics(&here, &lambda);
    let numbers: [(&str, Number); 7] = [
        ("warp", |f| &mut f.warp),
        ("weft", |f| &mut f.weft),
        ("poisson", |f| &mut f.poisson),
        ("shear", |f| &mut f.shear),
        ("bending", |f| &mut f.bending),
        ("density", |f| &mut f.density),
        ("friction", |f| &mut f.friction),
    ];
    for (m, mut hat) in hats.into_iter().enumerate() {
        for (name, number) in numbers {
            let mut fabric = fabrics()[m].fabric;
            let size = *number(&mut fabric);
            let along = |s: f64| {
                let mut cuts = fabrics();
                *number(&mut cuts[m].fabric) *= 1.0 + s;
                let mut cloth = cloth.clone();
                cloth.materials[m] = Material::from(&cuts[m]);
                fixtures::rub(&mut cloth);
                value(&on(&at, &scene(&cloth, &assembly, &TIGHT, params)).drape)
            };
            let slope = *number(&mut hat) * size;
            let counts = name != "friction" || params.contact.rubs();
            assert_eq!(slope != 0.0, counts, "{m} {name}");
            // Short enough for contacts and slips to stay as they are. Drapes know their value, of order one,
            // to some 1e-11, and differences their slope to 1e-7.
            assert_derivative(along, slope, 1e-4, 1e-2, 1e-5);
        }
    }
}

/// A tube at rest on the cone without friction.
fn at_rest(cloth: &Cloth, mesh: &crate::pattern::PatternMesh) -> Vec<Vec3> {
    let assembly = Assembly::new(cloth);
    let params = firm_contact();
    let scene = scene(cloth, &assembly, &TIGHT, &params);
    settle(&scene, &mesh.x_bar, fixtures::rolled(mesh, 0.6, 0.11)).x
}

#[test]
fn the_gradient_by_every_number_of_two_fabrics_agrees_with_two_drapes() {
    let mut mesh = fixtures::tube(24, 6, 0.025);
    skew(&mut mesh);
    // Without friction, its seam pressed.
    let cloth = fixtures::creased(&mesh);
    let x = at_rest(&cloth, &mesh);
    check_by_fabrics(&cloth, &firm_contact(), &mesh.x_bar, x);
    // With friction, let down a little: part of it sticks, part slips.
    let cloth = fixtures::patched(&mesh);
    // No point is nearer than 6 µm to where it would begin to touch.
    let off = |i: usize| Vec3::from_fn(|c, _| 3e-4 * noise(3 * i + c));
    let x = at_rest(&cloth, &mesh);
    let x = x.iter().enumerate().map(|(i, p)| p + off(i)).collect();
    let mut params = firm_contact();
    params.contact.friction = OrFabric::Fabric;
    check_by_fabrics(&cloth, &params, &mesh.x_bar, x);
}

/// [`TIGHT`] as a mesh, its top and bottom out of the cloth's way, with dents, so that no node of a field
/// is a vertex or equally far from two faces, where distances would have a kink.
fn tight_mesh() -> TriangleMesh {
    let (around, up) = (40, 16);
    let mut mesh = TriangleMesh::default();
    for j in 0..=up {
        let y = -0.15 + 0.4 * f64::from(j) / f64::from(up);
        let radius = 0.13 - 0.3 * y;
        for i in 0..around {
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(around);
            let x = radius * angle.sin() + 0.15 * y;
            let dent = Vec3::from_fn(|c, _| 2e-4 * noise(3 * mesh.positions.len() + c));
            let p = Vec3::new(x, y, 0.85 * radius * angle.cos());
            mesh.positions.push(p + dent);
        }
    }
    for j in 0..up as u32 {
        for i in 0..around as u32 {
            let at = |i: u32, j: u32| j * around as u32 + i % around as u32;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

#[test]
fn the_gradient_by_the_vertices_of_the_body_agrees_with_two_drapes() {
    let mut mesh = fixtures::tube(24, 6, 0.025);
    skew(&mut mesh);
    let cloth = Cloth::new(&mesh, &SOFT);
    let assembly = Assembly::new(&cloth);
    let body = tight_mesh();
    let field = |body: &TriangleMesh| DistanceField::new(body, 5e-3, 0.03);
    let surface = field(&body);
    let start = fixtures::rolled(&mesh, 0.6, 0.14);
    for friction in [0.0, 0.1] {
        let mut params = firm_contact();
        let x = settle(
            &scene(&cloth, &assembly, &surface, &params),
            &mesh.x_bar,
            start.clone(),
        )
        .x;
        params.contact.friction = OrFabric::Number(friction);
        let here = scene(&cloth, &assembly, &surface, &params);
        let off = |i: usize| Vec3::from_fn(|c, _| friction * 3e-3 * noise(5 * i + c));
        let x: Vec<Vec3> = x.iter().enumerate().map(|(i, p)| p + off(i)).collect();
        let at = settle(&here, &mesh.x_bar, x)
            .differentiable(&here)
            .expect("a minimum");
        assert_eq!(at.shift, 0.0);
        let (_, lambda) = at.pull_back(&weights(cloth.vertex_count));
        let hat = at.by_body(&here, &body, &lambda);
        let direction: Vec<Vec3> = (0..body.positions.len())
            .map(|i| Vec3::from_fn(|c, _| noise(700 + 3 * i + c)))
            .collect();
        let along = |s: f64| {
            let moved = body.positions.iter().zip(&direction);
            let moved = TriangleMesh {
                positions: moved.map(|(p, d)| p + d * s).collect(),
                triangles: body.triangles.clone(),
            };
            let surface = field(&moved);
            value(&on(&at, &scene(&cloth, &assembly, &surface, &params)).drape)
        };
        let slope: f64 = hat.iter().zip(&direction).map(|(h, d)| h.dot(d)).sum();
        assert_derivative(along, slope, 1e-7, 1e-3, 1e-5);
    }
}
