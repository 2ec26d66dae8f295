//! Files. The only place that knows their units, axes and index bases; inside, all is SI and y up.

pub mod body;
pub mod body_model;
pub mod file;
pub mod garment;
pub mod garment_obj;
pub mod garmentcode;
pub mod json;
pub mod kind;
pub mod npz;
pub mod obj;
pub mod output;
pub mod paint;
mod ply;
mod source;
mod stl;
pub mod svg;
