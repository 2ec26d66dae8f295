use super::*;
use crate::check::{assert_derivative, noise};
use crate::garment::Fabric;
use crate::sim::cloth::Hold;
use crate::sim::cloth::fixtures::{self, SOFT};
use crate::sim::energy::contact::fixtures::{Cone, Floor};
use approx::assert_relative_eq;

/// A tube of circumference 0.6 m meets 0.6 m and more on it: held by the slope alone.
const TIGHT: Cone = Cone {
    radius: 0.1,
    slope: 0.3,
    flat: 1.1,
    lean: 0.2,
};

fn scene<'a, S>(
    cloth: &'a Cloth,
    assembly: &'a Assembly,
    surface: &'a S,
    params: &'a SimParams,
) -> Scene<'a, S> {
    Scene {
        cloth,
        assembly,
        surface,
        params,
    }
}

fn settle<S: Surface>(scene: &Scene<'_, S>, x_bar: &[Vec2], x: Vec<Vec3>) -> Drape {
    let drape = drape(scene, x_bar, x, Start::Near, &mut |_, _| true);
    assert_eq!(
        drape.status,
        RestStatus::AtRest,
        "residual {}",
        drape.residual
    );
    drape
}

/// Directional derivative of a fixed linear function of the drape by the rest shape, against
/// two complete drapes.
fn check_gradient<S: Surface>(scene: &Scene<'_, S>, x_bar: &[Vec2], x: Vec<Vec3>, tolerance: f64) {
    let weights: Vec<Vec3> = (0..x.len())
        .map(|i| Vec3::from_fn(|c, _| noise(11 * i + c)))
        .collect();
    let direction: Vec<Vec2> = x_bar
        .iter()
        .enumerate()
        .map(|(i, _)| Vec2::new(noise(7 * i), noise(7 * i + 3)))
        .collect();
    let at = settle(scene, x_bar, x)
        .differentiable(scene)
        .expect("a minimum");
    assert_eq!(at.shift, 0.0);
    let (hat, _) = at.pull_back(&weights);
    let slope: f64 = hat.iter().zip(&direction).map(|(h, d)| h.dot(d)).sum();
    let value = |s: f64| {
        let moved: Vec<Vec2> = x_bar
            .iter()
            .zip(&direction)
            .map(|(p, d)| p + d * s)
            .collect();
        // On from there with all else that a drape remembers: friction's anchors.
        let on = Drape {
            rest: scene.cloth.at_rest(&moved),
            x_bar: moved,
            ..at.drape.clone()
        };
        let there = on.differentiable(scene).expect("a minimum");
        there
            .drape
            .x
            .iter()
            .zip(&weights)
            .map(|(x, w)| x.dot(w))
            .sum::<f64>()
    };
    assert_derivative(value, slope, 1e-7, 1e-6, tolerance);
    let forward = at.sensitivities(std::iter::once(direction));
    let pushed: f64 = forward
        .chunks_exact(3)
        .zip(&weights)
        .map(|(d, w)| d[0] * w.x + d[1] * w.y + d[2] * w.z)
        .sum();
    assert_relative_eq!(pushed, slope, max_relative = 1e-8);
}

/// Makes one side of a tube longer, so that it knows which way round it wants to hang.
fn skew(mesh: &mut crate::pattern::PatternMesh) {
    let width = mesh.x_bar.iter().map(|p| p.x).fold(0.0, f64::max);
    for p in &mut mesh.x_bar {
        p.y *= 1.0 + 0.2 * (std::f64::consts::TAU * p.x / width).sin();
    }
}

fn firm_contact() -> SimParams {
    let layers = LayerParams {
        on: false,
        ..LayerParams::default()
    };
    let contact = ContactParams {
        thickness: 0.003,
        stiffness: 1e5,
        friction: OrFabric::Number(0.0),
    };
    SimParams {
        contact,
        layers,
        ..SimParams::default()
    }
}

#[test]
fn the_gradient_of_a_skirt_agrees_with_two_drapes() {
    // Held at the waist, wide enough to fold below it, on a flattened cone.
    let mut mesh = fixtures::tube(24, 10, 0.04);
    skew(&mut mesh);
    let mut cloth = Cloth::new(&mesh, &SOFT);
    cloth.holds = (240..264)
        .map(|vertex| Hold {
            vertex,
            height: 0.0,
            stiffness: 30.0,
        })
        .collect();
    let assembly = Assembly::new(&cloth);
    let cone = Cone {
        radius: 0.14,
        slope: 0.2,
        flat: 1.2,
        lean: 0.1,
    };
    let params = firm_contact();
    let scene = scene(&cloth, &assembly, &cone, &params);
    let mut x = fixtures::rolled(&mesh, 0.96, 0.16);
    for (i, p) in x.iter_mut().enumerate() {
        *p += Vec3::from_fn(|c, _| 1e-3 * noise(3 * i + c)) - Vec3::y() * 0.4;
    }
    // The differences' own error, which falls with the square of their step.
    check_gradient(&scene, &mesh.x_bar, x, 1e-5);
}

