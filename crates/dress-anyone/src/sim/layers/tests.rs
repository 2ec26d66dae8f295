use super::stepping::{LEAST_GAP, Watch};
use super::*;
use crate::check::noise;
use crate::garment::Fabric;
use crate::sim::cloth::fixtures;
use crate::sim::material::OrFabric;
use std::collections::BTreeSet;

const THICKNESS: f64 = 4e-3;
const PARAMS: LayerParams = LayerParams {
    on: true,
    thickness: OrFabric::Number(THICKNESS),
    stiffness: 1e6,
};

/// Two sheets of one cloth, `gap` \[m\] above each other, crumpled a little.
fn two_sheets(gap: f64) -> (Cloth, Vec<Vec3>) {
    let one = fixtures::sheet(6, 6, 0.02);
    let count = one.x_bar.len();
    let x = (0..2 * count)
        .map(|i| {
            let p = one.x_bar[i % count];
            let up = if i < count { 0.0 } else { gap };
            Vec3::new(p.x, up, p.y) + Vec3::from_fn(|c, _| 1e-3 * noise(3 * i + c))
        })
        .collect();
    (Cloth::new(&fixtures::twice(&one), &Fabric::default()), x)
}

#[test]
fn layers_begin_to_feel_each_other_at_half_of_each_ones_thickness_together() {
    let (mut cloth, x) = two_sheets(0.1);
    // A thin sheet, which counts as 2 mm, and a thick one.
    let (thin, thick) = cloth.thickness.split_at_mut(49);
    thin.fill(3e-4);
    thick.fill(5e-3);
    let own = LayerParams {
        thickness: OrFabric::Fabric,
        ..PARAMS
    };
    let layers = Layers::new(&cloth, own, &x);
    assert_eq!(layers.thickness(), 5e-3);
    let pair = layers.point_triangle(0, 100).expect("no neighbours");
    assert!((pair.h - 3.5e-3).abs() < 1e-15);
    let told = Layers::new(&cloth, PARAMS, &x);
    let pair = told.point_triangle(0, 100).expect("no neighbours");
    assert!((pair.h - THICKNESS).abs() < 1e-15);
}

#[test]
fn a_flat_sheet_does_not_touch_itself() {
    let (cloth, x) = two_sheets(0.1);
    let mut layers = Layers::new(&cloth, PARAMS, &x);
    let still = vec![Vec3::zeros(); x.len()];
    assert!(layers.pairs(&x, &still, 0.0).is_empty());
}

#[test]
fn the_search_finds_what_a_look_at_all_pairs_finds() {
    let (cloth, x) = two_sheets(5e-3);
    let mut layers = Layers::new(&cloth, PARAMS, &x);
    let d: Vec<Vec3> = (0..x.len())
        .map(|i| Vec3::from_fn(|c, _| 2e-3 * noise(7 * i + c)))
        .collect();
    let found = layers.pairs(&x, &d, 0.0);
    let ends: Vec<Vec3> = x.iter().zip(&d).map(|(x, d)| x + d).collect();
    let touches = |pair: &Pair, x: &[Vec3]| {
        pair.closest(pair.vertices.map(|v| x[v as usize])).r.norm() < THICKNESS
    };
    let (vertices, triangles) = (x.len() as u32, layers.triangles.len() as u32);
    let edges = layers.edges.len() as u32;
    let points = (0..vertices).flat_map(|v| (0..triangles).map(move |t| (v, t)));
    let all_points = points.filter_map(|(v, t)| layers.point_triangle(v, t));
    let crossings = (0..edges).flat_map(|e| (e + 1..edges).map(move |f| (e, f)));
    let all_edges = crossings.filter_map(|(e, f)| layers.edge_edge(e, f));
    let mut counted = 0;
    for pair in all_points.chain(all_edges) {
        if touches(&pair, &x) || touches(&pair, &ends) {
            counted += 1;
            assert!(found.contains(&pair), "{pair:?}");
        }
    }
    assert!(counted > 50, "the sheets must touch: {counted}");
}

#[test]
fn pairs_found_with_room_are_those_of_a_search() {
    let (cloth, mut x) = two_sheets(6e-3);
    let mut layers = Layers::new(&cloth, PARAMS, &x);
    let (mut served, mut counted) = (0, 0);
    for step in 0..12 {
        // The sheets close in on each other while all moves aside, now by more and now by less.
        let size = if step % 5 == 4 { 2e-3 } else { 1e-4 };
        let d: Vec<Vec3> = (0..x.len())
            .map(|i| Vec3::from_fn(|c, _| size * noise(7 * i + c + 31 * step)) + Vec3::x() * 0.01)
            .collect();
        let own = without_mean(&d);
        served += usize::from(layers.near.serves(&x, &own, 0.0));
        let key = |p: &Pair| (p.vertices, p.kind == Kind::PointTriangle);
        let found = layers.pairs(&x, &d, 0.0);
        let come_close = |p: &Pair| comes_within(p, &x, &own, THICKNESS);
        assert!(found.iter().all(come_close));
        let found: BTreeSet<_> = found.iter().map(key).collect();
        let searched = layers.search(&x, &own, THICKNESS);
        // The search also looks at boxes, so it may be content with fewer.
        let missed = searched.iter().filter(|p| !found.contains(&key(p)));
        assert_eq!(missed.count(), 0);
        counted += found.len();
        for (x, d) in x.iter_mut().zip(&d) {
            *x += d;
        }
    }
    assert!(served > 5 && counted > 100, "{served} {counted}");
}

