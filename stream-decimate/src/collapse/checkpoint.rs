//! All that a run of collapses needs to go on from where it is.
//!
//! Only at two kinds of places: when the buffer has been emptied by half, where what finds neighbours is made anew from the
//! buffer; and between rounds once all is read, where nothing is found any more.

use bytemuck::{Pod, Zeroable};
use scratch::{CheckpointError, CheckpointReader, CheckpointWriter};

use crate::collapse::CollapseOptions;
use crate::collapse::collapser::Collapser;
use crate::portion::{Limits, Portion};
use crate::{Error, Repairs};

/// Bytes of a checkpoint beside the portion.
pub(super) const OTHER_BYTES: u64 = 4096;

/// What always has the same size.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Fixed {
    /// What was asked for.
    asked: [u64; 6],
    read: u64,
    told: u64,
    peak: u64,
    num_rounds: u64,
    repairs: [u64; 8],
    crc: u32,
    is_finishing: u32,
    /// [`NO_AXIS`] where nothing is known.
    axis: u32,
    below: f32,
    colour_scale: f32,
    zero: u32,
}

const NO_AXIS: u32 = 3;

impl Collapser {
    fn asked(&self) -> [u64; 6] {
        let weight = self.colour_weight.to_bits() as usize;
        let colours = usize::from(self.portion.has_colours);
        let Self { capacity, most_vertices, num_vertex_names, base_triangles, .. } = *self;
        [capacity, most_vertices, num_vertex_names, base_triangles, colours, weight]
            .map(|asked| asked as u64)
    }

    /// About how many bytes [`save`](Self::save) writes.
    pub(super) fn checkpoint_bytes(&self) -> u64 {
        let portion = &self.portion;
        Portion::saved_vertex_bytes(portion.has_colours) * portion.num_slots() as u64
            + Portion::SAVED_NAME_BYTES * self.capacity as u64
            + OTHER_BYTES
    }

    pub(super) fn save(&self, out: &mut CheckpointWriter) -> Result<(), scratch::Error> {
        let (axis, below) = self.below.map_or((NO_AXIS, 0.0), |(axis, at)| (axis as u32, at));
        let fixed = Fixed {
            asked: self.asked(),
            read: self.read,
            told: self.told,
            peak: self.peak as u64,
            num_rounds: self.rounds.num_rounds,
            repairs: self.inserter.repairs.counts().map(|(_, count)| count),
            crc: self.crc,
            is_finishing: self.is_finishing.into(),
            axis,
            below,
            colour_scale: self.portion.colour_scale,
            zero: 0,
        };
        out.put("collapses", &[fixed])?;
        self.portion.save(out)
    }

    pub(super) fn restore(
        options: &CollapseOptions,
        from: &mut CheckpointReader,
    ) -> Result<Self, Error> {
        let mut collapser = Self::new(options)?;
        let fixed = from.take_one::<Fixed>("collapses")?;
        if fixed.asked != collapser.asked() {
            return Err(CheckpointError::Other.into());
        }
        let limits = Limits {
            vertex_names: options.num_vertex_names(),
            face_names: options.num_face_names(),
            collapses: fixed.told,
        };
        let Self { portion, pool, .. } = &mut collapser;
        pool.install(|| portion.restore(from, limits))?;
        let triangles = portion.num_triangles();
        let sound = fixed.told < u32::MAX.into()
            && fixed.axis <= NO_AXIS
            && fixed.is_finishing <= 1
            && triangles <= collapser.capacity
            && triangles as u64 <= fixed.read
            && fixed.num_rounds < u64::MAX / 2
            && fixed.colour_scale >= 0.0
            && fixed.colour_scale.is_finite();
        if !sound {
            return Err(CheckpointError::Damaged("collapses").into());
        }
        collapser.portion.colour_scale = fixed.colour_scale;
        collapser.rounds.num_rounds = fixed.num_rounds;
        collapser.below = (fixed.axis < NO_AXIS).then_some((fixed.axis as usize, fixed.below));
        collapser.read = fixed.read;
        collapser.crc = fixed.crc;
        collapser.told = fixed.told;
        collapser.peak = fixed.peak as usize;
        collapser.inserter.repairs = Repairs::of(fixed.repairs);
        collapser.is_finishing = fixed.is_finishing == 1;
        match collapser.is_finishing {
            true => collapser.inserter.forget(),
            false => collapser.begin_reading(),
        }
        Ok(collapser)
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::path::Path;

    use mesh_io::{IndexedMesh, MeshSource, Triangle, TriangleSource};
    use proptest::prelude::*;
    use scratch::Scratch;

    use super::*;
    use crate::collapse::{CollapseState, Collapsed, CollapsedMesh, Collapsing, Recorder};
    use crate::messy::{colour_at, sheet};
    use crate::{CollapseReport, Progress, ReadOrder};

    /// Remembers what it is told, and keeps every checkpoint.
    struct Keeps<'a> {
        scratch: &'a Scratch,
        told: Vec<Collapsed>,
        /// How much had been told at each.
        checkpoints: Vec<usize>,
        first_name: usize,
        most_bytes: u64,
    }

