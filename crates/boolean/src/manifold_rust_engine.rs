//! The default engine: manifold-rust, a port of Manifold to Rust in double precision.
//!
//! Three habits of the library decide the code. Its batch operation is a left fold, whose cost grows with the square
//! of the number of operands; the expression tree joins them smallest first. And it takes a closed mesh that crosses
//! itself without a word and then counts the overlap twice, so operands are searched for crossings. And it works on one thread: operands are checked on the others
//! meanwhile, and what was made of unsound ones is thrown away.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use glam::DVec3;
use lacuna_kernel::budget::CancelToken;
use lacuna_kernel::solid::TriMesh;
use manifold_rust::cancel::CancelToken as EngineToken;
use manifold_rust::csg_tree::CsgNode;
use manifold_rust::impl_mesh::ManifoldImpl;
use manifold_rust::manifold::Manifold;
use manifold_rust::types::{Error as Status, MeshGLP, OpType};

use crate::{BooleanEngine, BooleanError, Operand, Operation, operand};

/// Operands of fewer triangles in all are combined in a few milliseconds: nobody looks at the caller's token meanwhile.
const SMALL: usize = 4000;
/// How often the caller's token is looked at; below what a person notices, above what costs anything.
const POLL: Duration = Duration::from_millis(5);

/// Manifold in Rust: double precision, the same bytes for any number of threads.
#[derive(Clone, Copy, Debug, Default)]
pub struct ManifoldRust;

impl BooleanEngine for ManifoldRust {
    fn name(&self) -> &'static str {
        "manifold-rust 0.19.2"
    }

    fn combine(&self, operation: Operation, operands: &[Operand<'_>], cancel: &CancelToken) -> Result<TriMesh, BooleanError> {
        cancel.check()?;
        if operands.is_empty() {
            return if operation == Operation::Union { Ok(TriMesh::default()) } else { Err(BooleanError::NoOperand) };
        }
        // The library has more than a hundred places that may panic; none of them may take the caller along.
        let checked = || operand::check(operands, cancel, overlaps);
        let evaluated = |token: &EngineToken| {
            let made = catch_unwind(AssertUnwindSafe(|| evaluate(operation, operands, token)));
            made.unwrap_or_else(|panic| Err(BooleanError::Engine(words(panic.as_ref()))))
        };
        let triangles: usize = operands.iter().map(|operand| operand.mesh.triangles.len()).sum();
        let both = |token: &EngineToken| {
            if operands.iter().all(|operand| operand.is_proven) {
                return (Ok(()), evaluated(token));
            }
            // The engine stays on this thread, whose memory is warm.
            let mut sound = Ok(());
            let made = rayon::in_place_scope(|scope| {
                scope.spawn(|_| sound = checked().inspect_err(|_| token.cancel()));
                evaluated(token)
            });
            (sound, made)
        };
        let (sound, made) = if triangles < SMALL { both(&EngineToken::new()) } else { watched(cancel, both) };
        // What was made of unsound operands means nothing.
        sound?;
        cancel.check()?;
        made
    }
}

/// Does the work while a second thread carries the caller's wish to stop over to the library's own token.
fn watched<T: Send>(cancel: &CancelToken, work: impl FnOnce(&EngineToken) -> T) -> T {
    let token = EngineToken::new();
    let (done, waiting) = channel::<()>();
    std::thread::scope(|scope| {
        let carried = token.clone();
        scope.spawn(move || {
            while waiting.recv_timeout(POLL) == Err(RecvTimeoutError::Timeout) {
                if cancel.reason().is_some() {
                    carried.cancel();
                    return;
                }
            }
        });
        let result = work(&token);
        // Dropping the sender, here or in a panic, ends the second thread.
        drop(done);
        result
    })
}

fn evaluate(operation: Operation, operands: &[Operand<'_>], token: &EngineToken) -> Result<TriMesh, BooleanError> {
    if operation == Operation::Hull {
        let solids: Result<Vec<Manifold>, BooleanError> =
            operands.iter().enumerate().map(|(index, operand)| import(index, operand.mesh).map(Manifold::from_impl)).collect();
        return finished(&Manifold::hull_manifolds(&solids?));
    }
    let kind = match operation {
        Operation::Union | Operation::Hull => OpType::Add,
        Operation::Intersection => OpType::Intersect,
        Operation::Difference => OpType::Subtract,
    };
    let mut solids = Vec::with_capacity(operands.len());
    for (index, operand) in operands.iter().enumerate() {
        solids.push(import(index, operand.mesh)?);
        if token.is_cancelled() {
            // The caller's token tells why.
            return Ok(TriMesh::default());
        }
    }
    // The tree copies its leaves and its result, which for two costs as much as a tenth of the work.
    let result = match <[ManifoldImpl; 2]>::try_from(solids) {
        Ok(two) => {
            let [first, second] = two.map(Manifold::from_impl);
            first.boolean_with_token(&second, kind, Some(token))
        }
        Err(many) => {
            let leaves = many.into_iter().map(CsgNode::leaf).collect();
            Manifold::from_impl(CsgNode::op_n(kind, leaves).evaluate_with_token(Some(token)))
        }
    };
    finished(&result)
}

fn finished(result: &Manifold) -> Result<TriMesh, BooleanError> {
    match result.status() {
        Status::NoError => Ok(export(result)),
        Status::Cancelled => Ok(TriMesh::default()),
        Status::ResultTooLarge => Err(BooleanError::ResultTooLarge),
        status => Err(BooleanError::Engine(format!("{status:?}"))),
    }
}

fn import(index: usize, mesh: &TriMesh) -> Result<ManifoldImpl, BooleanError> {
    if mesh.triangles.is_empty() {
        return Ok(Manifold::empty().into_impl());
    }
    let solid = Manifold::from_mesh_glp(&MeshGLP::<f64, u32> {
        num_prop: 3,
        vert_properties: mesh.vertices.iter().flat_map(|p| p.to_array()).collect(),
        tri_verts: mesh.triangles.as_flattened().to_vec(),
        ..MeshGLP::default()
    });
    match solid.status() {
        Status::NoError => Ok(solid.into_impl()),
        status => Err(BooleanError::Engine(format!("operand {index} was refused: {status:?}"))),
    }
}

/// Whether a mesh meets itself in more than points and edges.
fn overlaps(index: usize, mesh: &TriMesh) -> Result<bool, BooleanError> {
    let looked = || import(index, mesh).map(|solid| Manifold::from_impl(solid).has_self_intersections());
    catch_unwind(looked).unwrap_or_else(|panic| Err(BooleanError::Engine(words(panic.as_ref()))))
}

fn export(solid: &Manifold) -> TriMesh {
    // -1: no normals among the properties, so no vertex is split.
    let mesh = solid.get_mesh_glp::<f64, u32>(-1);
    let (points, _) = mesh.vert_properties.as_chunks::<3>();
    let (triangles, _) = mesh.tri_verts.as_chunks::<3>();
    TriMesh { vertices: points.iter().map(|p| DVec3::from_array(*p)).collect(), triangles: triangles.to_vec() }
}

/// What a panic said.
fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "panic without words".to_owned())
}
