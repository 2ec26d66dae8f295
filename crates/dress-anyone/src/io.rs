//! Files. The only place that knows their units, axes and index bases; inside, all is SI and y up.

pub mod file;
pub mod garmentcode;
pub mod json;
pub mod kind;
pub mod output;
