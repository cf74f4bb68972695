//! The post room: documents and meshes in, fabrication files out.
