//! A build that is broken off anywhere is gone on with from its last checkpoint, to the same file.

mod common;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use common::{Random, Shape, colour_at, sheet, torus};
use mesh_io::{IndexedMesh, MeshSource, Triangle, TriangleSource};
use stream_decimate::ReadOrder;
use xfm_build::{
    Error, Input, Keep, MeshError, MeshOptions, MeshProgress, MeshReport, Mode, StateProblem,
    build_mesh,
};

/// A mesh as a soup, which cannot be counted, or with numbers; in files or through a pipe.
#[derive(Clone)]
struct Mesh {
    mesh: IndexedMesh,
    has_numbers: bool,
    is_pipe: bool,
}

struct Soup(MeshSource);

impl TriangleSource for Soup {
    fn read(&mut self, out: &mut Vec<Triangle>, max: usize) -> Result<usize, mesh_io::Error> {
        // Not always as many as there might be.
        self.0.read(out, max.min(1000))
    }

    fn triangle_count(&self) -> Option<u64> {
        None
    }
}

impl Mesh {
    fn new(size: u32) -> Self {
        Self::of(torus(size, size))
    }

    fn of(shape: Shape) -> Self {
        let mesh = IndexedMesh {
            positions: shape.positions,
            triangles: shape.triangles,
            ..Default::default()
        };
        Self { mesh, has_numbers: false, is_pipe: false }
    }

    fn shuffled(mut self) -> Self {
        let mut random = Random(1);
        for i in (1..self.mesh.triangles.len()).rev() {
            self.mesh.triangles.swap(i, random.below(i + 1));
        }
        self
    }

    fn coloured(mut self) -> Self {
        self.mesh.colours = self.mesh.positions.iter().map(|&p| colour_at(p)).collect();
        self.has_numbers = true;
        self
    }

    fn open(&self) -> Box<dyn TriangleSource + Send> {
        let source = MeshSource::new(self.mesh.clone(), "mesh");
        if self.has_numbers { Box::new(source) } else { Box::new(Soup(source)) }
    }
}

/// A folder with what a run leaves in it, and the file beside it.
struct Place {
    scratch: tempfile::TempDir,
    files: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        Self { scratch: tempfile::tempdir().unwrap(), files: tempfile::tempdir().unwrap() }
    }

    fn file(&self) -> PathBuf {
        self.files.path().join("a.xfm")
    }

    fn left(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.scratch.path()).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

fn options() -> MeshOptions {
    let mut options = MeshOptions::default();
    options.memory_bytes = 1;
    options.mode = Some(Mode::Streaming);
    options.keep = Some(Keep { name: "a".to_owned(), identity: b"a mesh".to_vec() });
    options.checkpoint_every = Some(std::time::Duration::ZERO);
    options
}

fn resuming() -> MeshOptions {
    let mut options = options();
    options.resume = true;
    options
}

/// Builds, until the observer has been told so often.
fn build(
    mesh: &Mesh,
    place: &Place,
    options: &MeshOptions,
    mut times: usize,
) -> Result<MeshReport, MeshError> {
    build_until(mesh, place, options, |_| {
        times = times.saturating_sub(1);
        times == 0
    })
}

fn build_until(
    mesh: &Mesh,
    place: &Place,
    options: &MeshOptions,
    mut stop: impl FnMut(MeshProgress) -> bool,
) -> Result<MeshReport, MeshError> {
    let mut observer = |progress| match stop(progress) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    };
    let path: &Path = &place.file();
    if mesh.is_pipe {
        let mut source = mesh.open();
        return build_mesh(
            Input::Pipe(&mut *source),
            path,
            place.scratch.path(),
            options,
            &mut observer,
        );
    }
    let mut open = || Ok(mesh.open());
    build_mesh(Input::File(&mut open), path, place.scratch.path(), options, &mut observer)
}

fn is_interrupted(built: &Result<MeshReport, MeshError>) -> bool {
    matches!(
        built,
        Err(MeshError::Collapse(stream_decimate::Error::Interrupted)
            | MeshError::Build(Error::Interrupted))
    )
}

/// The bytes of the whole file, built at once.
fn at_once(mesh: &Mesh) -> (Vec<u8>, MeshReport) {
    let place = Place::new();
    let mut options = options();
    options.keep = None;
    let report = build(mesh, &place, &options, usize::MAX).unwrap();
    (std::fs::read(place.file()).unwrap(), report)
}

/// A checkpoint from the middle of a build.
fn leave(mesh: &Mesh, place: &Place) {
    for times in (20..).step_by(10) {
        assert!(is_interrupted(&build(mesh, place, &options(), times)));
        if !place.left().is_empty() {
            return;
        }
    }
}

