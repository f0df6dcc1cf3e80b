//! What has to hold of a flight, and the table.

use serde_json::Value;

use super::flights::{Fate, Flight, Flown};

/// How much more memory the last quarter of a flight may have than the second, as a share …
const GROWTH: f64 = 0.05;
/// … and in bytes: an allocator does not give back every page at once.
const LEAST_GROWTH: f64 = 256.0 * 1024.0;
/// Seconds that no frame takes, however busy the machine is, unless it waits for something.
const HANGS: f64 = 1.0;

/// What does not hold, if something does not.
pub fn verdict(flight: &Flight, report: &Value) -> Option<String> {
    let number = |path: &str| report.pointer(path).and_then(Value::as_f64);
    // The pager's goes up and down with its quotas.
    let (pager, quota) = (number("/resident_bytes"), number("/hard_quota"));
    if pager.zip(quota).is_none_or(|(pager, quota)| pager > quota) {
        return Some("the pager took more than its quota".into());
    }
    for what in ["anonymous", "front"] {
        let quarter = |name: &str| number(&format!("/memory/{what}/{name}"));
        // Where the system does not tell the memory of processes, there is nothing to judge.
        let both = quarter("second_quarter").zip(quarter("last_quarter"));
        let Some((second, last)) = both else {
            if what == "anonymous" {
                continue;
            }
            return Some("there are too few samples of memory: fly longer".into());
        };
        if last - second > (GROWTH * second).max(LEAST_GROWTH) {
            let growth = 100.0 * (last / second - 1.0);
            return Some(format!("memory ({what}) grows by {growth:.1} %"));
        }
    }
    let slowest = number("/frame_s/max").unwrap_or(f64::INFINITY);
    if flight.loaders > 0 && slowest > HANGS {
        return Some(format!("a frame took {slowest:.2} s"));
    }
    let unsettled = number("/jumps/unsettled").unwrap_or(f64::INFINITY);
    if flight.fps > 0 && unsettled > 0.0 {
        return Some(format!("{unsettled} views did not settle"));
    }
    let damaged = number("/damaged_pages").unwrap_or(0.0);
    if (damaged > 0.0) != (flight.fate != Fate::Whole) {
        return Some(format!("{damaged} pages are named as damaged"));
    }
    None
}

/// A line for each flight.
pub fn table(flown: &[Flown]) -> String {
    let mut lines = vec![format!(
        "{:<11} {:>8} {:>7} {:>8} {:>15} {:>15} {:>8} {:>26}",
        "flight",
        "frames",
        "jumps",
        "checks",
        "settled s/max",
        "frame ms/max",
        "damaged",
        "memory MiB, 2nd to last ¼",
    )];
    for Flown { name, report, verdict } in flown {
        let number = |path: &str| report.pointer(path).and_then(Value::as_f64).unwrap_or(f64::NAN);
        let pair = |key: &str, unit: f64, digits: usize| {
            let [median, max] = ["median", "max"].map(|of| unit * number(&format!("{key}/{of}")));
            format!("{median:.digits$} / {max:.digits$}")
        };
        let memory =
            |quarter: &str| number(&format!("/memory/anonymous/{quarter}")) / f64::from(1 << 20);
        let growth = 100.0 * number("/memory/anonymous/growth");
        let trend = format!(
            "{:.2} to {:.2} ({growth:+.1} %)",
            memory("second_quarter"),
            memory("last_quarter")
        );
        lines.push(format!(
            "{name:<11} {:>8} {:>7} {:>8} {:>15} {:>15} {:>8} {trend:>26}  {}",
            number("/frames"),
            number("/jumps/jumps"),
            number("/validations"),
            pair("/jumps/settle_s", 1.0, 2),
            pair("/frame_s", 1e3, 2),
            number("/damaged_pages"),
            verdict.as_deref().unwrap_or("ok"),
        ));
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::load::flights;

    fn report() -> Value {
        let trend = json!({ "second_quarter": 20e6, "last_quarter": 20.4e6, "growth": 0.02 });
        json!({
            "frames": 100, "resident_bytes": 9e6, "hard_quota": 9e6, "damaged_pages": 0, "validations": 3,
            "frame_s": { "median": 0.001, "max": 0.01 },
            "jumps": { "jumps": 7, "unsettled": 0, "settle_s": { "median": 0.5, "max": 1.5 } },
            "memory": { "anonymous": trend, "front": trend },
        })
    }

    #[test]
    fn what_does_not_hold_is_told() {
        let [usual, _, _, damaged, _] = flights::all();
        assert_eq!(verdict(&usual, &report()), None);
        let cases = [
            ("/memory/front/last_quarter", json!(21.5e6), "memory (front) grows by 7.5 %"),
            ("/resident_bytes", json!(9.1e6), "the pager took more than its quota"),
            ("/memory/front", Value::Null, "there are too few samples of memory: fly longer"),
            ("/frame_s/max", json!(1.5), "a frame took 1.50 s"),
            ("/jumps/unsettled", json!(2), "2 views did not settle"),
            ("/damaged_pages", json!(1), "1 pages are named as damaged"),
        ];
        for (path, value, expected) in cases {
            let mut report = report();
            *report.pointer_mut(path).expect("it is there") = value;
            assert_eq!(verdict(&usual, &report).as_deref(), Some(expected));
        }
        // A damaged file in which no page is found to be is no test.
        assert!(verdict(&damaged, &report()).is_some());
    }

    #[test]
    fn a_flight_that_failed_has_a_line_too() {
        let ok = Flown { name: "a", report: report(), verdict: None };
        let failed = Flown { name: "b", report: Value::Null, verdict: Some("why".into()) };
        let text = table(&[ok, failed]);
        let lines: Vec<_> = text.lines().collect();
        assert!(lines[1].contains("19.07 to 19.45 (+2.0 %)") && lines[1].ends_with("ok"), "{text}");
        assert!(lines[2].starts_with('b') && lines[2].ends_with("why"), "{text}");
    }
}
