//! Collapses that contradict each other or the coarsest mesh are errors that say where.

mod common;

use std::ops::ControlFlow;

use common::{Memory, Random, Sequence, build, link, plain, recycled, sheet, sweep};
use glam::Vec3;
use halfedge::{FaceId, HalfEdgeId, VertexId};
use xfm_build::{
    CoarseProblem, Error, LinkOptions, NameBounds, NumberOptions, RecordProblem, Stage,
};

fn sequence() -> Sequence {
    let shape = sheet(12, 12);
    plain(&shape, &sweep(&shape, 50, 2, 3))
}

fn error(sequence: &Sequence) -> Error {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.xfm");
    let options = LinkOptions::new(sequence.names);
    let error = build(sequence, &path, options, Memory::Ample).unwrap_err();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left");
    error
}

fn record_problem(change: impl FnOnce(&mut Sequence)) -> (u64, RecordProblem) {
    let mut sequence = sequence();
    change(&mut sequence);
    match error(&sequence) {
        Error::Record { order, problem } => (order, problem),
        other => panic!("{other}"),
    }
}

fn coarse_problem(change: impl FnOnce(&mut Sequence)) -> CoarseProblem {
    let mut sequence = sequence();
    change(&mut sequence);
    match error(&sequence) {
        Error::Coarse(problem) => problem,
        other => panic!("{other}"),
    }
}

#[test]
fn a_collapse_that_is_none() {
    use RecordProblem::*;
    let h = |s: &Sequence| HalfEdgeId::new(3 * s.names.faces);
    let v = |s: &Sequence| VertexId::new(s.names.vertices);
    assert_eq!(record_problem(|s| s.records[3].0.removed = v(s)), (3, Name));
    assert_eq!(record_problem(|s| s.records[0].0.kept = v(s)), (0, Name));
    assert_eq!(record_problem(|s| s.records[4].0.half_edge = h(s)), (4, Name));
    assert_eq!(record_problem(|s| s.records[4].0.adjacent[1] = Some(h(s))), (4, Name));
    assert_eq!(record_problem(|s| s.records[5].0.kept = s.records[5].0.removed), (5, Same));
    assert_eq!(record_problem(|s| s.records[6].1.x = f32::NAN), (6, NotFinite));
    assert_eq!(record_problem(|s| s.records[7].0.star.radius = f32::INFINITY), (7, NotFinite));
    let (order, problem) = record_problem(|s| s.records[8].1 = Vec3::splat(3e38));
    assert!(order >= 8 && problem == NotFinite, "{order} {problem}");
    let inner = |s: &Sequence| s.records.iter().position(|r| r.0.reverse.is_some()).unwrap();
    let (_, problem) = record_problem(|s| {
        let i = inner(s);
        s.records[i].0.adjacent[2] = None;
    });
    assert_eq!(problem, SecondFace);
    assert_eq!(record_problem(|s| s.colours = vec![[0; 4]]), (0, Colour));
}

#[test]
fn a_collapse_that_contradicts_later_ones() {
    let (order, problem) = record_problem(|s| {
        let gone = s.records[10].0.half_edge;
        let i = (11..s.records.len()).rev().find(|&i| s.records[i].0.adjacent[0].is_some());
        s.records[i.unwrap()].0.adjacent[0] = Some(gone);
    });
    assert!(order > 10, "{order}");
    assert!(matches!(problem, RecordProblem::LostHalfEdge(_)), "{problem}");
}

#[test]
fn a_coarsest_mesh_that_is_not_what_is_left() {
    use CoarseProblem::*;
    let name = |s: &Sequence| VertexId::new(s.names.vertices);
    assert_eq!(coarse_problem(|s| s.coarse.vertices[0].name = name(s)), Name);
    assert_eq!(coarse_problem(|s| s.coarse.faces[0].name = FaceId::new(s.names.faces)), Name);
    let twice = coarse_problem(|s| s.coarse.vertices.push(s.coarse.vertices[0]));
    assert!(matches!(twice, VertexTwice(_)));
    let twice = coarse_problem(|s| s.coarse.faces.push(s.coarse.faces[0]));
    assert!(matches!(twice, FaceTwice(_)));
    assert!(matches!(coarse_problem(|s| s.coarse.vertices.clear()), NoVertex(_)));
    let removed = coarse_problem(|s| s.coarse.faces[0].corners[0] = s.records[0].0.removed);
    assert!(matches!(removed, NoCorner(_)));
    assert_eq!(coarse_problem(|s| s.coarse.colours.push([0; 4])), Colours);
}

