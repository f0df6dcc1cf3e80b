//! What came of a run.

use std::fmt;

/// Why there are more triangles than were asked for: how many stayed for each reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MissedTarget {
    /// Triangles at a boundary, which only goes as far as its shape allows.
    pub boundary: u64,
    /// Triangles that can't go without closing a hole or a handle, or losing a component.
    pub topology: u64,
    /// Triangles that can't go without turning one over.
    pub flips: u64,
    /// Triangles that can't go without exceeding the largest error asked for.
    pub error: u64,
}

impl MissedTarget {
    /// The counts with their names.
    pub fn counts(&self) -> [(&'static str, u64); 4] {
        [
            ("boundary", self.boundary),
            ("topology", self.topology),
            ("flips", self.flips),
            ("error", self.error),
        ]
    }
}

/// What was wrong with the input, and was repaired or left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Repairs {
    /// Triangles with a coordinate that is not finite: left out.
    pub non_finite: u64,
    /// Triangles with two corners in one place: left out.
    pub degenerate: u64,
    /// Triangles that were there already: left out.
    pub duplicate: u64,
    /// Triangles at an edge that had its two triangles already, or one of the same direction: cut off along that edge.
    pub non_manifold: u64,
    /// Vertices in which several fans of triangles met, one of which got a vertex of its own.
    pub split_vertices: u64,
    /// Triangles that came after their neighbourhood had been closed, and were attached to what became of it.
    pub late: u64,
    /// Triangles that came after their neighbourhood had been closed, and could not be attached: there is a crack.
    pub late_cracks: u64,
    /// Corners with another colour than the first one at that place had, which all have now.
    pub recoloured: u64,
}

impl Repairs {
    /// What has these counts, in the order of [`counts`](Self::counts).
    pub(crate) fn of(counts: [u64; 8]) -> Self {
        let [
            non_finite,
            degenerate,
            duplicate,
            non_manifold,
            split_vertices,
            late,
            late_cracks,
            recoloured,
        ] = counts;
        Self {
            non_finite,
            degenerate,
            duplicate,
            non_manifold,
            split_vertices,
            late,
            late_cracks,
            recoloured,
        }
    }

    /// The counts with their names.
    pub fn counts(&self) -> [(&'static str, u64); 8] {
        [
            ("non_finite", self.non_finite),
            ("degenerate", self.degenerate),
            ("duplicate", self.duplicate),
            ("non_manifold", self.non_manifold),
            ("split_vertices", self.split_vertices),
            ("late", self.late),
            ("late_cracks", self.late_cracks),
            ("recoloured", self.recoloured),
        ]
    }
}

/// What a run did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct DecimateReport {
    /// Triangles read.
    pub input_triangles: u64,
    /// Triangles written.
    pub output_triangles: u64,
    /// Triangles asked for, where a number was.
    pub target_triangles: Option<u64>,
    /// Why the target was missed, if it was.
    pub missed: Option<MissedTarget>,
    /// Most triangles the buffer held.
    pub peak_buffer_triangles: u64,
    /// What was wrong with the input.
    pub repaired: Repairs,
    /// Whether the input was sorted first.
    pub sorted: bool,
    /// Whether the input was read once more, to learn where its boundaries are.
    pub counted: bool,
    /// Boundary vertices that were taken for true ones because they had waited longest.
    pub sealed_vertices: u64,
}

impl fmt::Display for DecimateReport {
    /// One line, as in `asked 500, got 512: boundary 9, topology 3`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.target_triangles, self.missed) {
            (Some(target), Some(missed)) => {
                write!(f, "asked {target}, got {}", self.output_triangles)?;
                let reasons = missed.counts().into_iter().filter(|&(_, count)| count > 0);
                for (index, (name, count)) in reasons.enumerate() {
                    write!(f, "{} {name} {count}", if index == 0 { ":" } else { "," })?;
                }
                Ok(())
            }
            _ => write!(f, "{} of {} triangles", self.output_triangles, self.input_triangles),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missed_target_is_said_in_words() {
        let report = DecimateReport {
            input_triangles: 1000,
            output_triangles: 512,
            target_triangles: Some(500),
            missed: Some(MissedTarget { boundary: 9, topology: 3, ..Default::default() }),
            ..Default::default()
        };
        assert_eq!(report.to_string(), "asked 500, got 512: boundary 9, topology 3");
        let met = DecimateReport { missed: None, ..report };
        assert_eq!(met.to_string(), "512 of 1000 triangles");
    }
}
