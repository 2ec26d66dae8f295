//! Files. The only place that knows their units, axes and index bases; inside, all is SI and y up.

pub mod file;
pub mod garmentcode;
pub mod json;
pub mod output;
pub mod svg;
pub mod body;
pub mod garment_obj;
pub mod obj;
mod ply;
mod source;
mod stl;