    impl<'a> Keeps<'a> {
        fn new(scratch: &'a Scratch, first_name: usize) -> Self {
            let most_bytes = options(3000).checkpoint_bytes();
            Self { scratch, told: Vec::new(), checkpoints: Vec::new(), first_name, most_bytes }
        }
    }

    fn name(number: usize) -> String {
        format!("{number}")
    }

    impl Recorder<Error> for Keeps<'_> {
        fn tell(&mut self, collapse: &Collapsed) -> Result<(), Error> {
            self.told.push(*collapse);
            Ok(())
        }

        fn wants_checkpoint(&mut self, _: u64) -> bool {
            true
        }

        fn checkpoint(&mut self, state: &CollapseState<'_>) -> Result<(), Error> {
            let name = name(self.first_name + self.checkpoints.len());
            let most = self.most_bytes;
            let mut out = CheckpointWriter::create(self.scratch, &name)?;
            state.save(&mut out)?;
            assert!(out.bytes() <= most, "{} of {most}", out.bytes());
            out.finish()?;
            self.checkpoints.push(self.told.len());
            Ok(())
        }
    }

    fn go_on(_: &Progress) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn source(soup: &[Triangle]) -> Box<dyn TriangleSource + Send> {
        let mut mesh = IndexedMesh::from_soup(soup);
        mesh.colours = mesh.positions.iter().map(|&p| colour_at(p)).collect();
        Box::new(MeshSource::new(mesh, "soup"))
    }

    fn restored(
        scratch: &Scratch,
        options: &CollapseOptions,
        number: usize,
    ) -> Result<Collapsing, Error> {
        let mut from = CheckpointReader::open(scratch, &name(number))?.expect("it is there");
        let collapsing = Collapsing::resume(options, &mut from)?;
        from.finish()?;
        Ok(collapsing)
    }

    type Ran = Result<(CollapsedMesh, CollapseReport), Error>;

    fn run(
        collapsing: Collapsing,
        soup: &[Triangle],
        order: Option<ReadOrder>,
        keeps: &mut Keeps<'_>,
    ) -> Ran {
        match order {
            None => collapsing.run(&mut *source(soup), keeps, &mut go_on),
            Some(order) => {
                let folder: &Path = keeps.scratch.folder();
                let (mut open, at) = (|| Ok(source(soup)), (order, folder));
                collapsing.run_file(&mut open, at, keeps, &mut go_on)
            }
        }
    }

    fn options(buffer: usize) -> CollapseOptions {
        let mut options = CollapseOptions::default();
        (options.buffer_triangles, options.base_triangles) = (buffer, 4);
        options
    }

    /// A wheel whose hub has many more neighbours than a star holds.
    fn wheel(spokes: u32) -> Vec<Triangle> {
        let rim = |i: u32| {
            let angle = i as f32 / spokes as f32 * std::f32::consts::TAU;
            glam::vec3(angle.cos(), angle.sin(), 0.1 * (5.0 * angle).sin())
        };
        (0..spokes).map(|i| [glam::Vec3::ZERO, rim(i), rim((i + 1) % spokes)]).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, cases: 32, ..Default::default() })]

        #[test]
        fn what_follows_a_checkpoint_is_what_followed_it_before(
            rows in 10usize..160,
            holes in 20usize..90,
            mess in prop::collection::vec(any::<usize>(), 0..20),
            spokes in 3u32..60,
            buffer in 600usize..3000,
            order in prop::option::of(prop::sample::select(
                vec![ReadOrder::AsIs, ReadOrder::Counted, ReadOrder::Sorted]
            )),
            colours: bool,
        ) {
            let folder = tempfile::tempdir().unwrap();
            let scratch = Scratch::new(folder.path());
            let mut options = options(buffer);
            options.colours = colours;
            let mut soup = wheel(spokes);
            soup.extend(sheet(rows, holes, &mess));
            let mut keeps = Keeps::new(&scratch, 0);
            keeps.most_bytes = options.checkpoint_bytes();
            let ran = run(Collapsing::new(&options).unwrap(), &soup, order, &mut keeps);
            if let Err(Error::Unsorted { .. }) = ran {
                return Ok(());
            }
            let (rest, report) = ran.unwrap();
            prop_assert!(!keeps.checkpoints.is_empty());
            let step = 1 + keeps.checkpoints.len() / 8;
            for (number, &before) in keeps.checkpoints.iter().enumerate().step_by(step) {
                let collapsing = restored(&scratch, &options, number).unwrap();
                prop_assert_eq!(collapsing.0.portion.validate(), Ok(()));
                prop_assert_eq!(collapsing.num_told(), before as u64);
                let mut again = Keeps::new(&scratch, keeps.checkpoints.len());
                let ran = run(collapsing, &soup, order, &mut again).unwrap();
                prop_assert!(again.told == keeps.told[before..], "from {} of {}", before, keeps.told.len());
                prop_assert_eq!(&ran, &(rest.clone(), report));
                // And the checkpoints of that run are those of the first.
                let expected = keeps.checkpoints[number + 1..].iter().map(|&told| told - before);
                prop_assert!(again.checkpoints.iter().copied().eq(expected));
            }
            // Nothing goes on with another input.
            let mut other = soup.clone();
            other[0][0].x += 1.0;
            let first = restored(&scratch, &options, 0).unwrap();
            if order.is_none() {
                let again = run(first, &other, order, &mut Keeps::new(&scratch, 1000));
                let is_noticed = matches!(again, Err(Error::OtherInput { .. }));
                prop_assert!(is_noticed, "{:?}", again);
            }
        }

        #[test]
        fn whatever_is_in_a_checkpoint_nothing_panics(
            changes in prop::collection::vec((any::<usize>(), any::<usize>(), any::<u32>()), 1..3),
            finishing in any::<bool>(),
            colours: bool,
        ) {
            let folder = tempfile::tempdir().unwrap();
            let scratch = Scratch::new(folder.path());
            let mut options = options(1000);
            options.colours = colours;
            let mut soup = wheel(40);
            soup.extend(sheet(80, 50, &[]));
            let mut keeps = Keeps::new(&scratch, 0);
            run(Collapsing::new(&options).unwrap(), &soup, None, &mut keeps).unwrap();
            let number = if finishing { keeps.checkpoints.len() - 3 } else { 0 };
            let mut changed = restored(&scratch, &options, number).unwrap();
            for &(kind, at, to) in &changes {
                change(&mut changed.0.portion, kind, at, to);
            }
            let mut out = CheckpointWriter::create(&scratch, &name(number)).unwrap();
            changed.0.save(&mut out).unwrap();
            out.finish().unwrap();
            match restored(&scratch, &options, number) {
                Ok(collapsing) => {
                    prop_assert_eq!(collapsing.0.portion.validate(), Ok(()));
                    // Where only numbers were changed it goes on, and comes to some end.
                    let ran = run(collapsing, &soup, None, &mut Keeps::new(&scratch, 1000));
                    prop_assert!(matches!(ran, Ok(_) | Err(Error::Unsorted { .. })), "{:?}", ran);
                }
                Err(Error::Checkpoint(CheckpointError::Damaged(_))) => {}
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// Changes a number somewhere.
    fn change(portion: &mut Portion, kind: usize, at: usize, to: u32) {
        let count = portion.num_slots();
        let v = at % count;
        // Near what is there, or anything.
        let to = if to.is_multiple_of(2) { to % (count as u32 + 2) } else { to };
        match kind % 10 {
            0 => portion.flags[v] = to as u8,
            1 => portion.bounds[v] = f32::from_bits(to),
            2 => portion.waiting[v] = to,
            3 => portion.identities[v].name = to,
            4 => portion.identities[v].touched = to,
            5 => portion.vertices[v].position.x = f32::from_bits(to),
            6 => portion.vertices[v].target = to,
            7 => portion.stars.change(v, at / count, to),
            8 if portion.has_colours => portion.paints[v].area = f32::from_bits(to),
            _ => {
                let names = portion.names.as_mut().unwrap();
                let free =
                    if at.is_multiple_of(2) { &mut names.vertices } else { &mut names.faces };
                match free.names.len() {
                    0 => free.used = to,
                    len => free.names[at / 2 % len] = to,
                }
            }
        }
    }

    #[test]
    fn other_options_are_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let scratch = Scratch::new(folder.path());
        let soup = sheet(80, 50, &[]);
        let mut keeps = Keeps::new(&scratch, 0);
        run(Collapsing::new(&options(1000)).unwrap(), &soup, None, &mut keeps).unwrap();
        let other = restored(&scratch, &options(1001), 0);
        assert!(matches!(other, Err(Error::Checkpoint(CheckpointError::Other))));
        let mut coloured = options(1000);
        coloured.colours = true;
        let other = restored(&scratch, &coloured, 0);
        assert!(matches!(other, Err(Error::Checkpoint(CheckpointError::Other))));
        let mut threads = options(1000);
        threads.threads = std::num::NonZero::new(3);
        assert!(restored(&scratch, &threads, 0).is_ok(), "their number does not matter");
    }
}
