//! The post room: documents and meshes in, fabrication files out.

pub mod diagnostic;
pub mod document;
pub mod format;
pub mod library;
