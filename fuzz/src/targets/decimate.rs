//! Decimation by every method, and collapses for hierarchies, of any soup.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::path::Path;

use halfedge::FaceId;
use mesh_io::{
    Error as MeshError, IndexedMesh, MeshSource, Triangle, TriangleSink, TriangleSource,
};
use stream_decimate::{
    CollapseOptions, Collapsed, DecimateOptions, DecimateReport, Error, Placement, ReadOrder,
    Target as Aim, collapse_file, decimate, decimate_clustered, decimate_file, decimate_greedy,
};

use super::soup::{Pipe, Soup, is_watertight, seeds};
use crate::target::MemoryLimit;
use crate::{Target, mutate};

/// Memory depends on the buffer, not on the bytes; soups have up to 6,000 triangles.
const LIMIT: MemoryLimit = MemoryLimit { fixed: 32 << 20, per_byte: 0 };

/// Streaming, greedy and clustering.
pub const TARGET: Target =
    Target { name: "decimate", seeds, mutate: mutate::bytes, run: decimate_soup, memory: LIMIT };

/// Collapses told one by one.
pub const COLLAPSE: Target =
    Target { name: "collapse", seeds, mutate: mutate::bytes, run: collapse_soup, memory: LIMIT };

/// Keeps what is written.
#[derive(Default)]
struct Kept<'a>(Option<&'a mut Vec<Triangle>>);

impl TriangleSink for Kept<'_> {
    fn write(&mut self, triangles: &[Triangle]) -> Result<(), MeshError> {
        if let Some(kept) = &mut self.0 {
            kept.extend_from_slice(triangles);
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), MeshError> {
        Ok(())
    }
}

fn options(soup: &Soup) -> DecimateOptions {
    let [how, more, target, seed] = soup.choices;
    let share = (f64::from(target) + 1.0) / 256.0;
    let mut options = DecimateOptions::new(match how % 3 {
        0 => Aim::Ratio(share),
        1 => Aim::Triangles(u64::from(target) * 4),
        _ => Aim::MaxError(f64::from(target) * 0.01),
    });
    options.buffer_triangles = 64 + usize::from(more) * 8;
    options.candidates = 1 + usize::from(seed % 9);
    options.seed = seed.into();
    options.threads = std::num::NonZeroUsize::new(1 + usize::from(how >> 7));
    if how & 64 != 0 {
        options.placement = Placement::Subset;
    }
    options
}

fn decimate_soup(bytes: &[u8]) {
    let soup = Soup::of(bytes);
    let options = options(&soup);
    let go_on = &mut |_: &stream_decimate::Progress| ControlFlow::Continue(());
    let mut kept = Vec::new();
    match soup.choices[0] >> 4 & 3 {
        0 => {
            let mut sink = Kept(Some(&mut kept));
            let report = decimate(&mut Pipe::new(soup.corners()), &mut sink, &options, go_on);
            check(&soup, &options, report, &kept);
        }
        1 => {
            let numbered = soup.choices[3].is_multiple_of(2);
            let mut open = || -> Result<Box<dyn TriangleSource + Send>, MeshError> {
                Ok(match numbered {
                    true => Box::new(MeshSource::new(soup.mesh(), "case")),
                    false => Box::new(Pipe::new(soup.corners())),
                })
            };
            // What is created is written once, at most.
            let shared = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
            let mut create = |_| {
                shared.lock().expect("nobody panicked").clear();
                Ok(Box::new(SharedSink(shared.clone())) as Box<dyn TriangleSink + Send>)
            };
            let folder = std::env::temp_dir();
            let report = decimate_file(&mut open, &mut create, &options, &folder, go_on);
            let kept = shared.lock().expect("nobody panicked").clone();
            check(&soup, &options, report, &kept);
        }
        2 => match decimate_greedy(&soup.mesh(), &options, go_on) {
            Ok((mesh, report)) => check(&soup, &options, Ok(report), &triangles_of(&mesh)),
            Err(error) => check(&soup, &options, Err(error), &[]),
        },
        _ => {
            let mut open =
                || Ok(Box::new(Pipe::new(soup.corners())) as Box<dyn TriangleSource + Send>);
            match decimate_clustered(&mut open, &options, go_on) {
                Ok((mesh, report)) => {
                    assert_eq!(report.output_triangles, triangles_of(&mesh).len() as u64);
                }
                Err(error) => check(&soup, &options, Err(error), &[]),
            }
        }
    }
}