#[test]
fn the_gradient_of_a_tight_tube_agrees_with_two_drapes() {
    let mut mesh = fixtures::tube(24, 6, 0.025);
    skew(&mut mesh);
    let cloth = Cloth::new(&mesh, &SOFT);
    let assembly = Assembly::new(&cloth);
    let params = firm_contact();
    let scene = scene(&cloth, &assembly, &TIGHT, &params);
    let x = fixtures::rolled(&mesh, 0.6, 0.11);
    check_gradient(&scene, &mesh.x_bar, x, 1e-7);
}

#[test]
fn the_gradient_of_a_tube_of_two_fabrics_agrees_with_two_drapes() {
    let mut mesh = fixtures::tube(24, 6, 0.025);
    skew(&mut mesh);
    let cloth = fixtures::patched(&mesh);
    let assembly = Assembly::new(&cloth);
    let params = firm_contact();
    let scene = scene(&cloth, &assembly, &TIGHT, &params);
    let x = fixtures::rolled(&mesh, 0.6, 0.11);
    check_gradient(&scene, &mesh.x_bar, x, 1e-7);
}

#[test]
fn the_gradient_of_a_tube_with_a_pressed_seam_agrees_with_two_drapes() {
    let mut mesh = fixtures::tube(24, 6, 0.025);
    skew(&mut mesh);
    let cloth = fixtures::creased(&mesh);
    let assembly = Assembly::new(&cloth);
    let params = firm_contact();
    let scene = scene(&cloth, &assembly, &TIGHT, &params);
    let x = fixtures::rolled(&mesh, 0.6, 0.11);
    check_gradient(&scene, &mesh.x_bar, x, 1e-7);
}

#[test]
fn a_tube_that_began_short_grows_to_where_one_hangs_that_did_not() {
    let mesh = fixtures::tube(40, 10, 0.015);
    let cloth = Cloth::new(&mesh, &SOFT);
    let assembly = Assembly::new(&cloth);
    let params = firm_contact();
    let scene = scene(&cloth, &assembly, &TIGHT, &params);
    let x = fixtures::rolled(&mesh, 0.6, 0.11);
    let near = settle(&scene, &mesh.x_bar, x.clone());
    let short = mesh.x_bar.iter().map(|p| Vec2::new(p.x, 0.7 * p.y));
    let start = Start::Placed {
        short: short.collect(),
    };
    let low = x.iter().map(|p| Vec3::new(p.x, 0.7 * p.y, p.z)).collect();
    let grown = drape(&scene, &mesh.x_bar, low, start, &mut |_, _| true);
    assert_eq!(grown.status, RestStatus::AtRest);
    let height = |x: &[Vec3]| {
        let (low, high) = (x.iter()).fold((0.0_f64, f64::NEG_INFINITY), |(l, h), p| {
            (l.min(p.y), h.max(p.y))
        });
        high - low
    };
    // The tube has turned a little on the way; its height is that of the same state of rest.
    assert_relative_eq!(height(&grown.x), height(&near.x), max_relative = 1e-3);
}

/// Two tubes as one cloth, the outer one 4 % wider at rest.
fn nested(inner: &crate::pattern::PatternMesh) -> crate::pattern::PatternMesh {
    let mut both = inner.clone();
    let (rest_count, count) = (inner.x_bar.len(), inner.cloth_vertex_count);
    let outer = inner.x_bar.iter().map(|p| Vec2::new(1.04 * p.x, p.y));
    both.x_bar.extend(outer);
    let triangles = inner.triangles.iter();
    both.triangles
        .extend(triangles.map(|t| t.map(|v| v + rest_count as u32)));
    both.sewing
        .extend(inner.sewing.iter().map(|v| v + count as u32));
    both.cloth_vertex_count = 2 * count;
    both
}