fn problem(built: Result<MeshReport, MeshError>) -> StateProblem {
    match built {
        Err(MeshError::Build(Error::State { problem, file })) => {
            assert!(file.ends_with("a.state"));
            problem
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn broken_off_again_and_again_it_becomes_the_same_file() {
    let sorted = Mesh::new(260);
    let pipe = Mesh { is_pipe: true, ..sorted.clone() };
    let shuffled = sorted.clone().shuffled();
    let numbered = Mesh { has_numbers: true, ..sorted.clone() };
    // All of it lies on its boundary.
    let ribbon = Mesh { has_numbers: true, ..Mesh::of(sheet(1, 60_000)) };
    let coloured = sorted.clone().coloured();
    for (mesh, order) in [
        (sorted, ReadOrder::AsIs),
        (pipe, ReadOrder::AsIs),
        (shuffled, ReadOrder::Sorted),
        (numbered, ReadOrder::AsIs),
        (ribbon.clone().coloured(), ReadOrder::Counted),
        (ribbon, ReadOrder::Counted),
        (coloured, ReadOrder::AsIs),
    ] {
        let (expected, report) = at_once(&mesh);
        assert_eq!(report.order, order);
        let place = Place::new();
        let (mut steps, mut runs, mut resumed) = (25, 0, 0);
        let last = loop {
            let built = build(&mesh, &place, &resuming(), steps);
            assert!(!place.file().exists() || built.is_ok());
            runs += 1;
            assert!(runs < 500);
            match built {
                Ok(report) => break report,
                ref built => assert!(is_interrupted(built), "{built:?}"),
            }
            resumed += usize::from(place.left() == ["a.log", "a.state"]);
            // Reading once more takes some steps too.
            steps += 1 + steps / 20;
        };
        assert!(resumed > 3, "{resumed} of {runs} runs left something");
        assert!(last.resumed && place.left().is_empty());
        assert!(std::fs::read(place.file()).unwrap() == expected, "{order:?} after {runs} runs");
        assert_eq!(last.collapse, report.collapse);
        assert_eq!((last.order, last.built.written), (order, report.built.written));
    }
}

#[test]
fn what_is_built_in_core_is_gone_on_with_between_rounds() {
    for mesh in [Mesh::new(120), Mesh::new(120).coloured()] {
        go_on_in_core(&mesh);
    }
}

fn go_on_in_core(mesh: &Mesh) {
    let place = Place::new();
    let mut options = resuming();
    options.mode = Some(Mode::InCore);
    options.expected_triangles = Some(28_800);
    options.keep = None;
    build(mesh, &place, &options, usize::MAX).unwrap();
    let expected = std::fs::read(place.file()).unwrap();
    std::fs::remove_file(place.file()).unwrap();
    options.keep = resuming().keep;
    let mut runs = 0;
    while build(mesh, &place, &options, 8 + 8 * runs).is_err() {
        assert_eq!(place.left(), ["a.log", "a.state"]);
        runs += 1;
        assert!(runs < 100);
    }
    assert!(runs > 2, "{runs}");
    assert!(std::fs::read(place.file()).unwrap() == expected && place.left().is_empty());
}

#[test]
fn what_is_kept_goes_when_a_new_run_begins_and_when_there_is_nothing_to_keep() {
    let mesh = Mesh::new(260);
    let place = Place::new();
    leave(&mesh, &place);
    let mut report = build(&mesh, &place, &options(), usize::MAX).unwrap();
    assert!(!report.resumed && place.left().is_empty());
    // Nothing is left of a mesh that never gets through.
    let mut shuffled = mesh.clone().shuffled();
    shuffled.is_pipe = true;
    let built = build(&shuffled, &place, &options(), usize::MAX);
    assert!(matches!(built, Err(MeshError::Collapse(stream_decimate::Error::Unsorted { .. }))));
    assert!(place.left().is_empty());
    // With nothing to go on from, it begins.
    report = build(&mesh, &place, &resuming(), usize::MAX).unwrap();
    assert!(!report.resumed && place.left().is_empty());
}

#[test]
fn any_damage_is_noticed_and_nothing_is_made_of_it() {
    let mesh = Mesh::new(200);
    let (expected, _) = at_once(&mesh);
    let place = Place::new();
    leave(&mesh, &place);
    let [log, state] = ["a.log", "a.state"].map(|name| place.scratch.path().join(name));
    let (whole_log, whole_state) = (std::fs::read(&log).unwrap(), std::fs::read(&state).unwrap());
    let restore = || {
        std::fs::write(&log, &whole_log).unwrap();
        std::fs::write(&state, &whole_state).unwrap();
    };
    let resume = || {
        let built = build(&mesh, &place, &resuming(), usize::MAX);
        assert!(built.is_ok() || !place.file().exists());
        built
    };
    let mut random = Random(7);
    let len = whole_state.len();
    let places = (0..400).step_by(7).chain((0..60).map(|_| random.below(len)));
    for at in places.chain(len - 60..len) {
        let mut changed = whole_state.clone();
        changed[at] ^= 1 << (at % 8);
        std::fs::write(&state, changed).unwrap();
        assert!(matches!(problem(resume()), StateProblem::Damaged(_)), "byte {at}");
        std::fs::write(&state, &whole_state[..at]).unwrap();
        assert!(matches!(problem(resume()), StateProblem::Damaged(_)), "{at} bytes");
    }
    std::fs::write(&state, [&whole_state[..], &[0]].concat()).unwrap();
    assert!(matches!(problem(resume()), StateProblem::Damaged(_)), "one byte more");
    // The log may have grown since, but may not have changed before.
    let mut damaged = 0;
    for _ in 0..40 {
        restore();
        let mut changed = whole_log.clone();
        let at = random.below(changed.len());
        changed[at] ^= 1 << (at % 8);
        std::fs::write(&log, changed).unwrap();
        match resume() {
            Ok(_) => assert!(std::fs::read(place.file()).unwrap() == expected, "byte {at}"),
            built => {
                assert!(matches!(problem(built), StateProblem::Damaged("the log beside it")));
                damaged += 1;
            }
        }
        std::fs::remove_file(place.file()).ok();
    }
    assert!(damaged > 10, "{damaged}");
    restore();
    std::fs::write(&log, &whole_log[..whole_log.len() / 4]).unwrap();
    assert!(matches!(problem(resume()), StateProblem::Damaged("the log beside it")));
    std::fs::remove_file(&log).unwrap();
    assert!(matches!(problem(resume()), StateProblem::Damaged("the log beside it")));
    restore();
    // As it crashed, with the next checkpoint half written.
    std::fs::write(place.scratch.path().join("a.state.new"), &whole_state[..len / 2]).unwrap();
    assert!(resume().unwrap().resumed);
    assert!(std::fs::read(place.file()).unwrap() == expected && place.left().is_empty());
}

#[test]
fn nothing_goes_on_with_another_input_or_other_options() {
    let mesh = Mesh::new(200).coloured();
    let place = Place::new();
    leave(&mesh, &place);
    let is_other = |mesh: &Mesh, options: &MeshOptions| {
        let is_other =
            matches!(problem(build(mesh, &place, options, usize::MAX)), StateProblem::Other);
        assert_eq!(place.left(), ["a.log", "a.state"]);
        is_other
    };
    let mut other = mesh.clone();
    other.mesh.positions[3].x += 0.001;
    assert!(is_other(&other, &resuming()));
    let mut other = mesh.clone();
    other.mesh.triangles.truncate(1000);
    assert!(is_other(&other, &resuming()), "it is shorter");
    let mut other = mesh.clone();
    other.mesh.colours[7][2] ^= 1;
    assert!(is_other(&other, &resuming()));
    other.mesh.colours.clear();
    assert!(is_other(&other, &resuming()), "it has no colours");
    let mut options = resuming();
    options.colour_weight = 0.5;
    assert!(is_other(&mesh, &options));
    let mut options = resuming();
    options.memory_bytes = 400 << 20;
    assert!(is_other(&mesh, &options));
    let mut options = resuming();
    options.write.levels = 2;
    assert!(is_other(&mesh, &options));
    let mut options = resuming();
    options.keep.as_mut().unwrap().identity.push(0);
    assert!(is_other(&mesh, &options));
}

#[test]
fn a_pipe_is_read_to_its_end_even_where_all_of_it_has_been_collapsed() {
    let mesh = Mesh { is_pipe: true, ..Mesh::new(200) };
    let (expected, report) = at_once(&mesh);
    let place = Place::new();
    let broken_off = build_until(&mesh, &place, &options(), |progress| {
        matches!(progress, MeshProgress::Build(_))
    });
    assert!(is_interrupted(&broken_off) && place.left() == ["a.log", "a.state"]);
    let mut other = mesh.clone();
    if let Some(last) = other.mesh.triangles.last_mut() {
        last.rotate_left(1);
    }
    assert!(matches!(problem(build(&other, &place, &resuming(), usize::MAX)), StateProblem::Other));
    other.mesh.triangles.pop();
    assert!(matches!(problem(build(&other, &place, &resuming(), usize::MAX)), StateProblem::Other));
    let last = build(&mesh, &place, &resuming(), usize::MAX).unwrap();
    assert!(last.resumed && last.collapse == report.collapse);
    assert!(std::fs::read(place.file()).unwrap() == expected && place.left().is_empty());
}