/// Whatever is changed in a sequence of collapses: there is an error, or it is one of another mesh, as far as can be seen
/// from names that are used again.
#[test]
fn no_change_of_a_sequence_makes_it_panic() {
    let shape = sheet(10, 10);
    let sequence = recycled(&plain(&shape, &sweep(&shape, 50, 2, 3)), 1);
    let mut random = Random(4);
    let mut failed = 0;
    let folder = tempfile::tempdir().unwrap();
    for _ in 0..2000 {
        let mut s = sequence.clone();
        for _ in 0..1 + random.below(3) {
            let [i, j] = [(); 2].map(|()| random.below(s.records.len()));
            let other = s.records[j].0;
            let record = &mut s.records[i].0;
            match random.below(9) {
                0 => record.removed = other.removed,
                1 => record.kept = other.kept,
                2 => record.kept = other.removed,
                3 => record.half_edge = other.half_edge,
                4 => record.reverse = record.reverse.and(other.reverse).or(record.reverse),
                5 => record.adjacent[0] = other.adjacent[1],
                6 => record.adjacent[3] = Some(other.half_edge),
                7 => s.records.swap(i, j),
                _ => drop(s.records.remove(i)),
            }
            if s.records.is_empty() {
                break;
            }
        }
        let linked = link(&s, folder.path(), &LinkOptions::new(s.names));
        let mut go_on = |_| ControlFlow::Continue(());
        let numbered = linked.and_then(|l| l.number(&NumberOptions::default(), &mut go_on));
        match numbered {
            Err(Error::Record { .. } | Error::Coarse(_)) => failed += 1,
            Err(other) => panic!("{other}"),
            Ok(_) => {}
        }
    }
    assert!(failed > 100, "{failed}");
}

#[test]
fn too_little_memory_is_said_before_the_work() {
    let sequence = sequence();
    let folder = tempfile::tempdir().unwrap();
    let mut options = LinkOptions::new(sequence.names);
    options.memory_bytes = options.least_memory_bytes() - 1;
    let needed = options.least_memory_bytes();
    let error = link(&sequence, folder.path(), &options).unwrap_err();
    assert!(matches!(error, Error::Memory { needed: n, .. } if n == needed), "{error}");
    options.memory_bytes += 1;
    let linked = link(&sequence, folder.path(), &options).unwrap();
    let mut number = NumberOptions::default();
    number.memory_bytes = linked.least_memory_bytes() - 1;
    let error = linked.number(&number, &mut |_| ControlFlow::Continue(())).unwrap_err();
    assert!(matches!(error, Error::Memory { .. }), "{error}");
    let mut options = LinkOptions::new(NameBounds { vertices: u32::MAX, faces: 3 });
    options.memory_bytes = u64::MAX;
    assert!(matches!(link(&sequence, folder.path(), &options), Err(Error::Names { .. })));
}

#[test]
fn options_and_folders_are_looked_at_first() {
    let sequence = sequence();
    let folder = tempfile::tempdir().unwrap();
    let mut options = LinkOptions::new(sequence.names);
    options.write.levels = 6;
    let error = link(&sequence, folder.path(), &options).unwrap_err();
    assert!(error.to_string().contains("levels per block is 6"), "{error}");
    options.write.levels = 4;
    options.memory_bytes = options.least_memory_bytes();
    let error = link(&sequence, "/no/such/folder".as_ref(), &options).unwrap_err();
    assert!(error.to_string().contains("/no/such/folder"), "{error}");
}

#[test]
fn the_observer_may_break_off_and_nothing_is_left() {
    let sequence = sequence();
    for stop in [Stage::Number, Stage::Write] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.xfm");
        let linked = link(&sequence, folder.path(), &LinkOptions::new(sequence.names)).unwrap();
        let mut observer = |progress: xfm_build::Progress| match progress.stage == stop {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        let built = linked
            .number(&NumberOptions::default(), &mut observer)
            .and_then(|numbered| numbered.write(&path, &mut observer));
        assert!(matches!(built, Err(Error::Interrupted)));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
