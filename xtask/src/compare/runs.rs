//! Runs in turn, and what is made of several.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::contender::Contender;
use crate::Error;

/// A contender is not run again once its runs, and those beside them, have taken this long.
const ENOUGH: Duration = Duration::from_secs(60);

/// What one run took.
#[derive(Debug, Clone)]
pub struct Run {
    /// Seconds by the clock.
    pub seconds: f64,
    /// The most resident memory, in bytes.
    pub peak_rss: u64,
    /// What it reported.
    pub report: Value,
}

/// A run, or why it failed.
pub type Attempt = Result<Run, String>;

/// One contender's runs.
#[derive(Debug, Clone, Default)]
pub struct Runs {
    /// Seconds of each.
    pub seconds: Vec<f64>,
    /// For each, its seconds over those of the reference's run just before.
    pub factors: Vec<f64>,
    /// The most of all runs, in bytes.
    pub peak_rss: u64,
    /// What the last one reported.
    pub report: Value,
}

impl Runs {
    fn add(&mut self, run: Run) {
        self.seconds.push(run.seconds);
        self.peak_rss = self.peak_rss.max(run.peak_rss);
        self.report = run.report;
    }
}

/// A contender's runs, or why one of them failed.
pub type Outcome = Result<Runs, String>;

/// Runs the reference a number of times, then each contender as often, the reference again before each run
/// of theirs where it works. Returns what came of the reference and of the contenders.
///
/// # Errors
/// Those of `attempt`; a run that fails for reasons of its own is an outcome.
pub fn in_turn(
    reference: &Contender,
    contenders: &[Contender],
    repeat: u32,
    attempt: &mut dyn FnMut(&Contender) -> Result<Attempt, Error>,
) -> Result<(Outcome, Vec<Outcome>), Error> {
    let mut alone =
        repeated(reference, repeat, &mut |runs| Ok(attempt(reference)?.map(|run| runs.add(run))))?;
    let mut beside = Vec::new();
    for contender in contenders {
        beside.push(repeated(contender, repeat, &mut |runs| {
            let mut before = None;
            if let Ok(reference_runs) = &mut alone {
                match attempt(reference)? {
                    Ok(run) => {
                        before = Some(run.seconds);
                        reference_runs.add(run);
                    }
                    Err(why) => return Ok(Err(format!("{} beside it: {why}", reference.name))),
                }
            }
            Ok(attempt(contender)?.map(|run| {
                runs.factors.extend(before.map(|before| run.seconds / before));
                runs.add(run);
            }))
        })?);
    }
    Ok((alone, beside))
}

/// The results as JSON, one for each that took part: what `row` makes of its runs, or why it failed.
///
/// # Errors
/// Those of `row`.
pub fn rows<'a>(
    outcomes: impl IntoIterator<Item = (&'a Contender, Outcome)>,
    row: impl Fn(&Contender, &Runs) -> Result<Value, Error>,
) -> Result<Vec<Value>, Error> {
    let outcomes = outcomes.into_iter();
    outcomes
        .map(|(contender, outcome)| match outcome {
            Err(why) => Ok(json!({ "name": contender.name, "failure": why })),
            Ok(runs) => row(contender, &runs),
        })
        .collect()
}

/// Nothing, or why a run failed.
type Done = Result<(), String>;

fn repeated(
    contender: &Contender,
    repeat: u32,
    run: &mut dyn FnMut(&mut Runs) -> Result<Done, Error>,
) -> Result<Outcome, Error> {
    let (mut runs, start) = (Runs::default(), Instant::now());
    for round in 1..=repeat {
        if round > 1 && start.elapsed() > ENOUGH {
            break;
        }
        eprintln!("{}, {round} of {repeat}", contender.name);
        if let Err(why) = run(&mut runs)? {
            return Ok(Err(why));
        }
    }
    Ok(Ok(runs))
}

/// The middle value, or the mean of the two in the middle; not a number where there is none.
pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// The median and the quartiles of factors as JSON; null where there are none.
pub fn spread(factors: &[f64]) -> Value {
    if factors.is_empty() {
        return Value::Null;
    }
    let [low, middle, high] = [0.25, 0.5, 0.75].map(|share| quantile(factors, share));
    json!({ "median": middle, "low": low, "high": high })
}

/// The value below which a share of the others lies, between two values in proportion.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = share * last as f64;
    let (below, part) = (place.floor() as usize, place.fract());
    sorted[below] + part * (sorted[(below + 1).min(last)] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::super::contender::{Kind, reference};
    use super::*;

    fn peer(name: &str) -> Contender {
        Contender { name: name.to_owned(), kind: Kind::Peer("peer") }
    }

    /// Every run takes a second more than the one before, and a MB.
    fn script(
        fail: &'static str,
    ) -> (impl FnMut(&Contender) -> Result<Attempt, Error>, Vec<Contender>) {
        let mut clock = 0;
        let attempt = move |contender: &Contender| {
            clock += 1;
            if contender.name == fail {
                return Ok(Err("no such module".to_owned()));
            }
            let report = json!({ "output_triangles": clock });
            Ok(Ok(Run { seconds: f64::from(clock), peak_rss: 1_000_000 * clock as u64, report }))
        };
        (attempt, vec![peer("a"), peer("b")])
    }

    #[test]
    fn each_run_is_compared_with_the_reference_just_before() {
        let (mut attempt, peers) = script("");
        let (alone, beside) = in_turn(&reference(), &peers, 2, &mut attempt).expect("it runs");
        assert_eq!(alone.map(|runs| runs.seconds), Ok(vec![1.0, 2.0, 3.0, 5.0, 7.0, 9.0]));
        let [Ok(a), Ok(b)] = &beside[..] else { panic!("both run") };
        assert_eq!(
            (&a.seconds[..], &a.factors[..]),
            (&[4.0, 6.0][..], &[4.0 / 3.0, 6.0 / 5.0][..])
        );
        assert_eq!((&b.seconds[..], b.peak_rss), (&[8.0, 10.0][..], 10_000_000));
        assert_eq!(b.report["output_triangles"], 10);
    }

    #[test]
    fn one_that_fails_says_why_and_the_others_go_on() {
        let (mut attempt, peers) = script("a");
        let (alone, beside) = in_turn(&reference(), &peers, 3, &mut attempt).expect("it runs");
        assert!(alone.is_ok());
        assert_eq!(beside[0].as_ref().map_err(String::as_str).err(), Some("no such module"));
        assert_eq!(beside[1].as_ref().map(|runs| runs.factors.len()), Ok(3));
    }

    #[test]
    fn without_the_reference_there_are_no_factors() {
        let (mut attempt, peers) = script("xfm");
        let (alone, beside) = in_turn(&reference(), &peers, 1, &mut attempt).expect("it runs");
        assert!(alone.is_err());
        assert!(beside.iter().all(|runs| runs.as_ref().is_ok_and(|runs| runs.factors.is_empty())));
    }

    #[test]
    fn the_median_is_the_middle() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0]), 2.5);
        assert!(median(&[]).is_nan());
        assert_eq!(spread(&[]), Value::Null);
        let five = spread(&[5.0, 1.0, 2.0, 3.0, 4.0]);
        assert_eq!(five, json!({ "median": 3.0, "low": 2.0, "high": 4.0 }));
    }
}
