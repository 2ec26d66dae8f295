//! Garment, bodies and parameters of a refit, read and made to correspond.

use crate::arguments::fitting::PairArguments;
use crate::correspond::{How, correspond};
use crate::failure::Failure;
use crate::inputs::{AVERAGE, Gathering, HEAVY, Input, TSHIRT, note_placement};
use crate::params::Params;
use crate::progress::Progress;
use dress_anyone::body::Body;
use dress_anyone::geometry::TriangleMesh;
use dress_anyone::io::garment::Loaded;
use dress_anyone::io::output::check_writable;
use dress_anyone::problem::BadInput;
use dress_anyone::refit::RefitError;
use std::path::Path;

/// Everything read.
pub struct Inputs<'a> {
    /// Garment, source body, target body.
    pub names: [Input<'a>; 3],
    /// The parameters.
    pub params: Params,
    /// The garment.
    pub loaded: Loaded,
    /// The body it fits.
    pub source: Body,
    /// The body it shall fit, in the source's pose.
    pub target: Body,
    /// The target in its own pose.
    pub target_own: TriangleMesh,
    /// How the bodies came to correspond.
    pub how: How,
}

impl<'a> Inputs<'a> {
    /// Reads all inputs, and looks whether results can be written to `out`, before complaining of any.
    pub fn read(
        arguments: &'a PairArguments,
        params: Result<Params, BadInput>,
        out: Option<&Path>,
        progress: &mut Progress,
    ) -> Result<Self, Failure> {
        let names = [
            Input::or(arguments.garment.as_ref(), TSHIRT),
            Input::or(arguments.source_body.as_ref(), AVERAGE),
            Input::or(arguments.target_body.as_ref(), HEAVY),
        ];
        let mut gathering = Gathering::default();
        let params = gathering.take(params);
        let options = arguments
            .reading
            .garment(params.as_ref().unwrap_or(&Params::default()));
        let loaded = gathering.take(names[0].garment(&options));
        let [source, target] =
            [names[1], names[2]].map(|name| gathering.take(name.body(&arguments.reading.body())));
        if let Some(out) = out {
            gathering.take(check_writable(out));
        }
        gathering.finish()?;
        let all = params.zip(loaded).zip(source.zip(target));
        let ((params, mut loaded), (source, target)) =
            all.expect("nothing was wrong with any of them");
        note_placement(&mut loaded, &source);
        progress.notes(&loaded.garment.name, &loaded.notes);
        progress.notes(&source.name, &source.notes);
        progress.notes(&target.name, &target.notes);
        let files = [names[1], names[2]].map(|name| name.name());
        let files = [Path::new(&files[0]), Path::new(&files[1])];
        let alike = correspond(&arguments.correspond, files, source, target, progress)?;
        Ok(Self {
            names,
            params,
            loaded,
            source: alike.source,
            target: alike.target,
            target_own: alike.target_own,
            how: alike.how,
        })
    }

    /// The failure that an error of the library is, told of the garment's file if it is about that.
    pub fn failure(&self, error: RefitError) -> Failure {
        match error {
            RefitError::Garment(problems) => {
                BadInput::new(Path::new(&self.names[0].name()), problems).into()
            }
            other => other.into(),
        }
    }
}