struct SharedSink(std::sync::Arc<std::sync::Mutex<Vec<Triangle>>>);

impl TriangleSink for SharedSink {
    fn write(&mut self, triangles: &[Triangle]) -> Result<(), MeshError> {
        self.0.lock().expect("nobody panicked").extend_from_slice(triangles);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), MeshError> {
        Ok(())
    }
}

fn triangles_of(mesh: &IndexedMesh) -> Vec<Triangle> {
    let vertices = mesh.positions.len() as u32;
    assert!(mesh.triangles.iter().flatten().all(|&v| v < vertices), "an index too large");
    mesh.to_soup()
}

fn check(
    soup: &Soup,
    options: &DecimateOptions,
    report: Result<DecimateReport, Error>,
    kept: &[Triangle],
) {
    let input = soup.triangles.len() as u64;
    let report = match report {
        Ok(report) => report,
        // With its reason.
        Err(Error::Unsorted { .. } | Error::UnknownLength { .. }) => return,
        Err(error) => panic!("{error}"),
    };
    assert_eq!(report.output_triangles, kept.len() as u64);
    assert_eq!(report.input_triangles, input);
    assert!(kept.iter().flatten().all(|corner| corner.is_finite()), "a corner that is not finite");
    if let Some(target) = options.target.triangles(input) {
        let missed = report.missed.is_some();
        assert!(
            missed || report.output_triangles <= target,
            "{} triangles, {target} asked for, and no reason",
            report.output_triangles
        );
    }
    if soup.is_watertight() {
        // What a buffer so small could not wait for is said.
        let said = report.sealed_vertices > 0
            || report.repaired.counts().iter().any(|(_, count)| *count > 0);
        assert!(said || is_watertight_or_coincident(kept), "it was watertight");
    }
}

/// Watertight, but for vertices that came to lie in one place.
fn is_watertight_or_coincident(triangles: &[Triangle]) -> bool {
    if is_watertight(triangles) {
        return true;
    }
    // Every edge has as many triangles on one side as on the other.
    let mut edges = HashMap::new();
    for triangle in triangles {
        let corners = triangle.map(|c| (c + glam::Vec3::ZERO).to_array().map(f32::to_bits));
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            let (edge, sign) = if a < b { ([a, b], 1) } else { ([b, a], -1) };
            if a != b {
                *edges.entry(edge).or_insert(0) += sign;
            }
        }
    }
    edges.values().all(|&sum| sum == 0)
}

/// Per face the highest rank of a collapse that names one of its half-edges.
#[derive(Default)]
struct Named(HashMap<FaceId, u32>);

impl Named {
    /// What names a face is split after what brings it.
    fn check(&mut self, collapse: &Collapsed) {
        for h in [Some(collapse.half_edge), collapse.reverse].into_iter().flatten() {
            if let Some(rank) = self.0.remove(&h.face()) {
                assert!(rank < collapse.rank, "rank {} names a face of {}", rank, collapse.rank);
            }
        }
        for h in collapse.adjacent.into_iter().flatten() {
            let rank = self.0.entry(h.face()).or_default();
            *rank = (*rank).max(collapse.rank);
        }
    }
}

fn collapse_soup(bytes: &[u8]) {
    let soup = Soup::of(bytes);
    let [how, more, base, _] = soup.choices;
    let mut options = CollapseOptions::default();
    options.buffer_triangles = 64 + usize::from(more) * 8;
    options.base_triangles = base.into();
    options.threads = std::num::NonZeroUsize::new(1);
    let order = [ReadOrder::AsIs, ReadOrder::Counted, ReadOrder::Sorted][usize::from(how % 3)];
    let mut open = || -> Result<Box<dyn TriangleSource + Send>, MeshError> {
        Ok(Box::new(MeshSource::new(soup.mesh(), "case")))
    };
    let mut told = 0u64;
    let mut named = Named::default();
    let outcome = collapse_file::<Error>(
        &mut open,
        order,
        Path::new(&std::env::temp_dir()),
        &options,
        &mut |collapse| {
            told += 1;
            named.check(collapse);
            Ok(())
        },
        &mut |_| ControlFlow::Continue(()),
    );
    match outcome {
        Ok((mesh, _)) => {
            assert!(mesh.vertices.iter().all(|vertex| vertex.position.is_finite()));
        }
        Err(Error::Unsorted { .. }) => {}
        Err(error) => panic!("{error}"),
    }
    assert!(told <= 2 * soup.triangles.len() as u64, "{told} collapses");
}
