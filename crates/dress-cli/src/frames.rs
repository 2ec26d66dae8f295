//! A drape on its way, for pictures or a film: one frame whenever the cloth has come some way.

use crate::progress::doing;
use crate::show::{Shown, film};
use dress_anyone::body::Body;
use dress_anyone::garment::Garment;
use dress_anyone::geometry::Vec3;
use dress_anyone::io::garment_obj;
use dress_anyone::io::output::Output;
use dress_anyone::problem::BadInput;
use dress_anyone::sim::drape::DrapeProgress;
use std::path::Path;

/// Some vertex moves this far between two frames \[m\]: every step of cloth that falls fast, and little
/// enough to see cloth settle.
const APART: f64 = 5e-3;

/// Frames taken so far.
#[derive(Debug, Default)]
pub struct Frames {
    /// What went on, and the positions \[m\].
    taken: Vec<(String, Vec<Vec3>)>,
}

impl Frames {
    /// Takes a frame, if the cloth has moved since the last.
    pub fn see(&mut self, progress: DrapeProgress, x: Vec<Vec3>) {
        if self.taken.last().is_none_or(|(_, last)| moved(last, &x)) {
            self.taken.push((doing(progress), x));
        }
    }

    /// Writes all frames and the end into `folder`: an OBJ each, like that of the drape, and a picture.
    /// What is left there of a longer drape goes.
    pub fn write(
        mut self,
        end: &[Vec3],
        garment: &Garment,
        body: &Body,
        folder: &Path,
    ) -> Result<(), BadInput> {
        self.taken.push(("draped".to_owned(), end.to_vec()));
        let shown = |(caption, x)| Shown {
            caption,
            body: &body.mesh,
            x,
            aim: None,
        };
        let frames = self.taken.iter().map(|(c, x)| shown((c, x)));
        let pictures = film(&garment.mesh, &frames.collect::<Vec<_>>());
        let count = pictures.len();
        for (n, ((_, x), picture)) in self.taken.iter().zip(pictures).enumerate() {
            let mut output = Output::new(folder);
            let [obj, png] = names(n);
            let text = garment_obj::write(garment, &garment.mesh.x_bar, x, body.frame);
            output.add(obj, text);
            output.add(png, picture);
            output.write()?;
        }
        // What is left of a longer film; a file that cannot be removed does no harm but to be a frame
        // too many.
        for n in count.. {
            let removed = names(n).map(|name| std::fs::remove_file(folder.join(name)).is_ok());
            if removed == [false; 2] {
                break;
            }
        }
        Ok(())
    }
}

/// The files of a frame.
fn names(n: usize) -> [String; 2] {
    ["obj", "png"].map(|extension| format!("frame_{n:04}.{extension}"))
}

fn moved(from: &[Vec3], to: &[Vec3]) -> bool {
    from.iter().zip(to).any(|(a, b)| (b - a).norm() >= APART)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_taken_as_far_apart_as_told() {
        let mut frames = Frames::default();
        for step in 0..10 {
            let x = vec![Vec3::zeros(), Vec3::new(0.0, -0.002 * step as f64, 0.0)];
            frames.see(DrapeProgress::Gathering { step, steps: 10 }, x);
        }
        // 2 mm a step: every third.
        let captions: Vec<&str> = frames.taken.iter().map(|(c, _)| c.as_str()).collect();
        assert_eq!(
            captions,
            [0, 3, 6, 9].map(|step| format!("gathering, {step} of 10"))
        );
    }
}