#[test]
fn the_gradient_of_one_tube_over_another_agrees_with_two_drapes() {
    let mut inner = fixtures::tube(24, 6, 0.025);
    skew(&mut inner);
    let mesh = nested(&inner);
    let cloth = Cloth::new(&mesh, &SOFT);
    let assembly = Assembly::new(&cloth);
    let params = SimParams {
        layers: LayerParams {
            on: true,
            thickness: OrFabric::Number(5e-3),
            stiffness: 1e5,
        },
        ..firm_contact()
    };
    let scene = scene(&cloth, &assembly, &TIGHT, &params);
    let mut x = fixtures::rolled(&inner, 0.6, 0.11);
    // The outer one turned by a fraction of a column, so that vertices do not lie on vertices.
    let (sine, cosine) = 0.07_f64.sin_cos();
    let outer: Vec<Vec3> = (x.iter())
        .map(|p| Vec3::new(cosine * p.x + sine * p.z, p.y, cosine * p.z - sine * p.x))
        .map(|p| Vec3::new(1.12 * p.x, p.y, 1.12 * p.z))
        .collect();
    x.extend(outer);
    let first = settle(&scene, &mesh.x_bar, x);
    let mut layers = Layers::new(&cloth, params.layers, &first.x);
    assert!(!layers.tangled());
    let still = vec![Vec3::zeros(); first.x.len()];
    // All but the rims of the 168 vertices of the outer tube lie on the inner one.
    let touching = layers.pairs(&first.x, &still, 0.0).len();
    assert!(touching > 100, "{touching} pairs touch");
    check_gradient(&scene, &mesh.x_bar, first.x, 1e-5);
}

#[test]
fn the_gradient_of_a_tube_with_friction_agrees_with_two_drapes() {
    let mut mesh = fixtures::tube(24, 6, 0.025);
    skew(&mut mesh);
    let cloth = fixtures::patched(&mesh);
    let assembly = Assembly::new(&cloth);
    let mut params = firm_contact();
    params.contact.friction = OrFabric::Fabric;
    let scene = scene(&cloth, &assembly, &TIGHT, &params);
    // From where it lies without friction, let down a little: part of it sticks, part slips.
    let slippery = SimParams {
        contact: ContactParams {
            friction: OrFabric::Number(0.0),
            ..params.contact
        },
        ..params
    };
    let without = Scene {
        params: &slippery,
        ..scene
    };
    let x = settle(&without, &mesh.x_bar, fixtures::rolled(&mesh, 0.6, 0.11)).x;
    // No point is nearer than 6 µm to where it would begin to touch.
    let off = |i: usize| Vec3::from_fn(|c, _| 3e-4 * noise(3 * i + c));
    let x: Vec<Vec3> = x.iter().enumerate().map(|(i, p)| p + off(i)).collect();
    let found = settle(&scene, &mesh.x_bar, x.clone());
    let slipping = (found.grips.iter().zip(&cloth.contacts))
        .filter(|(g, c)| g.slips(params.contact.stiffness * c.area, c.at(&found.x)))
        .count();
    let sticking = (found.grips.iter())
        .filter(|g| **g != Grip::default())
        .count()
        - slipping;
    assert!(
        slipping > 10 && sticking > 10,
        "{slipping} slip, {sticking} stick"
    );
    check_gradient(&scene, &mesh.x_bar, x, 1e-5);
}

mod gradients;
mod theory;

#[test]
fn only_layers_that_go_through_each_other_may_sink_into_the_body() {
    // A sheet on a floor, and another that goes through it upright.
    let one = fixtures::sheet(6, 6, 0.02);
    let mesh = fixtures::twice(&one);
    let contact = ContactParams::default();
    let height = contact.thickness;
    let flat = one.x_bar.iter().map(|p| Vec3::new(p.x, height, p.y));
    let upright = one.x_bar.iter().map(|p| {
        // Its lower rim reaches a millimetre through.
        Vec3::new(0.051, height - 1e-3 + p.y, p.x + 3e-3)
    });
    let x: Vec<Vec3> = flat.chain(upright).collect();
    let cloth = Cloth::new(&mesh, &Fabric::default());
    let rest = cloth.at_rest(&mesh.x_bar);
    let lowest = |sinks: f64| {
        let watch = Watch::new(&cloth, LayerParams::default(), &x);
        assert!(watch.tangled());
        let floor = Floor { height: 0.0 };
        let params = StepParams::default();
        let mut stepper = Stepper::new(&cloth, &rest, &floor, contact, params, watch);
        let v = vec![Vec3::zeros(); x.len()];
        let mut state = State { x: x.clone(), v };
        let mut lowest = [height; 2];
        for _ in 0..9 {
            stepper.let_tangled_sink(sinks);
            stepper.step(&mut state, 0.0);
            for (v, p) in state.x.iter().enumerate() {
                // The corner of the flat sheet is far from where they cross.
                let at = usize::from(v != 0);
                lowest[at] = lowest[at].min(p.y);
            }
        }
        lowest
    };
    let sinks = 5e-3;
    let [corner, deepest] = lowest(sinks);
    // Contact gives way by a thousandth of the thickness under the weight.
    assert!(corner > 0.99 * height, "{corner}");
    let least = height - sinks;
    assert!(
        deepest < 0.5 * height && deepest > least - 1e-4,
        "{deepest}"
    );
    assert!(lowest(0.0)[1] > 0.5 * height);
}
