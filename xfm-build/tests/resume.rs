//! A run that ends after linking leaves what a later one needs to go on, and nothing else.

mod common;

use std::ops::ControlFlow;
use std::path::Path;

use common::{Memory, Sequence, build, coloured, plain, recycled, sheet, sweep};
use scratch::Scratch;
use xfm_build::{Error, Keep, LinkOptions, Linked, Linker, NumberOptions, StateProblem};
use xfm_format::WriteOptions;

fn sequence() -> Sequence {
    let shape = sheet(40, 40);
    recycled(&plain(&shape, &sweep(&shape, 200, 3, 3)), 2)
}

fn options(sequence: &Sequence) -> LinkOptions {
    let mut options = LinkOptions::new(sequence.names);
    options.write.page_nodes = Some(64);
    options.colours = !sequence.colours.is_empty();
    options.memory_bytes = options.least_memory_bytes();
    options
}

fn keep() -> Keep {
    Keep { name: "scan".to_owned(), identity: b"scan.ply, 1234 bytes".to_vec() }
}

/// Links everything, and ends.
fn leave(sequence: &Sequence, folder: &Path) -> Result<(), Error> {
    let mut linker = Linker::new_kept(&Scratch::new(folder), &options(sequence), &keep())?;
    linker.require(1000)?;
    for (i, (record, position, normal)) in sequence.records.iter().enumerate() {
        linker.push_with(record, *position, *normal, sequence.colours.get(i).copied())?;
    }
    drop(linker.finish(&sequence.coarse)?);
    Ok(())
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

fn go_on(linked: Linked, path: &Path) -> Result<(), Error> {
    let mut number = NumberOptions::default();
    number.memory_bytes = linked.least_memory_bytes();
    let mut observer = |_| ControlFlow::Continue(());
    let numbered = linked.number(&number, &mut observer)?;
    numbered.write(path, &mut observer)?;
    Ok(())
}

#[test]
fn the_file_is_the_same_and_then_nothing_is_left() {
    for sequence in [sequence(), coloured(sequence())] {
        go_on_with(&sequence);
    }
}

fn go_on_with(sequence: &Sequence) {
    let (folder, files) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let scratch = Scratch::new(folder.path());
    let write = options(sequence).write;
    assert!(Linked::resume(&scratch, &keep(), &write).unwrap().is_none());
    let [expected, found] = ["expected", "found"].map(|name| files.path().join(name));
    build(sequence, &expected, options(sequence), Memory::Ample).unwrap();

    leave(sequence, folder.path()).unwrap();
    assert_eq!(names(folder.path()), ["scan.log", "scan.state"]);
    let error = leave(sequence, folder.path()).unwrap_err();
    assert!(error.to_string().contains("exists"), "{error}");
    // The first attempt to go on is broken off, the second one is not.
    let linked = Linked::resume(&scratch, &keep(), &write).unwrap().unwrap();
    assert_eq!(linked.num_nodes(), sequence.records.len() as u64);
    let broken_off = linked.number(&NumberOptions::default(), &mut |_| ControlFlow::Break(()));
    assert!(matches!(broken_off, Err(Error::Interrupted)));
    assert_eq!(names(folder.path()), ["scan.log", "scan.state"]);
    let linked = Linked::resume(&scratch, &keep(), &write).unwrap().unwrap();
    go_on(linked, &found).unwrap();
    assert!(names(folder.path()).is_empty());
    assert!(std::fs::read(expected).unwrap() == std::fs::read(found).unwrap());
}

#[test]
fn a_run_that_ends_while_it_links_leaves_nothing() {
    let sequence = sequence();
    let folder = tempfile::tempdir().unwrap();
    let mut linker =
        Linker::new_kept(&Scratch::new(folder.path()), &options(&sequence), &keep()).unwrap();
    let (record, position, normal) = &sequence.records[0];
    linker.push(record, *position, *normal).unwrap();
    assert_eq!(names(folder.path()), ["scan.log"]);
    drop(linker);
    assert!(names(folder.path()).is_empty());
}

#[test]
fn another_input_and_damage_are_noticed() {
    let sequence = sequence();
    let folder = tempfile::tempdir().unwrap();
    let scratch = Scratch::new(folder.path());
    let write = options(&sequence).write;
    leave(&sequence, folder.path()).unwrap();
    let problem = |keep: &Keep, write: &WriteOptions| match Linked::resume(&scratch, keep, write)
        .unwrap_err()
    {
        Error::State { problem, file } => {
            assert!(file.ends_with("scan.state"));
            problem
        }
        other => panic!("{other}"),
    };
    let mut other = keep();
    other.identity.push(0);
    assert!(matches!(problem(&other, &write), StateProblem::Other));
    assert!(matches!(problem(&keep(), &WriteOptions::default()), StateProblem::Other));

    let path = folder.path().join("scan.state");
    let state = std::fs::read(&path).unwrap();
    for at in (0..state.len()).step_by(31) {
        let mut changed = state.clone();
        changed[at] ^= 16;
        std::fs::write(&path, &changed).unwrap();
        assert!(matches!(problem(&keep(), &write), StateProblem::Damaged(_)), "{at}");
        std::fs::write(&path, &state[..at]).unwrap();
        assert!(matches!(problem(&keep(), &write), StateProblem::Damaged(_)), "{at}");
    }
    std::fs::write(&path, &state).unwrap();

    let path = folder.path().join("scan.log");
    let log = std::fs::read(&path).unwrap();
    let found = folder.path().join("found");
    for at in (0..log.len()).step_by(log.len() / 20) {
        let mut changed = log.clone();
        changed[at] ^= 1;
        std::fs::write(&path, &changed).unwrap();
        let linked = Linked::resume(&scratch, &keep(), &write).unwrap().unwrap();
        let error = go_on(linked, &found).unwrap_err();
        assert!(error.to_string().contains("begin again"), "{error}");
    }
    assert_eq!(names(folder.path()), ["scan.log", "scan.state"]);
    keep().remove(&scratch).unwrap();
    keep().remove(&scratch).unwrap();
    assert!(names(folder.path()).is_empty());
}
