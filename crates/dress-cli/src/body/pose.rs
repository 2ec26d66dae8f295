//! `dress body pose`.

use super::arguments::PoseArguments;
use super::table::vectors;
use super::{bare, fitted, read};
use crate::failure::Failure;
use crate::picture::{View, preview};
use dress_anyone::body::FileFrame;
use dress_anyone::body_model::{BodyModel, Pose, joint_name};
use dress_anyone::geometry::{Vec3, bounds};
use dress_anyone::io::obj;
use dress_anyone::io::output::{Output, check_writable};
use dress_anyone::problem::{BadInput, Problem};
use std::f64::consts::FRAC_PI_4;
use std::path::Path;

/// Fits, poses and writes; what to say about it in the end.
pub fn run(arguments: &PoseArguments) -> Result<String, Failure> {
    let subject = &arguments.subject;
    crate::set_threads(&subject.running)?;
    let (model, body) = read(subject)?;
    check_writable(&arguments.out)?;
    let mut pose = match arguments.pose.as_str() {
        "a" => model.arms_at(FRAC_PI_4),
        "t" => model.arms_at(0.0),
        file => from_file(&model, Path::new(file))?,
    };
    let fit = fitted(&model, &body, subject)?;
    let (low, high) = bounds(&fit.posed(&model, &pose).positions);
    pose.translation = Vec3::new(-0.5 * (low.x + high.x), -low.y, -0.5 * (low.z + high.z));
    let posed = fit.posed(&model, &pose);
    let title = format!("{}, posed", body.name);
    let figures = [bare("as read", &body.mesh), bare("posed", &posed)];
    let mut output = Output::new(&arguments.out);
    output.add("posed.obj", obj::mesh_text(&title, &posed, FileFrame::SI));
    output.add(
        "posed.png",
        preview(&title, &figures, &[View::Front, View::Side]),
    );
    output.write()?;
    Ok(format!("Written to {}\n", arguments.out.display()))
}

/// The pose in a TOML file; joints it leaves out stay as in the model's zero pose.
fn from_file(model: &BodyModel, path: &Path) -> Result<Pose, BadInput> {
    let mut pose = Pose::zero(model);
    let mut problems = Vec::new();
    for (name, degrees) in vectors(path, "rotations")? {
        let joint = (0..pose.rotations.len()).find(|j| joint_name(*j) == name);
        match (joint, degrees) {
            (Some(joint), Some(angles)) => pose.rotations[joint] = angles * 1_f64.to_radians(),
            (None, _) => {
                let known: Vec<String> = (0..pose.rotations.len()).map(joint_name).collect();
                let text = format!("there is no such joint; there are {}", known.join(", "));
                problems.push(Problem::at(format!("joint `{name}`"), text));
            }
            (_, None) => {
                let text = "must be three numbers, [x, y, z]: an axis times an angle in degrees";
                problems.push(Problem::at(format!("joint `{name}`"), text));
            }
        }
    }
    if problems.is_empty() {
        Ok(pose)
    } else {
        Err(BadInput::new(path, problems))
    }
}
