//! The whole line, with a thread of its own for the linker.

mod common;

use std::ops::ControlFlow;

use common::{Memory, Sequence, build, plain, recycled, sweep, torus};
use scratch::Scratch;
use xfm_build::{BuildOptions, Error, Feed, Keep, LinkOptions, RecordProblem, build_from, resume};

fn sequence() -> Sequence {
    let shape = torus(60, 60);
    recycled(&plain(&shape, &sweep(&shape, 300, 3, 3)), 2)
}

fn feed_all(sequence: &Sequence, feed: &mut Feed) -> Result<(), Error> {
    let push = |(record, position, normal): &_| feed.push(record, *position, *normal);
    sequence.records.iter().try_for_each(push)
}

#[test]
fn the_file_is_that_of_the_stages_one_by_one() {
    let sequence = sequence();
    let folder = tempfile::tempdir().unwrap();
    let [expected, found] = ["expected", "found"].map(|name| folder.path().join(name));
    let link = LinkOptions::new(sequence.names);
    let (written, _) = build(&sequence, &expected, link.clone(), Memory::Ample).unwrap();
    let mut options = BuildOptions::new(link);
    options.expected_nodes = Some(1000);
    for keep in [None, Some(Keep { name: "a".to_owned(), identity: Vec::new() })] {
        options.keep = keep;
        let mut stages = Vec::new();
        let report = build_from(
            |feed| {
                feed_all(&sequence, feed)?;
                Ok::<_, Error>(sequence.coarse.clone())
            },
            &found,
            &Scratch::new(folder.path()),
            &options,
            &mut |progress| {
                assert!(progress.done <= progress.total);
                stages.push(progress.stage);
                ControlFlow::Continue(())
            },
        )
        .unwrap();
        assert_eq!(report.written, written);
        assert_eq!(report.nodes, sequence.records.len() as u64);
        assert_eq!(report.input_triangles, 7200);
        assert_eq!(report.scratch_bytes > 0, options.keep.is_some());
        stages.dedup();
        assert_eq!(stages, [xfm_build::Stage::Number, xfm_build::Stage::Write]);
        assert!(std::fs::read(&expected).unwrap() == std::fs::read(&found).unwrap());
        std::fs::remove_file(&found).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        let again = resume(&found, &Scratch::new(folder.path()), &options, &mut |_| {
            ControlFlow::Continue(())
        });
        assert!(again.unwrap().is_none(), "the file is there");
    }
}

#[test]
fn a_build_that_was_broken_off_while_it_numbered_is_gone_on_with() {
    let sequence = sequence();
    let folder = tempfile::tempdir().unwrap();
    let (scratch, path) = (Scratch::new(folder.path()), folder.path().join("a.xfm"));
    let mut options = BuildOptions::new(LinkOptions::new(sequence.names));
    options.keep = Some(Keep { name: "a".to_owned(), identity: vec![1, 2] });
    let collapse = |feed: &mut Feed| {
        feed_all(&sequence, feed)?;
        Ok::<_, Error>(sequence.coarse.clone())
    };
    let stop = &mut |_| ControlFlow::Break(());
    let broken_off = build_from(collapse, &path, &scratch, &options, stop);
    assert!(matches!(broken_off, Err(Error::Interrupted)));
    let go_on = &mut |_| ControlFlow::Continue(());
    let report = resume(&path, &scratch, &options, go_on).unwrap().unwrap();
    assert_eq!(report.input_triangles, 7200);
    assert_eq!(report.collapse, std::time::Duration::ZERO);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn the_error_of_the_linker_is_told_and_not_that_it_stopped() {
    let mut sequence = sequence();
    let kept = sequence.records[100].0.kept;
    sequence.records[100].0.removed = kept;
    let folder = tempfile::tempdir().unwrap();
    let error = build_from(
        |feed| {
            let mut pushed = 0;
            // On and on, until the linker does not take any more.
            let error = loop {
                match feed_all(&sequence, feed) {
                    Ok(()) => pushed += 1,
                    Err(error) => break error,
                }
                assert!(pushed < 100, "the linker never stops");
            };
            assert!(matches!(error, Error::Stopped));
            Err::<xfm_build::CoarseMesh, _>(error)
        },
        folder.path().join("a.xfm"),
        &Scratch::new(folder.path()),
        &BuildOptions::new(LinkOptions::new(sequence.names)),
        &mut |_| ControlFlow::Continue(()),
    );
    let problem = RecordProblem::Same;
    match error {
        Err(Error::Record { order: 100, problem: found }) => assert_eq!(found, problem),
        other => panic!("{other:?}"),
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn the_error_of_the_one_who_collapses_is_told() {
    #[derive(Debug)]
    enum Mine {
        OutOfMesh,
        Theirs,
    }
    impl From<Error> for Mine {
        fn from(_: Error) -> Self {
            Self::Theirs
        }
    }
    let sequence = sequence();
    let folder = tempfile::tempdir().unwrap();
    let error = build_from(
        |feed| {
            feed_all(&sequence, feed)?;
            Err(Mine::OutOfMesh)
        },
        folder.path().join("a.xfm"),
        &Scratch::new(folder.path()),
        &BuildOptions::new(LinkOptions::new(sequence.names)),
        &mut |_| ControlFlow::Continue(()),
    );
    assert!(matches!(error, Err(Mine::OutOfMesh)), "{error:?}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
