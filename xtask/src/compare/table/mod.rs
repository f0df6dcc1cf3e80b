//! Results as text.

mod building;
mod decimation;
mod streams;

pub use building::building;
pub use decimation::decimation;
pub use streams::streams;

use serde_json::Value;

/// The list under a key, or the value itself without one; nothing where it is no list.
pub fn rows<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    let list = if key.is_empty() { value } else { &value[key] };
    list.as_array().map_or(&[], Vec::as_slice)
}

pub fn number(value: &Value, path: &str) -> Option<f64> {
    value.pointer(path).and_then(Value::as_f64)
}

pub fn scaled(value: &Value, path: &str, factor: f64) -> Option<f64> {
    number(value, path).map(|number| number * factor)
}

pub fn text(value: &Value, path: &str) -> String {
    value.pointer(path).and_then(Value::as_str).unwrap_or_default().to_owned()
}

/// A number that may not be there.
pub fn fixed(number: Option<f64>, digits: usize) -> String {
    number.map_or_else(|| "–".to_owned(), |number| format!("{number:.digits$}"))
}

/// A factor with the quartiles about it.
pub fn spread(value: &Value, path: &str) -> String {
    let part = |key: &str| number(value, &format!("{path}/{key}"));
    match (part("median"), part("low"), part("high")) {
        (Some(median), Some(low), Some(high)) => format!("{median:.2} ({low:.2}–{high:.2})"),
        _ => "–".to_owned(),
    }
}

/// Cells of how far two meshes are apart, there and back, for `mean`, `rms` or `max`.
pub fn distances(value: &Value, path: &str, whats: &[&str]) -> Vec<String> {
    let mut cells = Vec::new();
    for what in whats {
        for side in ["a_to_b", "b_to_a"] {
            cells.push(fixed(number(value, &format!("{path}/{side}/{what}_percent")), 4));
        }
    }
    cells
}

/// A count that may not be there.
pub fn whole(value: &Value, path: &str) -> String {
    value.pointer(path).and_then(Value::as_u64).map_or_else(|| "–".to_owned(), grouped)
}

/// A count with its digits in groups of three.
pub fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// The first column to the left, the others to the right; a line of two cells is no part of the columns.
pub fn aligned(lines: &[Vec<String>]) -> String {
    let num_columns = lines.first().map_or(0, Vec::len);
    let width = |column: usize| {
        let whole_lines = lines.iter().filter(|line| column == 0 || line.len() == num_columns);
        whole_lines.map(|line| line[column].chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..num_columns).map(width).collect();
    lines
        .iter()
        .map(|line| {
            let mut text = format!("{:<width$}", line[0], width = widths[0]);
            for (cell, width) in line[1..].iter().zip(&widths[1..]) {
                let width = if line.len() == num_columns { *width } else { 0 };
                text += &format!("  {cell:>width$}");
            }
            text.trim_end().to_owned() + "\n"
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn counts_are_grouped_and_what_is_missing_is_a_dash() {
        let counts = [(0, "0"), (999, "999"), (1_000, "1,000"), (1_234_567, "1,234,567")];
        for (count, text) in counts {
            assert_eq!(whole(&json!({ "count": count }), "/count"), text);
        }
        assert_eq!(whole(&Value::Null, "/count"), "–");
        assert_eq!(fixed(None, 2), "–");
    }
}