#[test]
fn no_move_takes_one_layer_through_another() {
    let (cloth, start) = two_sheets(5e-3);
    for seed in 0..20 {
        let mut x = start.clone();
        let mut layers = Layers::new(&cloth, PARAMS, &x);
        let count = x.len() / 2;
        for step in 0..10 {
            // The upper sheet falls by more than the gap; all is shaken and drifts, aside and upwards.
            let mut d: Vec<Vec3> = (0..x.len())
                .map(|i| {
                    let shake = Vec3::from_fn(|c, _| 3e-3 * noise(seed * 91 + 7 * i + c + step));
                    let fall = if i < count { 0.0 } else { -4e-3 };
                    shake + Vec3::new(0.02, fall + 0.03, 0.0)
                })
                .collect();
            let pairs = layers.pairs(&x, &d, 0.0);
            let gap = |pair: &Pair, x: &[Vec3]| {
                let corners = pair.vertices.map(|v| x[v as usize]);
                pair.closest(corners).r.norm()
            };
            let gaps: Vec<f64> = pairs.iter().map(|pair| gap(pair, &x)).collect();
            let stopped = hold_apart(&pairs, &x, &mut d, LEAST_GAP);
            assert!(stopped, "the fall must be stopped");
            for (x, d) in x.iter_mut().zip(&d) {
                *x += d;
            }
            let through = intersections::within(&x, &cloth.triangles);
            assert!(through.is_empty(), "seed {seed}, step {step}: {through:?}");
            // However often they are pressed on; round-off of positions of a metre is 1e-16 m.
            for (pair, before) in pairs.iter().zip(gaps) {
                let least = before.min(LEAST_GAP * THICKNESS) - 1e-12;
                assert!(gap(pair, &x) > least, "seed {seed}, step {step}: {pair:?}");
            }
        }
    }
}

#[test]
fn layers_that_fall_together_are_not_held_back() {
    let (cloth, x) = two_sheets(5e-3);
    let mut layers = Layers::new(&cloth, PARAMS, &x);
    let fall = Vec3::new(0.01, -0.05, 0.0);
    let mut d = vec![fall; x.len()];
    assert!(!layers.hold_apart(&x, &mut d).is_empty());
    assert!(d.iter().all(|d| *d == fall));
}

#[test]
fn what_closes_from_rest_is_not_held_back_where_nothing_is_near() {
    let (cloth, x) = two_sheets(0.1);
    let mut watch = Watch::new(&cloth, PARAMS, &x);
    // All fall alike, as far as speeds tell; seams pull the sheets towards each other.
    let fall = vec![Vec3::new(0.0, -7e-4, 0.0); x.len()];
    watch.constraints(&x, &fall, 1.0);
    let up = |i: usize| if i < x.len() / 2 { 3e-3 } else { -3e-3 };
    let closer: Vec<Vec3> = (x.iter().zip(&fall).enumerate())
        .map(|(i, (x, fall))| x + fall + Vec3::y() * up(i))
        .collect();
    let mut end = closer.clone();
    watch.restrain(&x, &mut end);
    for (wanted, end) in closer.iter().zip(&end) {
        // Round-off of the mean.
        assert!((wanted - end).norm() < 1e-12);
    }
}

#[test]
fn what_goes_through_itself_is_exempt_and_the_rest_is_not() {
    let (cloth, mut x) = two_sheets(3e-3);
    let count = x.len() / 2;
    // One corner vertex of the upper sheet pulled down through the lower one.
    x[count].y -= 0.02;
    let mut layers = Layers::new(&cloth, PARAMS, &x);
    assert!(layers.tangled());
    let still = vec![Vec3::zeros(); x.len()];
    let pairs = layers.pairs(&x, &still, 0.0);
    assert!(!pairs.is_empty());
    for pair in pairs {
        assert!(!pair.vertices.contains(&(count as u32)), "{pair:?}");
    }
}

#[test]
fn what_has_come_apart_is_held_apart_at_once() {
    let (cloth, apart) = two_sheets(3e-3);
    let mut through = apart.clone();
    through[apart.len() / 2].y -= 0.02;
    let mut watch = Watch::new(&cloth, PARAMS, &through);
    let still = vec![Vec3::zeros(); apart.len()];
    watch.constraints(&through, &still, 1.0);
    assert!(watch.tangled());
    watch.constraints(&apart, &still, 1.0);
    assert!(!watch.tangled());
}
