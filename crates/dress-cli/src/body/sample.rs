//! `dress body sample`.

use super::arguments::SampleArguments;
use super::{bare, model};
use crate::failure::Failure;
use crate::picture::{View, preview};
use crate::refit::json;
use dress_anyone::body::FileFrame;
use dress_anyone::body_model::Shape;
use dress_anyone::body_model::measure::{Measurement, measure};
use dress_anyone::body_model::sample::Random;
use dress_anyone::geometry::TriangleMesh;
use dress_anyone::io::obj;
use dress_anyone::io::output::Output;
use serde::Serialize;

/// Bodies in the picture.
const SHOWN: usize = 8;

/// A body, for the list.
#[derive(Serialize)]
struct Sampled {
    file: String,
    shape: Shape,
    measurements: Vec<Measurement>,
}

/// Draws and writes; what to say about it in the end.
pub fn run(arguments: &SampleArguments) -> Result<String, Failure> {
    let model = model(&arguments.model)?;
    let mut random = Random::new(arguments.seed);
    let mut output = Output::new(&arguments.out);
    let (mut list, mut shown) = (Vec::new(), Vec::new());
    for i in 0..arguments.count {
        let shape = model.sample(&mut random);
        let mesh = TriangleMesh {
            positions: model.a_pose(&shape, &[]).positions,
            triangles: model.parts().template.triangles.clone(),
        };
        let name = format!("body_{i:04}");
        let title = format!("{name}, seed {}", arguments.seed);
        let file = format!("{name}.obj");
        output.add(file.clone(), obj::mesh_text(&title, &mesh, FileFrame::SI));
        let measurements = measure(&model, &shape, &[]);
        list.push(Sampled {
            file,
            shape,
            measurements,
        });
        if shown.len() < SHOWN {
            shown.push((name, mesh));
        }
    }
    let figures: Vec<_> = shown.iter().map(|(name, mesh)| bare(name, mesh)).collect();
    let title = format!("bodies drawn with seed {}", arguments.seed);
    output.add(
        "bodies.png",
        preview(&title, &figures, &[View::Front, View::Side]),
    );
    output.add("bodies.json", json(&list)?);
    output.write()?;
    let (count, out) = (arguments.count, arguments.out.display());
    Ok(format!("{count} bodies written to {out}\n"))
}
